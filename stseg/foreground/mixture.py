"""Background as a mixture of Gaussians per pixel, foreground as what it does not explain (METHODS 2).

For a pixel of colour x (BGR, grey levels), with background modes k of weight w_k, mean mu_k and variance var_k,

    L(x) = f p(x | person) / (f p(x | person) + (1 - f) p(x | scene)),
    p(x | scene)  = (1 - e) sum_k w_k [(1 - s) N(x; mu_k, var_k I) + s D(x; mu_k, var_k)] + e U,
    p(x | person) = (1 - m) U + m sum_k w_k D(x; mu_k, var_k),

the posterior probability that the pixel shows a person: a function of the squared Mahalanobis distances to the modes
(KS09, HW12). Its log-odds are held within 5 nats and averaged over the neighbours. U is the uniform density of colours
and D a mode in shadow: a Gaussian around the segment from `darkest` mu to mu, of the mode's own chromaticity, denser
towards mu since penumbras are commoner than deep shadows:

    D(x; mu, var) = 2 t exp(-|x - r mu|^2 / (2 var)) / (2 pi var (l + sqrt(2 pi var))),
    r = clip(x.mu / |mu|^2, darkest, 1),   t = (r - darkest) / (1 - darkest),   l = (1 - darkest) |mu|.

Some clothes look like a darkened wall (m), so L stays soft in the shadow range: about f m / (f m + (1 - f) s).

Learning (Stauffer and Grimson 1999, with selective rates). A frame teaches the nearest mode within `match` standard
deviations. A mode of weight `share` or more is background and learns with rate dt / memory times (1 - L). Any other
mode, and a new one, which takes the place of the weakest, learns so slowly that its weight reaches `share` after
`absorption` seconds: a person may stand that long without fading, and a chair put down for longer becomes background.
Where background shows meanwhile, such a mode is forgotten within the memory; so what flickers must be learned from
the empty scene. A colour that only a shadow explains teaches nothing, and background gives up no mode to people.

Light that changes over the whole view, slowly or at once, is a gain of each channel on all means
(`stseg.foreground.channel_gain`); where a part of it turns darker that is a shadow, where brighter new background after
`absorption`.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import MixtureConfig
from stseg.foreground.background import PixelModel
from stseg.foreground.mixture_kernels import evaluate, update
from stseg.foreground.temporal_mode import commonest_colours


class Mixture(PixelModel):
    """The background of one view, and the likelihood that its pixels show people.

    State: mean float32 (v, u, K, 3) grey levels BGR, variance float32 (v, u, K) squared grey levels, weight float32
    (v, u, K).
    """

    name: ClassVar[str] = "mixture"

    def __init__(self, size: tuple[int, int], frame_rate: float, config: MixtureConfig | None = None) -> None:
        self.config = MixtureConfig() if config is None else config
        shape = (size[1], size[0], self.config.modes)
        arrays = {
            "mean": np.zeros((*shape, 3), np.float32),
            "variance": np.full(shape, self.config.initial_sd**2, np.float32),
            "weight": np.zeros(shape, np.float32),
        }
        super().__init__(size, frame_rate, self.config, arrays)

    def _start(self, frames: NDArray[np.uint8]) -> None:
        config = self.config
        mean, variance = commonest_colours(frames, config.match_distance * config.minimum_sd)
        self._arrays["weight"][:] = 0
        self._arrays["weight"][:, :, 0] = 1
        self._arrays["mean"][:, :, 0] = mean
        self._arrays["variance"][:, :, 0] = np.maximum(variance, config.minimum_sd**2)

    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        rate = 1.0 / (self._frames_learned + 1)
        self._update(slice(None), image, gain, np.ones(image.shape[:2], np.float32), rate, rate)

    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        config = self.config
        priors = (
            config.background_weight,
            config.foreground_prior,
            config.outlier_rate,
            config.shadow_prior,
            config.darkest_shadow,
            config.shadow_confusion,
        )
        mean, variance, weight = self._arrays.values()
        evaluate(image, gain, mean, variance, weight, *priors, log_odds)

    def _update_rows(self, rows: slice, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        self._update(rows, image, gain, likelihood, *learning_rates(self._turn, self.config))

    def _update(self, rows: slice, image: Bytes, gain: Floats, likelihood: Singles, fast: float, slow: float) -> None:
        config = self.config
        update(
            image[rows], gain.astype(np.float32), likelihood[rows], np.float32(fast), np.float32(slow),
            np.float32(config.background_weight), np.float32(config.match_distance), np.float32(config.minimum_sd),
            np.float32(config.initial_sd), *(array[rows] for array in self._arrays.values()),
        )  # fmt: skip


def learning_rates(seconds: float, config: MixtureConfig) -> tuple[float, float]:
    """How much of a mode changes in so many seconds: of background, and of what has moved in."""
    fast = 1.0 - math.exp(-seconds / config.memory)
    return fast, 1.0 - (1.0 - config.background_weight) ** (seconds / config.absorption_time)
