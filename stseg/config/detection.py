"""Constants of the people of a frame: candidates, ghosts, the volume, labels of pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stseg.settings import require


@dataclass(frozen=True)
class DetectionConfig:
    """The pass that decides which candidates are people (METHODS 7)."""

    lattice_spacing: float = 0.20
    """Spacing of the ground lattice that is searched for candidates, metres."""
    search_rounds: int = 4
    """How often the frame is searched again for people behind those already found."""
    prior_log_odds: float = -4.0
    """Log-odds of a person at a candidate's place before any view is asked, nats."""
    birth_cost: float = 5.0
    """What it costs that somebody stands where nobody was expected, away from the border, nats."""
    border_width: float = 1.0
    """Distance from the border of area and views over which that cost rises from nothing, metres."""
    minimum_distance: float = 0.30
    """Distance below which two bodies would stand inside each other, metres."""
    box_log_ratio: float = 4.5
    """Log-likelihood ratio of a perfectly fitting box, person against clutter, nats."""
    box_miss_rate: float = 0.20
    """How often a detector misses a person it sees whole."""
    hidden_visibility: float = 0.20
    """Visible share of a body below which a detector finds hardly anybody."""
    full_visibility: float = 0.90
    """Visible share from which on a body is as good as whole."""
    hidden_detection_rate: float = 0.02
    """Share of hidden people that are found all the same."""
    effective_observations: float = 4.0
    """How many independent looks one view's pixels of one body are worth."""
    pixel_miss_rate: float = 0.20
    """How often a body's pixel is missed by the foreground (m of METHODS 4); the volume's first guess."""
    pixel_clutter_rate: float = 0.07
    """How often a ray past all bodies meets foreground (b of METHODS 4); the volume's first guess."""
    swap_moves: int = 2
    """How often larger groups are improved by trades, one person for two and the like, once a frame is settled, where
    all views show pixels. Boxes' scores are too rough: they rise by it, but tracks get worse (docs/ghosts.md)."""

    def __post_init__(self) -> None:
        for name in (
            "lattice_spacing",
            "minimum_distance",
            "effective_observations",
        ):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.search_rounds >= 1, self, "search_rounds", "1 or more")
        for name in ("box_miss_rate", "hidden_detection_rate", "pixel_miss_rate", "pixel_clutter_rate"):
            require(0 < getattr(self, name) < 1, self, name, "a number between 0 and 1")
        require(self.box_log_ratio > 0, self, "box_log_ratio", "a number above 0")
        require(self.birth_cost >= 0, self, "birth_cost", "0 or more nats")
        require(self.swap_moves >= 0, self, "swap_moves", "0 or more")
        require(self.border_width > 0, self, "border_width", "a number above 0")
        require(
            0 <= self.hidden_visibility < self.full_visibility <= 1,
            self,
            "hidden_visibility",
            "0 to below full_visibility, at most 1",
        )


@dataclass(frozen=True)
class ProposalConfig:
    """Target detection probability, and where the candidates of a frame come from (METHODS 6, 7; HW12 section III)."""

    source: Literal["lattice", "probability", "volume", "both"] = "lattice"
    """Where candidates come from beside tracks: the lattice alone, or also the probability, the volume or both."""
    body_sizes: int = 10
    """How many heights, and how many widths, are tried (HW12)."""
    unseen_rate: float = 0.08
    """e: what stands for foreground outside the image, the rate of people who are partly seen, 0..1 (HW12)."""
    view_miss_rate: float = 0.02
    """How often a view misses somebody wholly, 0..1."""
    covered_share: float = 0.50
    """Share of a pillar that must show foreground for a view to speak for somebody, 0..1."""
    lattice_spacing: float = 0.20
    """Spacing of the ground lattice, metres."""
    kernel_radius: float = 0.30
    """C: kernel of the mean shift, metres; HW12's 0.80 takes two people a metre apart for one."""

    def __post_init__(self) -> None:
        for name in ("lattice_spacing", "kernel_radius"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.body_sizes >= 2, self, "body_sizes", "2 or more")
        for name in ("unseen_rate", "view_miss_rate", "covered_share"):
            require(0 < getattr(self, name) < 1, self, name, "a number between 0 and 1")


@dataclass(frozen=True)
class OccupancyConfig:
    """Fusion of the views into the volume (METHODS 3, 4)."""

    occupied_share: float = 0.02
    """Share of the cells that a body fills where the pass of the frame found nobody (pi of METHODS 4)."""
    person_radius: float = 0.40
    """How far from a person's place their own cells reach, metres."""
    effective_observations: float = 0.6
    """How many independent looks at a cell one view is worth, 0..1: views err together (k of METHODS 4)."""
    sampling: Literal["footprint", "point"] = "footprint"
    """What of a view's map a cell sees: the mean over the pixels that it covers, or the pixel at its centre."""

    def __post_init__(self) -> None:
        require(0 < self.occupied_share < 1, self, "occupied_share", "a number between 0 and 1")
        require(self.person_radius > 0, self, "person_radius", "a number above 0")
        require(0 < self.effective_observations <= 1, self, "effective_observations", "above 0, at most 1")


@dataclass(frozen=True)
class ErrorRateConfig:
    """How each view errs, learned from the frames that are explained (METHODS 4)."""

    memory: float = 60.0
    """How long the rates take to follow a change, seconds."""
    prior_weight: float = 5.0
    """How long one person, or the empty room, must be seen to count as much as the first guess, seconds."""
    minimum_evidence: float = 3.0
    """What the other views and the prior must say of a person for a view to be measured by them, nats."""

    def __post_init__(self) -> None:
        require(self.memory > 0, self, "memory", "seconds, above 0")
        require(self.prior_weight > 0, self, "prior_weight", "seconds, above 0")


@dataclass(frozen=True)
class LabelConfig:
    """Which person each pixel shows (METHODS 7; HW12 eqs 13 to 20); the first six by tools/learn_label_weights.py."""

    foreground_weight: float = 6.55
    """c1: what a label costs that contradicts a certain foreground, nats."""
    boundary_weight: float = 10.01
    """c2: what it costs that neighbouring pixels of the same colour differ, nats."""
    contrast_limit: float = 31.0
    """k1: difference of two colours from which differing labels cost nothing, grey levels."""
    contrast_slope: float = 12.0
    """k2: over which difference that cost falls, grey levels."""
    colourless_factor: float = 0.08
    """What of c2 it costs where there are no colours, in masks: the mean of g at true borders, 0..1."""
    position_noise: float = 0.08
    """How far a pillar is off besides its place's own covariance, metres (standard deviation)."""
    samples: int = 64
    """How many pillars are drawn for each person."""
    height_noise: float = 0.05
    """How far a person's height is off, metres (standard deviation)."""
    outlier_rate: float = 1e-3
    """Share of the pixels that show somebody, or nobody, against all the pillars that were drawn, 0..1."""

    def __post_init__(self) -> None:
        for name in (
            "foreground_weight",
            "boundary_weight",
            "contrast_limit",
            "colourless_factor",
            "height_noise",
        ):
            require(getattr(self, name) >= 0, self, name, "0 or more")
        for name in ("contrast_slope", "position_noise"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.samples >= 1, self, "samples", "1 or more")
        require(0 < self.outlier_rate < 1, self, "outlier_rate", "a number between 0 and 1")
