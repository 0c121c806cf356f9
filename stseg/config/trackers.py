"""Constants of the alternative trackers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stseg.config.ranges import require


@dataclass(frozen=True)
class KalmanConfig:
    """The tracker `kalman` (HW12 section V.E)."""

    gate_probability: float = 0.99
    """Probability that a detection of the tracked person lies within the gate, 0..1."""
    patience: float = 1.0
    """How long a person may go undetected before the track ends, seconds."""

    def __post_init__(self) -> None:
        require(0 < self.gate_probability < 1, self, "gate_probability", "a number between 0 and 1")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class ParticleConfig:
    """The tracker `particles` (Kim and Davis 2006, KD06)."""

    method: Literal["guided", "search", "generic"] = "guided"
    """guided: particles with iterated localisation; search: one hypothesis; generic: no search (KD06 fig. 5)."""
    particles: int = 15
    """Number of particles, each a joint hypothesis of all positions."""
    seed: int = 0
    """Seed of the random steps."""
    raster_columns: int = 160
    """Columns to which an image is reduced."""
    iterations: int = 3
    """Largest number of segment-and-move iterations of a particle in a frame."""
    axis_fit: Literal["squares", "median"] = "squares"
    """Fit of a body's axis to its pixels: least squares, or least median of squares."""
    walking_speed: float = 2.0
    """Speed with which the search radius of an undetected person grows, metres per second."""
    velocity_spread: float = 1.2
    """Random walk of a person, metres per second (standard deviation along each axis)."""
    colour_weight: float = 20.0
    """lambda: weight of the colour distance in the log-weight of a particle, nats."""
    colour_memory: float = 10.0
    """Time constant of a person's colour model, seconds."""
    assignment_distance: float = 0.5
    """Largest distance between a track and a detection that continues it, metres."""
    patience: float = 1.0
    """How long a person may go undetected before the track ends, seconds."""

    def __post_init__(self) -> None:
        for name in ("particles", "raster_columns", "iterations"):
            require(getattr(self, name) >= 1, self, name, "1 or more")
        for name in ("walking_speed", "velocity_spread", "colour_weight", "colour_memory", "assignment_distance"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.seed >= 0, self, "seed", "0 or more")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class BeliefConfig:
    """The tracker `belief` (Du and Piater 2006, DP06)."""

    method: Literal["messages", "condensation"] = "messages"
    """messages: the views exchange messages over the ground; condensation: each view alone (DP06 fig. 4)."""
    particles: int = 100
    """Particles of each node: the ground and every view."""
    seed: int = 0
    """Seed of the random steps."""
    iterations: int = 5
    """Largest number of message-passing iterations in a frame."""
    convergence_distance: float = 0.03
    """Change of the mean position below which message passing ends, metres."""
    position_noise: float = 0.5
    """Random deviation from a straight path, metres per square root of a second (standard deviation)."""
    foot_noise: float = 0.03
    """Error of a position in an image, share of the body's height there (standard deviation)."""
    outlier_rate: float = 0.1
    """Prior probability that a view follows something other than the target, 0..1 (lambda of eq. 12)."""
    outlier_spread: float = 1.0
    """Spread of such outliers, metres (standard deviation)."""
    colour_weight: float = 40.0
    """Decay of the likelihood with the squared Bhattacharyya distance of colour histograms (Perez et al. 2002)."""
    neutral_distance: float = 0.3
    """Squared distance at which colours neither support nor contradict a target, 0..1."""
    colour_memory: float = 5.0
    """Time constant of a target's colour model, seconds."""
    minimum_distance: float = 0.25
    """Distance of two bodies below which they would overlap, metres (s of the exclusion)."""
    assignment_distance: float = 0.5
    """Largest distance between a track and a detection that continues it, metres."""
    patience: float = 2.0
    """How long a person may go undetected before the track ends, seconds."""

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
