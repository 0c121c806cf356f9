"""One frozen dataclass per stage. What each value means physically stands below it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from stseg.settings import require


@dataclass(frozen=True)
class BackgroundConfig:
    """What every background model assumes of scene and camera (METHODS 2); symbols as in `foreground.mixture`."""

    memory: float = 60.0
    """How long background takes to follow a slow change, seconds."""
    absorption: float = 600.0
    """How long a thing that moved in must stay still to become background, seconds."""
    foreground: float = 0.1
    """f: prior probability of a person at a pixel, 0..1; it guides learning and is taken out of the evidence."""
    unexplained: float = 1e-3
    """e: share of background colours that nothing learned explains, 0..1; keeps the likelihood below 1."""
    shadow: float = 0.1
    """s: prior probability that background lies in shadow, 0..1."""
    darkest: float = 0.5
    """Brightness, relative to full light, of the deepest shadow that counts as one, 0..1."""
    mimicry: float = 0.1
    """m: share of people's colours that look like the background in shadow, 0..1."""
    match: float = 5.0
    """Standard deviations within which a colour belongs to what was learned."""
    radius: int = 1
    """Neighbourhood over which log-odds are averaged, pixels; 0 for none."""

    def __post_init__(self) -> None:
        require(self.radius >= 0, self, "radius", "0 or more pixels")
        for key in ("memory", "absorption", "match"):
            require(getattr(self, key) > 0, self, key, "a number above 0")
        for key in ("foreground", "unexplained", "shadow", "darkest", "mimicry"):
            require(0 < getattr(self, key) < 1, self, key, "a number between 0 and 1")


@dataclass(frozen=True)
class MixtureConfig(BackgroundConfig):
    """A mixture of Gaussians per pixel."""

    modes: int = 3
    """K, modes per pixel, 1 or more; with 1 nothing that moved in is ever absorbed."""
    share: float = 0.1
    """Weight from which a mode is background: the share of time that the scene shows it, 0..1."""
    minimum_sd: float = 4.0
    """Least standard deviation of a mode, grey levels: noise of sensor and compression."""
    initial_sd: float = 12.0
    """Standard deviation of a new mode, grey levels."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.modes >= 1, self, "modes", "1 or more")
        require(0 < self.share < 1, self, "share", "a number between 0 and 1")
        for key in ("minimum_sd", "initial_sd"):
            require(getattr(self, key) > 0, self, key, "a number above 0")


@dataclass(frozen=True)
class ChromaticConfig(MixtureConfig):
    """The same, judged across the ray of a colour's chromaticity and along it."""

    minimum_sd: float = 3.0
    """Least standard deviation of a mode's brightness, grey levels: noise of sensor and compression."""
    chromatic_sd: float = 2.0
    """Least standard deviation of a mode's colour across its ray, grey levels."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.chromatic_sd > 0, self, "chromatic_sd", "a number above 0")


@dataclass(frozen=True)
class CodebookConfig(BackgroundConfig):
    """A codebook per pixel (Kim et al. 2005); symbols as in `foreground.codebook`."""

    codewords: int = 3
    """K, codewords per pixel, 1 or more; with 1 nothing that moved in is ever absorbed."""
    noise: float = 2.5
    """sigma: standard deviation of a channel around its codeword, grey levels."""
    highlight: float = 0.02
    """h: prior probability that background is lit brighter than it was ever learned, 0..1."""
    brightest: float = 1.3
    """Brightness, relative to the brightest learned, of the strongest highlight that counts as one, above 1."""
    recurrence: float = 0.1
    """Share of the frames learned among people for which background stays away at a stretch at most, 0..1."""
    absence: float = 10.0
    """How long a thing that moved in may be out of sight at a stretch before it is forgotten, seconds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.codewords >= 1, self, "codewords", "1 or more")
        require(self.noise > 0, self, "noise", "a number above 0")
        require(self.brightest > 1, self, "brightest", "a number above 1")
        require(self.absence > 0, self, "absence", "a number above 0")
        for key in ("highlight", "recurrence"):
            require(0 < getattr(self, key) < 1, self, key, "a number between 0 and 1")


@dataclass(frozen=True)
class ForegroundConfig(MixtureConfig):
    """The background model of colour cameras; what stands here itself is the mixture's."""

    model: Literal["auto", "mixture", "chromatic", "codebook"] = "auto"
    """Which background model; auto is the one that is best where nothing is known of the scene."""
    body_rows: float = 60.0
    """Rows of a standing person that are enough: larger images are reduced by whole factors; 10000 for none."""
    chromatic: ChromaticConfig = field(default_factory=ChromaticConfig)
    """Constants of the chromatic mixture."""
    codebook: CodebookConfig = field(default_factory=CodebookConfig)
    """Constants of the codebook."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.body_rows > 0, self, "body_rows", "rows, above 0")


@dataclass(frozen=True)
class LightConfig:
    """Light that changes at once (METHODS 2)."""

    rise: float = 0.2
    """Share of a view that must turn into foreground for it to be the light that changed, 0..1."""
    within: float = 2.0
    """How fast that happens, seconds."""
    blindness: float = 1.0
    """How long a view may say nothing while its new light is learned, seconds."""

    def __post_init__(self) -> None:
        require(0 < self.rise < 1, self, "rise", "a number between 0 and 1")
        require(self.within > 0, self, "within", "seconds, above 0")
        require(self.blindness > 0, self, "blindness", "seconds, above 0")


@dataclass(frozen=True)
class GhostConfig:
    """The pass that decides which candidates are people (METHODS 7)."""

    heights: tuple[float, ...] = (1.5, 1.6, 1.7, 1.8, 1.9)
    """Heights that are tried, metres."""
    height_mean: float = 1.70
    """Mean height of people, metres (HW12)."""
    height_spread: float = 0.12
    """Standard deviation of their heights, metres."""
    width_mean: float = 0.42
    """Mean width of people across shoulders and arms, metres."""
    width_spread: float = 0.04
    """Standard deviation of their widths, metres."""
    lattice: float = 0.20
    """Spacing of the ground lattice that is searched for candidates, metres."""
    rounds: int = 4
    """How often the frame is searched again for people behind those already found."""
    person: float = -4.0
    """Log-odds of a person at a candidate's place before any view is asked, nats."""
    newcomer: float = 5.0
    """What it costs that somebody stands where nobody was expected, away from the border, nats."""
    border: float = 1.0
    """Distance from the border of area and views over which that cost rises from nothing, metres."""
    apart: float = 0.30
    """Distance below which two bodies would stand inside each other, metres."""
    hit: float = 4.5
    """Log-likelihood ratio of a perfectly fitting box, person against clutter, nats."""
    box_miss: float = 0.20
    """How often a detector misses a person it sees whole."""
    hidden_below: float = 0.20
    """Visible share of a body below which a detector finds hardly anybody."""
    whole_above: float = 0.90
    """Visible share from which on a body is as good as whole."""
    least: float = 0.02
    """Share of hidden people that are found all the same."""
    body_weight: float = 4.0
    """How many independent looks one view's pixels of one body are worth."""
    pixel_miss: float = 0.20
    """How often a body's pixel is missed by the foreground (m of METHODS 4); the volume's first guess."""
    pixel_clutter: float = 0.07
    """How often a ray past all bodies meets foreground (b of METHODS 4); the volume's first guess."""
    trades: int = 2
    """How often larger groups are improved by trades, one person for two and the like, once a frame is settled, where
    all views show pixels. Boxes' scores are too rough: they rise by it, but tracks get worse (docs/ghosts.md)."""

    def __post_init__(self) -> None:
        heights = self.heights
        require(len(heights) > 0 and min(heights) > 0, self, "heights", "one or more heights above 0 m")
        require(list(heights) == sorted(heights) and max(heights) <= 2.2, self, "heights", "rising, at most 2.2 m")
        for name in ("height_mean", "height_spread", "width_mean", "width_spread", "lattice", "apart", "body_weight"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.rounds >= 1, self, "rounds", "1 or more")
        for name in ("box_miss", "least", "pixel_miss", "pixel_clutter"):
            require(0 < getattr(self, name) < 1, self, name, "a number between 0 and 1")
        require(self.hit > 0, self, "hit", "a number above 0")
        require(self.newcomer >= 0, self, "newcomer", "0 or more nats")
        require(self.trades >= 0, self, "trades", "0 or more")
        require(self.border > 0, self, "border", "a number above 0")
        require(
            0 <= self.hidden_below < self.whole_above <= 1, self, "hidden_below", "0 to below whole_above, at most 1"
        )


@dataclass(frozen=True)
class DetectionConfig:
    """Target detection probability, and where the candidates of a frame come from (METHODS 6, 7; HW12 section III)."""

    candidates: Literal["lattice", "probability", "volume", "both"] = "lattice"
    """Where candidates come from beside tracks: the lattice alone, or also the probability, the volume or both."""
    height_mean: float = 1.70
    """Mean height of pillars, metres (HW12)."""
    height_spread: float = 0.15
    """Standard deviation of their heights, metres (HW12)."""
    width_mean: float = 0.30
    """Mean width of pillars, metres (HW12)."""
    width_spread: float = 0.05
    """Standard deviation of their widths, metres (HW12)."""
    sizes: int = 10
    """How many heights, and how many widths, are tried (HW12)."""
    outside: float = 0.08
    """e: what stands for foreground outside the image, the rate of people who are partly seen, 0..1 (HW12)."""
    least: float = 0.02
    """How often a view misses somebody wholly, 0..1."""
    level: float = 0.50
    """Share of a pillar that must show foreground for a view to speak for somebody, 0..1."""
    spacing: float = 0.20
    """Spacing of the ground lattice, metres."""
    kernel: float = 0.30
    """C: kernel of the mean shift, metres; HW12's 0.80 takes two people a metre apart for one."""

    def __post_init__(self) -> None:
        for name in ("height_mean", "height_spread", "width_mean", "width_spread", "spacing", "kernel"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        for name, mean, spread in (
            ("height_mean", self.height_mean, self.height_spread),
            ("width_mean", self.width_mean, self.width_spread),
        ):
            require(mean > 2 * spread, self, name, "more than two standard deviations")
        require(self.sizes >= 2, self, "sizes", "2 or more")
        for name in ("outside", "least", "level"):
            require(0 < getattr(self, name) < 1, self, name, "a number between 0 and 1")


@dataclass(frozen=True)
class OccupancyConfig:
    """Fusion of the views into the volume (METHODS 3, 4)."""

    occupied: float = 0.02
    """Share of the cells that a body fills where the pass of the frame found nobody (pi of METHODS 4)."""
    reach: float = 0.40
    """How far from a person's place their own cells reach, metres."""
    looks: float = 0.6
    """How many independent looks at a cell one view is worth, 0..1: views err together (k of METHODS 4)."""
    sampling: Literal["footprint", "point"] = "footprint"
    """What of a view's map a cell sees: the mean over the pixels that it covers, or the pixel at its centre."""

    def __post_init__(self) -> None:
        require(0 < self.occupied < 1, self, "occupied", "a number between 0 and 1")
        require(self.reach > 0, self, "reach", "a number above 0")
        require(0 < self.looks <= 1, self, "looks", "above 0, at most 1")


@dataclass(frozen=True)
class LevelConfig:
    """How each view errs, learned from the frames that are explained (METHODS 4)."""

    memory: float = 60.0
    """How long the rates take to follow a change, seconds."""
    weight: float = 5.0
    """How long one person, or the empty room, must be seen to count as much as the first guess, seconds."""
    supported: float = 3.0
    """What the other views and the prior must say of a person for a view to be measured by them, nats."""

    def __post_init__(self) -> None:
        require(self.memory > 0, self, "memory", "seconds, above 0")
        require(self.weight > 0, self, "weight", "seconds, above 0")


@dataclass(frozen=True)
class SegmentationConfig:
    """The cut of a window's volume (METHODS 4)."""

    smoothness: float = 0.1
    """lambda: what it costs that two neighbours at no distance differ, nats."""
    spread: float = 0.20
    """s: distance over which that falls to 0.6 of it, metres."""
    step: float = 0.15
    """How far apart the time neighbours of one body are once its motion is followed, metres."""
    neighbours: int = 8
    """How many neighbours a cell has: 8, one step along x, y, the planes or time, or 80, the diagonals too."""

    def __post_init__(self) -> None:
        require(0 <= self.smoothness <= 16, self, "smoothness", "0 to 16 nats")
        require(self.neighbours in (8, 80), self, "neighbours", "8 or 80")
        require(self.spread > 0, self, "spread", "a number above 0")
        require(self.step >= 0, self, "step", "0 or more metres")


@dataclass(frozen=True)
class IdentityConfig:
    """Windows, and tracks out of pieces (METHODS 5)."""

    window: float = 1.0
    """Length of a window, seconds; held between 8 and 30 frames."""
    walking_speed: float = 2.0
    """How fast people walk at most, metres per second."""
    slack: float = 0.35
    """How far a place may be off besides, metres."""
    place_noise: float = 0.15
    """How far a frame's place is off besides its own covariance, metres (standard deviation)."""
    height_noise: float = 0.035
    """How far a frame's height of a person is off where they are seen whole, metres (standard deviation)."""
    width_noise: float = 0.03
    """How far a frame's width of a person is off where they are seen whole, metres (standard deviation)."""
    foresight: float = 0.6
    """How far ahead a track is carried when a window's cells are divided, seconds; beyond that it may be anywhere."""
    patience: float = 2.0
    """How long somebody may be unseen and still be the same, seconds."""
    reunion: float = 4.0
    """How long somebody may be out of sight and still be known again by motion and height, seconds."""
    bridge: float = 1.0
    """How long a gap is filled on a straight line; longer ones stay gaps, seconds."""
    shortest: float = 0.8
    """Tracks shorter than this are nobody, seconds (HW12's temporal check)."""

    def __post_init__(self) -> None:
        for name in ("window", "walking_speed", "place_noise", "height_noise"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        for name in ("slack", "foresight", "patience", "reunion", "bridge", "shortest"):
            require(getattr(self, name) >= 0, self, name, "0 or more")


@dataclass(frozen=True)
class SegmentConfig:
    """Segments: what of a long recording is worked on at once, and committed to disk."""

    length: float = 120.0
    """How much of the recording one segment holds, seconds; a killed run goes on from the last whole one."""
    warm_up: float = 6.0
    """How far before its first frame a segment begins to look, to know who is there, seconds."""
    background: float = 300.0
    """Where no empty scene is given, each so long part of the recording has a background of its own, seconds."""
    samples: int = 40
    """Frames that one is learned from, spread over that part."""

    def __post_init__(self) -> None:
        for name in ("length", "background"):
            require(getattr(self, name) > 0, self, name, "seconds, above 0")
        require(self.warm_up >= 0, self, "warm_up", "0 or more seconds")
        require(self.samples >= 1, self, "samples", "1 or more")


@dataclass(frozen=True)
class LiveConfig:
    """A recording that still goes on: `stseg run --follow`."""

    settled: float = 10.0
    """A file to which nothing was added for so long is complete even if it is the last, seconds."""
    learning: float = 60.0
    """Where a camera has no empty scene, how long it is looked at before the run begins, seconds."""
    stale: float = 0.3
    """How far from a moment, in time, what a live camera shows still stands for it, seconds; three quarters of a frame
    at least."""
    silence: float = 5.0
    """A live stream from which nothing comes for so long is broken, seconds."""
    pause: float = 1.0
    """How long to wait before a broken stream is asked again, seconds; each time in vain it is twice as long."""
    longest_pause: float = 60.0
    """But no longer than this, seconds."""
    waiting: float = 10.0
    """How much of live streams may wait to be worked on, seconds; beyond that the oldest moments are dropped."""
    pictures: float = 512.0
    """How much memory their pictures may take, MiB; beyond that, too."""

    def __post_init__(self) -> None:
        for name in ("settled", "learning", "stale", "silence", "pause", "longest_pause", "waiting", "pictures"):
            require(getattr(self, name) > 0, self, name, "a number above 0")


@dataclass(frozen=True)
class KalmanConfig:
    """The tracker `kalman` (HW12 section V.E; METHODS 9)."""

    turn: float = 0.8
    """How people change their velocity, metres per second per square root of a second (standard deviation)."""
    pace: float = 0.8
    """Standard deviation of the velocity of somebody new, metres per second."""
    gate: float = 0.99
    """Share of a person's own places that lie within their gate, 0..1."""
    patience: float = 1.0
    """How long somebody may be unseen and still be the same, seconds."""

    def __post_init__(self) -> None:
        for name in ("turn", "pace"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(0 < self.gate < 1, self, "gate", "a number between 0 and 1")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class ParticleConfig:
    """The tracker `particles` (KD06; METHODS 9)."""

    way: Literal["guided", "search", "generic"] = "guided"
    """guided: particles that search. search: one hypothesis that does. generic: particles that do not (KD06 fig. 5)."""
    count: int = 15
    """Number of particles: hypotheses of where everybody stands."""
    seed: int = 0
    """Of the random steps."""
    columns: int = 160
    """Columns of the raster on which an image is looked at."""
    rounds: int = 3
    """How often a particle is segmented and moved in a frame, at most."""
    axis: Literal["squares", "median"] = "squares"
    """How a body's axis is fitted to its pixels: by least squares, or by the least median of squares."""
    wander: float = 1.2
    """How fast people walk about, metres per second (standard deviation along x and along y)."""
    sharpness: float = 20.0
    """lambda: how strongly colours that do not fit speak against a particle, nats."""
    memory: float = 10.0
    """How long the colours of a person take to follow a change, seconds."""
    beside: float = 0.5
    """How far from a followed person somebody found may be and still be the same, metres."""
    patience: float = 1.0
    """How long somebody may be followed whom nothing finds, seconds."""

    def __post_init__(self) -> None:
        for name in ("count", "columns", "rounds"):
            require(getattr(self, name) >= 1, self, name, "1 or more")
        for name in ("wander", "sharpness", "memory", "beside"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.seed >= 0, self, "seed", "0 or more")
        require(self.patience >= 0, self, "patience", "0 or more seconds")


@dataclass(frozen=True)
class LabelConfig:
    """Which person each pixel shows (METHODS 7; HW12 eqs 13 to 20); the first six by tools/learn_label_weights.py."""

    detection: float = 6.55
    """c1: what a label costs that contradicts a certain foreground, nats."""
    adjacency: float = 10.01
    """c2: what it costs that neighbouring pixels of the same colour differ, nats."""
    alike: float = 31.0
    """k1: difference of two colours from which differing labels cost nothing, grey levels."""
    slope: float = 12.0
    """k2: over which difference that cost falls, grey levels."""
    colourless: float = 0.08
    """What of c2 it costs where there are no colours, in masks: the mean of g at true borders, 0..1."""
    place_spread: float = 0.08
    """How far a pillar is off besides its place's own covariance, metres (standard deviation)."""
    draws: int = 64
    """How many pillars are drawn for each person."""
    height_spread: float = 0.05
    """How far a person's height is off, metres (standard deviation)."""
    width: float = 0.30
    """Mean width of a body over its height, metres (HW12)."""
    width_spread: float = 0.05
    """How far the widths of bodies differ, metres (standard deviation; HW12)."""
    outside: float = 1e-3
    """Share of the pixels that show somebody, or nobody, against all the pillars that were drawn, 0..1."""

    def __post_init__(self) -> None:
        for name in ("detection", "adjacency", "alike", "colourless", "height_spread", "width_spread"):
            require(getattr(self, name) >= 0, self, name, "0 or more")
        for name in ("slope", "place_spread", "width"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.draws >= 1, self, "draws", "1 or more")
        require(0 < self.outside < 1, self, "outside", "a number between 0 and 1")


@dataclass(frozen=True)
class BeliefConfig:
    """The tracker `belief` (DP06; METHODS 9)."""

    way: Literal["messages", "condensation"] = "messages"
    """messages: the views tell each other by way of the ground. condensation: each view by itself (DP06 fig. 4)."""
    count: int = 100
    """Number of particles of each node: the ground and every view."""
    seed: int = 0
    """Of the random steps."""
    rounds: int = 5
    """Rounds of messages in a frame at most."""
    settled: float = 0.03
    """A target's messages rest when its mean place moves by less than this in a round, metres."""
    wander: float = 0.5
    """How people leave a straight line, metres per square root of a second (standard deviation)."""
    turn: float = 0.8
    """How they change their velocity, metres per second per square root of a second (standard deviation)."""
    foot: float = 0.03
    """How far a place in an image is off, share of the body's height there (standard deviation)."""
    outlier: float = 0.1
    """Prior probability that a view follows something else than the target (lambda of eq. 12), 0..1."""
    outlier_spread: float = 1.0
    """How far off that is, metres (standard deviation)."""
    sharpness: float = 40.0
    """How fast the likelihood falls with the squared Bhattacharyya distance of two histograms (Perez et al. 2002)."""
    doubt: float = 0.3
    """Squared distance at which colours speak neither for the target nor against it, 0..1."""
    memory: float = 5.0
    """How long the colours of a target take to follow what a detection shows, seconds."""
    apart: float = 0.25
    """Distance below which two bodies would stand inside each other (s of the exclusion), metres."""
    beside: float = 0.5
    """How far from a followed person somebody found may be and still be the same, metres."""
    patience: float = 2.0
    """How long somebody may be followed whom nothing finds, seconds."""

    def __post_init__(self) -> None:
        require(self.count >= 2, self, "count", "2 or more")
        require(self.rounds >= 1, self, "rounds", "1 or more")
        require(0 <= self.outlier < 1, self, "outlier", "0 to below 1")
        require(0 < self.doubt < 1, self, "doubt", "a number between 0 and 1")
        require(self.settled >= 0, self, "settled", "0 or more metres")
        require(self.seed >= 0, self, "seed", "0 or more")
        require(self.patience >= 0, self, "patience", "0 or more seconds")
        for name in ("wander", "turn", "foot", "outlier_spread", "sharpness", "memory", "apart", "beside"):
            require(getattr(self, name) > 0, self, name, "a number above 0")


@dataclass(frozen=True)
class Config:
    """All stages."""

    foreground: ForegroundConfig = field(default_factory=ForegroundConfig)
    light: LightConfig = field(default_factory=LightConfig)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    level: LevelConfig = field(default_factory=LevelConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    identity: IdentityConfig = field(default_factory=IdentityConfig)
    ghosts: GhostConfig = field(default_factory=GhostConfig)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    segments: SegmentConfig = field(default_factory=SegmentConfig)
    live: LiveConfig = field(default_factory=LiveConfig)
    kalman: KalmanConfig = field(default_factory=KalmanConfig)
    particles: ParticleConfig = field(default_factory=ParticleConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    belief: BeliefConfig = field(default_factory=BeliefConfig)
