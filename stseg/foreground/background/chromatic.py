"""Gaussian mixture in the chromatic plane, robust to shadow and flickering light (Huang and Wang 2012).

The mixture of `mixture`, with the same symbols, the same posterior and the same selective learning,
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

from stseg.config import ChromaticConfig
from stseg.foreground.background.gaussian_model import GaussianModel


class Chromatic(GaussianModel):
    """Chromatic Gaussian mixture of one view."""

    name: ClassVar[str] = "chromatic mixture"
    variances: ClassVar[int] = 2

    def __init__(self, size: tuple[int, int], frame_rate: float, config: ChromaticConfig | None = None) -> None:
        self._least = (ChromaticConfig() if config is None else config).chromatic_sd
        super().__init__(size, frame_rate, ChromaticConfig() if config is None else config)

    def _least_sds(self) -> tuple[float, float]:
        return self._least, self.config.minimum_sd
