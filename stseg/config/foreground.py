"""Constants of the foreground: background models and sudden changes of light."""

from dataclasses import dataclass, field
from typing import Literal

from stseg.config.ranges import COUNT, Settings, at_least, not_negative, positive, share, within


@dataclass(frozen=True)
class BackgroundConfig(Settings):
    """Assumptions that all background models share (how-it-works, Foreground)."""

    memory: float = positive(60.0)
    """Time constant with which the background follows slow changes, seconds."""
    absorption_time: float = positive(600.0)
    """Time for which an object that was moved in must stay still to become background, seconds."""
    foreground_prior: float = share(0.1)
    """f: prior probability of a person at a pixel, 0..1; guides learning, and is taken out of the evidence."""
    outlier_rate: float = share(1e-3)
    """e: share of background colours that no learned mode explains, 0..1; keeps the likelihood below 1."""
    shadow_prior: float = share(0.1)
    """s: prior probability of shadow on the background, 0..1."""
    darkest_shadow: float = share(0.5)
    """Brightness of the deepest shadow relative to full light, 0..1."""
    shadow_confusion: float = share(0.1)
    """m: share of people's colours that look like shadowed background, 0..1."""
    match_distance: float = positive(5.0)
    """Distance within which a colour belongs to a learned mode, standard deviations."""
    smoothing_radius: int = not_negative(1, "0 or more pixels", most=COUNT)
    """Radius over which log-odds are averaged, pixels; 0 for none."""


@dataclass(frozen=True)
class MixtureConfig(BackgroundConfig):
    """Mixture of Gaussians per pixel (Stauffer and Grimson 1999; Zivkovic 2004)."""

    modes: int = at_least(3, 1, 100)
    """K: modes per pixel; with 1 no object is ever absorbed."""
    background_weight: float = share(0.1)
    """Weight from which a mode is background: share of time in which it is visible, 0..1."""
    minimum_sd: float = positive(4.0)
    """Lower bound of the standard deviation of a mode, grey levels: sensor noise and compression."""
    initial_sd: float = positive(12.0)
    """Standard deviation of a new mode, grey levels."""


@dataclass(frozen=True)
class ChromaticConfig(MixtureConfig):
    """Mixture of Gaussians per pixel, in brightness and chromaticity."""

    minimum_sd: float = positive(3.0)
    """Lower bound of the standard deviation of a mode's brightness, grey levels."""
    chromatic_sd: float = positive(2.0)
    """Lower bound of the standard deviation of a mode's colour across its ray, grey levels."""


@dataclass(frozen=True)
class CodebookConfig(BackgroundConfig):
    """Codebook per pixel (Kim et al. 2005)."""

    codewords: int = at_least(3, 1, 100)
    """K: codewords per pixel; with 1 no object is ever absorbed."""
    channel_sd: float = positive(2.5)
    """sigma: standard deviation of a channel around its codeword, grey levels."""
    highlight_prior: float = share(0.02)
    """h: prior probability of light brighter than any learned, 0..1."""
    brightest_highlight: float = within(1.3, lambda value: value > 1, "a number above 1")
    """Brightness of the strongest highlight relative to the brightest learned, above 1."""
    recurrence: float = share(0.1)
    """Longest absence of background, as a share of the frames it is learned from, 0..1."""
    absence: float = positive(10.0)
    """Longest time for which a new object may be out of view before it is forgotten, seconds."""


@dataclass(frozen=True)
class ForegroundConfig(Settings):
    """Background model of colour cameras. Only the table of the chosen model has an effect."""

    model: Literal["mixture", "chromatic", "codebook"] = "mixture"
    """Background model; docs/configuration.md says where another than the mixture is better."""
    body_rows: float = positive(60.0, "rows, above 0")
    """Target height of a standing person, image rows: larger images are reduced by an integer factor; 10000: never."""
    mixture: MixtureConfig = field(default_factory=MixtureConfig)
    """Constants of the mixture."""
    chromatic: ChromaticConfig = field(default_factory=ChromaticConfig)
    """Constants of the chromatic mixture."""
    codebook: CodebookConfig = field(default_factory=CodebookConfig)
    """Constants of the codebook."""

    @property
    def chosen(self) -> BackgroundConfig:
        """Constants of the chosen model."""
        chosen: BackgroundConfig = getattr(self, self.model)
        return chosen


@dataclass(frozen=True)
class IlluminationConfig(Settings):
    """Sudden changes of light (how-it-works, Foreground)."""

    changed_share: float = share(0.2)
    """Share of a view that must turn into foreground for a change of light, 0..1."""
    change_time: float = positive(2.0, "seconds, above 0")
    """Time within which that happens, seconds."""
    blind_time: float = positive(1.0, "seconds, above 0")
    """Longest time for which a view is ignored while its new light is learned, seconds."""
