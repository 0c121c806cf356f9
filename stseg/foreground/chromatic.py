"""Background as a mixture judged in the chromatic plane, so that shadow is removed and light may flicker (HW12).

The mixture of `stseg.foreground.mixture`, with the same symbols, the same posterior and the same selective learning,
but each mode has two variances: c of a channel across the ray through 0 and mu, which is the chromaticity, and b along
it, which is the brightness. With r = x.mu / |mu|^2 a colour x is d = |x - r mu| off the chromaticity and
a = (r - 1) |mu| brighter than the mode:

    N(x) = exp(-d^2 / (2 c) - a^2 / (2 b)) / (2 pi c sqrt(2 pi b)),
    D(x) = 2 t exp(-d^2 / (2 c) - max(a, 0)^2 / (2 b)) / (2 pi c (l + sqrt(2 pi b))),

and D = 0 beyond `darkest`. So a darker pixel of the same chromaticity stays background, softly: in full shadow by s and
m alone, more surely where it is slight; and what is as bright as the background shows by its chromaticity, which
a scene keeps better than its brightness.

Why d is in grey levels. The chromatic plane is x / (B + G + R). Let a sensor's noise (reading, rounding, compression)
have the standard deviation sigma in each channel at every brightness; a chromaticity is then uncertain by about
sigma / (B + G + R), and a dark pixel's is unknown. The Mahalanobis distance of two chromaticities under that noise is
exactly d / sigma: d is small in the dark, however far apart the chromaticities, and no darkness is divided by.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import ChromaticConfig
from stseg.foreground.background import PixelModel
from stseg.foreground.chromatic_kernels import evaluate, update
from stseg.foreground.mixture import learning_rates
from stseg.foreground.temporal_mode import commonest_colours


class Chromatic(PixelModel):
    """The background of one view, and the likelihood that its pixels show people.

    State: mean float32 (v, u, K, 3) grey levels BGR, variance float32 (v, u, K, [across, along]) squared grey levels,
    weight float32 (v, u, K).
    """

    name: ClassVar[str] = "chromatic mixture"

    def __init__(self, size: tuple[int, int], frame_rate: float, config: ChromaticConfig | None = None) -> None:
        self.config = ChromaticConfig() if config is None else config
        shape = (size[1], size[0], self.config.modes)
        arrays = {
            "mean": np.zeros((*shape, 3), np.float32),
            "variance": np.full((*shape, 2), self.config.initial_sd**2, np.float32),
            "weight": np.zeros(shape, np.float32),
        }
        super().__init__(size, frame_rate, self.config, arrays)

    def _start(self, frames: NDArray[np.uint8]) -> None:
        config = self.config
        colour, spread = commonest_colours(frames, config.match_distance * config.minimum_sd)
        mean, variance, weight = self._arrays.values()
        weight[:], weight[:, :, 0] = 0, 1
        mean[:, :, 0] = colour
        variance[:, :, 0] = np.maximum(spread, config.minimum_sd**2)[:, :, None]
        certain, rate = np.ones(weight.shape[:2], np.float32), 1.0 / len(frames)
        for frame in frames:  # the two variances part; what else the frames teach is forgotten
            self._update(slice(None), frame, np.ones(3), certain, rate, rate)
        weight[:], weight[:, :, 0] = 0, 1

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
            np.float32(config.background_weight), np.float32(config.match_distance), np.float32(config.chromatic_sd),
            np.float32(config.minimum_sd), np.float32(config.initial_sd),
            *(array[rows] for array in self._arrays.values()),
        )  # fmt: skip
