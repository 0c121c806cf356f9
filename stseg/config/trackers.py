"""Constants of the alternative trackers."""

from dataclasses import dataclass
from typing import Literal

from stseg.config.ranges import METRES, SEED, Settings, at_least, not_negative, positive, share, within


@dataclass(frozen=True)
class KalmanConfig(Settings):
    """The tracker `kalman` (HW12 section V.E)."""

    gate_probability: float = share(0.99)
    """Probability that a detection of the tracked person lies within the gate, 0..1."""
    patience: float = not_negative(1.0, "0 or more seconds")
    """Longest time for which a person may go undetected before the track ends, seconds."""


@dataclass(frozen=True)
class ParticleConfig(Settings):
    """The tracker `particles` (Kim and Davis 2006, KD06)."""

    method: Literal["guided", "search", "generic"] = "guided"
    """guided: particles with iterated localisation; search: one hypothesis; generic: no search (KD06 fig. 5)."""
    particles: int = at_least(15, 1, 10_000)
    """Number of particles, each a joint hypothesis of all positions."""
    seed: int = not_negative(0, most=SEED)
    """Seed of the random steps."""
    raster_columns: int = at_least(160, 1, 10_000)
    """Columns to which an image is reduced."""
    iterations: int = at_least(3, 1)
    """Largest number of segment-and-move iterations of a particle in a frame."""
    axis_fit: Literal["squares", "median"] = "squares"
    """Fit of a body's axis to its pixels: least squares, or least median of squares."""
    walking_speed: float = positive(2.0, most=METRES)
    """Speed with which the search radius of an undetected person grows, metres per second."""
    velocity_spread: float = positive(1.2, most=METRES)
    """Random walk of a person, metres per second (standard deviation along each axis)."""
    colour_weight: float = positive(20.0)
    """lambda: weight of the colour distance in the log-weight of a particle, nats."""
    colour_memory: float = positive(10.0)
    """Time constant of a person's colour model, seconds."""
    assignment_distance: float = positive(0.5, most=METRES)
    """Largest distance between a track and a detection that continues it, metres."""
    patience: float = not_negative(1.0, "0 or more seconds")
    """Longest time for which a person may go undetected before the track ends, seconds."""


@dataclass(frozen=True)
class BeliefConfig(Settings):
    """The tracker `belief` (Du and Piater 2006, DP06)."""

    method: Literal["messages", "condensation"] = "messages"
    """messages: the views exchange messages over the ground; condensation: each view alone (DP06 fig. 4)."""
    particles: int = at_least(100, 2, 10_000)
    """Particles of each node: the ground and every view."""
    seed: int = not_negative(0, most=SEED)
    """Seed of the random steps."""
    iterations: int = at_least(5, 1)
    """Largest number of message-passing iterations in a frame."""
    convergence_distance: float = not_negative(0.03, "0 or more metres", most=METRES)
    """Change of the mean position below which message passing ends, metres."""
    position_noise: float = positive(0.5, most=METRES)
    """Random deviation from a straight path, metres per square root of a second (standard deviation)."""
    foot_noise: float = positive(0.03)
    """Error of a position in an image, share of the body's height there (standard deviation)."""
    outlier_rate: float = within(0.1, lambda value: 0 <= value < 1, "0 to below 1")
    """Prior probability that a view follows something other than the target, 0..1 (lambda of eq. 12)."""
    outlier_spread: float = positive(1.0, most=METRES)
    """Spread of such outliers, metres (standard deviation)."""
    colour_weight: float = positive(40.0)
    """Decay of the likelihood with the squared Bhattacharyya distance of colour histograms (Perez et al. 2002)."""
    neutral_distance: float = share(0.3)
    """Squared distance at which colours neither support nor contradict a target, 0..1."""
    colour_memory: float = positive(5.0)
    """Time constant of a target's colour model, seconds."""
    minimum_distance: float = positive(0.25, most=METRES)
    """Distance of two bodies below which they would overlap, metres (s of the exclusion)."""
    assignment_distance: float = positive(0.5, most=METRES)
    """Largest distance between a track and a detection that continues it, metres."""
    patience: float = not_negative(2.0, "0 or more seconds")
    """Longest time for which a person may go undetected before the track ends, seconds."""
