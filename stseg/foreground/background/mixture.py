"""Gaussian mixture background model; foreground is what the mixture does not explain.

After Khan and Shah 2009, section 3, and Huang and Wang 2012; docs/how-it-works.md, Foreground.

For a pixel of colour x (BGR, grey levels), with background modes k of weight w_k, mean mu_k and variance var_k,

    L(x) = f p(x | person) / (f p(x | person) + (1 - f) p(x | scene)),
    p(x | scene)  = (1 - e) sum_k w_k [(1 - s) N(x; mu_k, var_k I) + s D(x; mu_k, var_k)] + e U,
    p(x | person) = (1 - m) U + m sum_k w_k D(x; mu_k, var_k),

the posterior probability that the pixel shows a person: a function of the squared Mahalanobis distances to the modes.
Its log-odds are held within 5 nats and averaged over neighbours. U is the uniform density of colours and D a mode in
shadow: a Gaussian around the segment from `darkest_shadow` mu to mu, of the mode's own chromaticity, denser towards mu
since penumbras are commoner than deep shadows:

    D(x; mu, var) = 2 t exp(-|x - r mu|^2 / (2 var)) / (2 pi var (l + sqrt(2 pi var))),
    r = clip(x.mu / |mu|^2, darkest, 1),   t = (r - darkest) / (1 - darkest),   l = (1 - darkest) |mu|.

Some clothes look like a darkened wall (m), so L stays soft in the shadow range: about f m / (f m + (1 - f) s).

Learning (Stauffer and Grimson 1999, with selective rates). A frame updates the nearest mode within `match_distance`
standard deviations. A mode of weight `background_weight` or more is background and learns with rate dt / memory times
(1 - L). Any other mode, and a new one, which takes the place of the weakest, learns so slowly that its weight reaches
`background_weight` after `absorption_time` seconds: a person may stand that long without fading, and a chair put down
for longer becomes background. Where background shows meanwhile, such a mode is forgotten within the
memory; so what flickers must be learned from the empty scene. A colour that only a shadow explains updates nothing, and
people replace no mode of the background.

Light that changes over the whole view, slowly or at once, is a gain of each channel on all means
(`stseg.foreground.channel_gain`); where a part of it turns darker that is a shadow, where brighter new background after
`absorption_time`.
"""

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import ChromaticConfig, MixtureConfig
from stseg.foreground.background.gaussian_kernels import (
    MEAN,
    VARIANCE,
    Adaptation,
    adapt_mixture,
    fill_mixture_log_odds,
    put_strongest_first,
)
from stseg.foreground.background.model import TURNS, Background
from stseg.foreground.background.temporal_mode import commonest_colours

_MEAN = slice(MEAN, VARIANCE)


class Mixture(Background):
    """Isotropic Gaussian mixture of one view; state `modes` float32 (mode, plane, v, u), see `gaussian_kernels`."""

    name: ClassVar[str] = "mixture"
    variances: ClassVar[int] = 1
    """Variances of a mode: 1 if it is isotropic, 2 if across and along the ray of its chromaticity."""
    _default: ClassVar[MixtureConfig] = MixtureConfig()

    def __init__(self, size: tuple[int, int], frame_rate: float, config: MixtureConfig | None = None) -> None:
        self.config = config = self._default if config is None else config
        least = config.chromatic_sd if isinstance(config, ChromaticConfig) else config.minimum_sd, config.minimum_sd
        numbers = config.background_weight, config.match_distance, config.initial_sd, *least
        super().__init__(size, frame_rate, config, least[0])
        self._constants = tuple(np.float32(number) for number in numbers)
        self.modes = np.zeros((config.modes, VARIANCE + self.variances + 1, size[1], size[0]), np.float32)
        self.modes[:, VARIANCE:-1] = config.initial_sd**2

    def relight(self, gain: Singles) -> None:
        """Multiply all that was learned by gains float32 (v, u, 3), after a change of light."""
        self.modes[:, _MEAN] *= gain.transpose(2, 0, 1)

    def _background_sample(self, step: int) -> Singles:
        return np.asarray(self.modes[0, _MEAN, ::step, ::step].transpose(1, 2, 0))

    def _start(self, frames: NDArray[np.uint8]) -> None:
        config = self.config
        colour, spread = commonest_colours(frames, config.match_distance * config.minimum_sd)
        self.modes[:, -1] = 0
        self.modes[0, _MEAN] = colour.transpose(2, 0, 1)
        self.modes[0, VARIANCE:-1] = np.maximum(spread, config.minimum_sd**2)
        self.modes[0, -1] = 1
        if self.variances == 2:
            self._separate_variances(frames)

    def _separate_variances(self, frames: NDArray[np.uint8]) -> None:
        """Learn the two variances of the first modes from frames; whatever else these teach is discarded."""
        certain, rate = np.ones(frames.shape[1:3], np.float32), 1.0 / len(frames)
        for frame in frames:
            self._update(frame, np.ones(3), certain, (rate, rate), 0, 1)
        self.modes[:, -1], self.modes[0, -1] = 0, 1

    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        rate = 1.0 / (self._frames_learned + 1)
        self._update(image, gain, np.ones(image.shape[:2], np.float32), (rate, rate), 0, 1)
        put_strongest_first(0, 1, self.modes)

    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        weight = self.config.background_weight
        fill_mixture_log_odds(image, gain.astype(np.float32), self.modes, weight, self._priors, log_odds)

    def _update_rows(self, first: int, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        self._update(image, gain, likelihood, learning_rates(self._turn, self.config), first, TURNS)
        put_strongest_first(first, TURNS, self.modes)

    def _update(
        self, image: Bytes, gain: Floats, likelihood: Singles, rates: tuple[float, float], first: int, step: int
    ) -> None:
        adaptation = Adaptation(*map(np.float32, rates), *self._constants)
        adapt_mixture(image, gain.astype(np.float32), likelihood, adaptation, first, step, self.modes)


class Chromatic(Mixture):
    """Gaussian mixture in the chromatic plane, robust to shadow and flickering light (Huang and Wang 2012).

    The same symbols, posterior and selective learning, but each mode has two variances: c of a channel across the ray
    through 0 and mu, which is the chromaticity, and b along it, which is the brightness. With r = x.mu / |mu|^2 a
    colour x is d = |x - r mu| off the chromaticity and a = (r - 1) |mu| brighter than the mode:

        N(x) = exp(-d^2 / (2 c) - a^2 / (2 b)) / (2 pi c sqrt(2 pi b)),
        D(x) = 2 t exp(-d^2 / (2 c) - max(a, 0)^2 / (2 b)) / (2 pi c (l + sqrt(2 pi b))),

    and D = 0 beyond `darkest`. So a darker pixel of the same chromaticity stays background, softly: in full shadow by s
    and m alone, more surely where it is slight; and what is as bright as the background shows by its chromaticity,
    which a scene keeps better than its brightness.

    Why d is in grey levels. The chromatic plane is x / (B + G + R). Let a sensor's noise (reading, rounding,
    compression) have the standard deviation sigma in each channel at every brightness; a chromaticity is then uncertain
    by about sigma / (B + G + R), and a dark pixel's is unknown. The Mahalanobis distance of two chromaticities under
    that noise is exactly d / sigma: d is small in the dark, however far apart the chromaticities, and no darkness is
    divided by.
    """

    name: ClassVar[str] = "chromatic mixture"
    variances: ClassVar[int] = 2
    _default: ClassVar[MixtureConfig] = ChromaticConfig()


def learning_rates(seconds: float, config: MixtureConfig) -> tuple[float, float]:
    """Learning rates of a mode over some seconds: of background, and of what moved in."""
    fast = 1.0 - math.exp(-seconds / config.memory)
    return fast, 1.0 - (1.0 - config.background_weight) ** (seconds / config.absorption_time)
