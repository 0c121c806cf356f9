"""Constants of per-frame detection, candidate proposals, the occupancy volume and pixel labels."""

from dataclasses import dataclass
from typing import Literal

from stseg.config.ranges import COUNT, METRES, Settings, at_least, not_negative, positive, share, within


@dataclass(frozen=True)
class DetectionConfig(Settings):
    """Per-frame detection: maximum a posteriori set of people (HW12 section IV; how-it-works, Detection)."""

    lattice_spacing: float = positive(0.20, most=METRES)
    """Spacing of the ground lattice that is searched for candidates, metres."""
    search_rounds: int = at_least(4, 1)
    """Rounds of search per frame; each searches for people hidden by those already found."""
    prior_log_odds: float = -4.0
    """Prior log-odds of a person at a candidate position, nats; raise it against misses, lower it against ghosts."""
    birth_cost: float = not_negative(5.0, "0 or more nats")
    """Cost of a detection that continues no track, away from the border, nats."""
    border_width: float = positive(1.0, most=METRES)
    """Width of the border strip along which the birth cost rises from nothing, metres."""
    minimum_distance: float = positive(0.30, most=METRES)
    """Distance of two bodies below which they would overlap, metres."""
    box_log_ratio: float = positive(4.5)
    """Log-likelihood ratio, person against clutter, of a box that fits perfectly, nats."""
    box_miss_rate: float = share(0.20)
    """Probability that a detector misses a fully visible person, 0..1; the least that a run learns."""
    full_visibility: float = within(0.90, lambda value: 0 < value <= 1, "above 0, at most 1")
    """Visible share of a body from which a detector finds it as if fully visible, 0..1; below, in proportion."""
    hidden_detection_rate: float = share(0.02)
    """Share of hidden people that a detector finds all the same, 0..1."""
    effective_observations: float = positive(4.0)
    """Effective number of independent observations in one view's pixels of one body."""
    pixel_miss_rate: float = share(0.20)
    """Probability that the foreground misses a pixel of a body, 0..1 (m); the volume's first guess."""
    pixel_clutter_rate: float = share(0.07)
    """Probability of foreground on a ray past all bodies, 0..1 (b); the volume's first guess."""
    key_frame_interval: float = not_negative(0.5, "0 or more seconds")
    """Longest time between frames whose whole ground is searched, seconds; by boxes 0.2 at most, 0 for every frame."""
    swap_moves: int = not_negative(2, most=COUNT)
    """Rounds of swap moves (one person for two, and the like) in larger groups, where all views deliver pixels."""


@dataclass(frozen=True)
class ProposalConfig(Settings):
    """Further sources of candidates, and the target detection probability (HW12 section III, eqs 6 and 7)."""

    source: Literal["lattice", "probability", "volume", "both"] = "lattice"
    """Source of candidates beside tracks and lattice: none (lattice), the probability, modes of the volume, or both."""
    body_sizes: int = at_least(10, 2)
    """Number of heights, and of widths, that the probability marginalises over (HW12)."""
    unseen_rate: float = share(0.08)
    """e: foreground probability assumed outside the image, 0..1 (HW12)."""
    view_miss_rate: float = share(0.02)
    """Probability that a view misses a person completely, 0..1."""
    covered_share: float = share(0.50)
    """Share of a pillar that must be foreground for a view to support a person, 0..1."""
    lattice_spacing: float = positive(0.20, most=METRES)
    """Spacing of the ground lattice of the probability, metres."""
    kernel_radius: float = positive(0.30, most=METRES)
    """C: radius of the mean-shift kernel, metres; HW12's 0.80 merges two people a metre apart."""


@dataclass(frozen=True)
class OccupancyConfig(Settings):
    """Fusion of the views into the volume of log-odds (how-it-works, Fusion)."""

    occupied_share: float = share(0.02)
    """Prior share of occupied cells where no person was detected, 0..1 (pi)."""
    person_radius: float = positive(0.40, most=METRES)
    """Radius around a person's position within which cells may be theirs, metres."""
    effective_observations: float = within(0.6, lambda value: 0 < value <= 1, "above 0, at most 1")
    """Effective number of independent observations of a cell in one view, 0..1: views err together (k)."""
    sampling: Literal["footprint", "point"] = "footprint"
    """Sampling of a view by a cell: mean over the pixels of its footprint, or the pixel at its centre."""


@dataclass(frozen=True)
class ErrorRateConfig(Settings):
    """Noise calibration: learned miss and false-alarm rates of each view (how-it-works, Fusion)."""

    memory: float = positive(60.0, "seconds, above 0")
    """Time constant of the learned rates, seconds."""
    prior_weight: float = positive(5.0, "seconds, above 0")
    """Weight of the first guess: seconds of one person, or of empty ground."""
    minimum_evidence: float = 3.0
    """Support of a person by the other views and the prior from which a view is measured by them, nats."""


@dataclass(frozen=True)
class LabelConfig(Settings):
    """Pixel labels (HW12 eqs 13 to 20). The first five weights are fitted on simulated scenes."""

    foreground_weight: float = not_negative(6.55)
    """c1: cost of a label that contradicts certain foreground or background, nats."""
    boundary_weight: float = not_negative(10.01)
    """c2: cost of a label boundary between neighbouring pixels of equal colour, nats."""
    contrast_limit: float = not_negative(31.0)
    """k1: colour difference from which a boundary costs nothing, grey levels."""
    contrast_slope: float = positive(12.0)
    """k2: range of colour differences over which that cost falls, grey levels."""
    colourless_factor: float = not_negative(0.08)
    """Share of c2 at a boundary in masks, which have no colours, 0..1."""
    position_noise: float = positive(0.08, most=METRES)
    """Error of a position beyond its own covariance, metres (standard deviation)."""
    samples: int = at_least(64, 1, 10_000)
    """Pillars drawn for each person."""
    height_noise: float = not_negative(0.05, most=METRES)
    """Error of a person's height, metres (standard deviation)."""
    outlier_rate: float = share(1e-3)
    """Share of pixels with a label that no drawn pillar explains, 0..1."""
