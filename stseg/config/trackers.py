"""Constants of the trackers beside the cut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stseg.settings import require


@dataclass(frozen=True)
class KalmanConfig:
    """The tracker `kalman` (HW12 section V.E; METHODS 9)."""

    gate_probability: float = 0.99
    """Share of a person's own places that lie within their gate, 0..1."""
    patience: float = 1.0
    """How long somebody may be unseen and still be the same, seconds."""

    def __post_init__(self) -> None:
        require(0 < self.gate_probability < 1, self, "gate_probability", "a number between 0 and 1")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class ParticleConfig:
    """The tracker `particles` (KD06; METHODS 9)."""

    method: Literal["guided", "search", "generic"] = "guided"
    """guided: particles that search. search: one hypothesis that does. generic: particles that do not (KD06 fig. 5)."""
    particles: int = 15
    """Number of particles: hypotheses of where everybody stands."""
    seed: int = 0
    """Of the random steps."""
    raster_columns: int = 160
    """Columns of the raster on which an image is looked at."""
    iterations: int = 3
    """How often a particle is segmented and moved in a frame, at most."""
    axis_fit: Literal["squares", "median"] = "squares"
    """How a body's axis is fitted to its pixels: by least squares, or by the least median of squares."""
    walking_speed: float = 2.0
    """Highest speed at which a person who is not seen walks on, metres per second."""
    velocity_spread: float = 1.2
    """How fast people walk about, metres per second (standard deviation along x and along y)."""
    colour_weight: float = 20.0
    """lambda: how strongly colours that do not fit speak against a particle, nats."""
    colour_memory: float = 10.0
    """How long the colours of a person take to follow a change, seconds."""
    assignment_distance: float = 0.5
    """How far from a followed person somebody found may be and still be the same, metres."""
    patience: float = 1.0
    """How long somebody may be followed whom nothing finds, seconds."""

    def __post_init__(self) -> None:
        for name in ("particles", "raster_columns", "iterations"):
            require(getattr(self, name) >= 1, self, name, "1 or more")
        for name in ("walking_speed", "velocity_spread", "colour_weight", "colour_memory", "assignment_distance"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.seed >= 0, self, "seed", "0 or more")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class BeliefConfig:
    """The tracker `belief` (DP06; METHODS 9)."""

    method: Literal["messages", "condensation"] = "messages"
    """messages: the views tell each other by way of the ground. condensation: each view by itself (DP06 fig. 4)."""
    particles: int = 100
    """Number of particles of each node: the ground and every view."""
    seed: int = 0
    """Of the random steps."""
    iterations: int = 5
    """Rounds of messages in a frame at most."""
    convergence_distance: float = 0.03
    """A target's messages rest when its mean place moves by less than this in a round, metres."""
    position_noise: float = 0.5
    """How people leave a straight line, metres per square root of a second (standard deviation)."""
    foot_noise: float = 0.03
    """How far a place in an image is off, share of the body's height there (standard deviation)."""
    outlier_rate: float = 0.1
    """Prior probability that a view follows something else than the target (lambda of eq. 12), 0..1."""
    outlier_spread: float = 1.0
    """How far off that is, metres (standard deviation)."""
    colour_weight: float = 40.0
    """How fast the likelihood falls with the squared Bhattacharyya distance of two histograms (Perez et al. 2002)."""
    neutral_distance: float = 0.3
    """Squared distance at which colours speak neither for the target nor against it, 0..1."""
    colour_memory: float = 5.0
    """How long the colours of a target take to follow what a detection shows, seconds."""
    minimum_distance: float = 0.25
    """Distance below which two bodies would stand inside each other (s of the exclusion), metres."""
    assignment_distance: float = 0.5
    """How far from a followed person somebody found may be and still be the same, metres."""
    patience: float = 2.0
    """How long somebody may be followed whom nothing finds, seconds."""

    def __post_init__(self) -> None:
        require(self.particles >= 2, self, "particles", "2 or more")
        require(self.iterations >= 1, self, "iterations", "1 or more")
        require(0 <= self.outlier_rate < 1, self, "outlier_rate", "0 to below 1")
        require(0 < self.neutral_distance < 1, self, "neutral_distance", "a number between 0 and 1")
        require(self.convergence_distance >= 0, self, "convergence_distance", "0 or more metres")
        require(self.seed >= 0, self, "seed", "0 or more")
        require(self.patience >= 0, self, "patience", "0 or more seconds")
        for name in (
            "position_noise",
            "foot_noise",
            "outlier_spread",
            "colour_weight",
            "colour_memory",
            "minimum_distance",
            "assignment_distance",
        ):
            require(getattr(self, name) > 0, self, name, "a number above 0")
