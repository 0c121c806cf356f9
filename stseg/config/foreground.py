"""Constants of the evidence of views."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from stseg.settings import require


@dataclass(frozen=True)
class BackgroundConfig:
    """What every background model assumes of scene and camera (METHODS 2); symbols as in `foreground.mixture`."""

    memory: float = 60.0
    """How long background takes to follow a slow change, seconds."""
    absorption_time: float = 600.0
    """How long a thing that moved in must stay still to become background, seconds."""
    foreground_prior: float = 0.1
    """f: prior probability of a person at a pixel, 0..1; it guides learning and is taken out of the evidence."""
    outlier_rate: float = 1e-3
    """e: share of background colours that nothing learned explains, 0..1; keeps the likelihood below 1."""
    shadow_prior: float = 0.1
    """s: prior probability that background lies in shadow, 0..1."""
    darkest_shadow: float = 0.5
    """Brightness, relative to full light, of the deepest shadow that counts as one, 0..1."""
    shadow_confusion: float = 0.1
    """m: share of people's colours that look like the background in shadow, 0..1."""
    match_distance: float = 5.0
    """Standard deviations within which a colour belongs to what was learned."""
    smoothing_radius: int = 1
    """Neighbourhood over which log-odds are averaged, pixels; 0 for none."""

    def __post_init__(self) -> None:
        require(self.smoothing_radius >= 0, self, "smoothing_radius", "0 or more pixels")
        for key in ("memory", "absorption_time", "match_distance"):
            require(getattr(self, key) > 0, self, key, "a number above 0")
        for key in ("foreground_prior", "outlier_rate", "shadow_prior", "darkest_shadow", "shadow_confusion"):
            require(0 < getattr(self, key) < 1, self, key, "a number between 0 and 1")


@dataclass(frozen=True)
class MixtureConfig(BackgroundConfig):
    """A mixture of Gaussians per pixel."""

    modes: int = 3
    """K, modes per pixel, 1 or more; with 1 nothing that moved in is ever absorbed."""
    background_weight: float = 0.1
    """Weight from which a mode is background: the share of time that the scene shows it, 0..1."""
    minimum_sd: float = 4.0
    """Least standard deviation of a mode, grey levels: noise of sensor and compression."""
    initial_sd: float = 12.0
    """Standard deviation of a new mode, grey levels."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.modes >= 1, self, "modes", "1 or more")
        require(0 < self.background_weight < 1, self, "background_weight", "a number between 0 and 1")
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
    channel_sd: float = 2.5
    """sigma: standard deviation of a channel around its codeword, grey levels."""
    highlight_prior: float = 0.02
    """h: prior probability that background is lit brighter than it was ever learned, 0..1."""
    brightest_highlight: float = 1.3
    """Brightness, relative to the brightest learned, of the strongest highlight that counts as one, above 1."""
    recurrence: float = 0.1
    """Share of the frames learned among people for which background stays away at a stretch at most, 0..1."""
    absence: float = 10.0
    """How long a thing that moved in may be out of sight at a stretch before it is forgotten, seconds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.codewords >= 1, self, "codewords", "1 or more")
        require(self.channel_sd > 0, self, "channel_sd", "a number above 0")
        require(self.brightest_highlight > 1, self, "brightest_highlight", "a number above 1")
        require(self.absence > 0, self, "absence", "a number above 0")
        for key in ("highlight_prior", "recurrence"):
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
class IlluminationConfig:
    """Light that changes at once (METHODS 2)."""

    changed_share: float = 0.2
    """Share of a view that must turn into foreground for it to be the light that changed, 0..1."""
    change_time: float = 2.0
    """How fast that happens, seconds."""
    blind_time: float = 1.0
    """How long a view may say nothing while its new light is learned, seconds."""

    def __post_init__(self) -> None:
        require(0 < self.changed_share < 1, self, "changed_share", "a number between 0 and 1")
        require(self.change_time > 0, self, "change_time", "seconds, above 0")
        require(self.blind_time > 0, self, "blind_time", "seconds, above 0")
