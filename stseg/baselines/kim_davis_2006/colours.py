"""Colours robust to illumination, and their density in samples of a body part (Kim and Davis 2006, eqs 1, 6).

    r = R / (R + G + B),   g = G / (R + G + B),   s = (R + G + B) / 3
    p_M(c) = 1 / N_M  sum_i  prod_j  exp(-(c_j - c_ij)^2 / sigma_j^2)      (Kim and Davis 2006, equation 1)

Each channel is kept in a byte. Densities are relative to the uniform distribution of colours, so 1 is uninformative;
a share of outliers (badges, noise, the ground between the legs) bounds the effect of one pixel.
"""

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Singles
from stseg.kernels.accelerate import kernel

CHROMA_FIRST, CHROMA_SPAN = 0.13, 0.41
"""Range of r and g of clothes within 0..1; values beyond are clipped."""
SPREAD = np.array([0.02, 0.02, 30.0])
"""sigma of r, g and s: wide for the lightness, as in the paper, since it changes with the illumination."""
BINS = (10, 10, 5)
"""Bins of the histograms of eq. 6, along r, g and s."""
_OUTLIERS = 0.05
"""Share of outliers among a body part's pixels."""


def normalised(image: Bytes) -> Bytes:
    """r, g and s of an image.

    Parameters
    ----------
    image : uint8 (v, u, 3)
        BGR.

    Returns
    -------
    uint8 (v, u, 3)
        r and g in bytes over the range CHROMA_FIRST .. CHROMA_FIRST + CHROMA_SPAN, s in grey levels.
    """
    total = np.maximum(image.sum(2, dtype=np.float32), 1.0)[:, :, None]
    chroma = (image[:, :, 2:0:-1] / total - CHROMA_FIRST) * (255 / CHROMA_SPAN)
    return np.asarray(np.rint(np.concatenate([chroma, total / 3], 2)).clip(0, 255), np.uint8)


def bins_of(colour: Bytes) -> Ints:
    """The histogram bin of each colour, uint8 (..., 3); int64 (...)."""
    r, g, s = (colour[..., k].astype(np.int64) * bins // 256 for k, bins in enumerate(BINS))
    return np.asarray((r * BINS[1] + g) * BINS[2] + s, np.int64)


def _fall() -> Singles:
    """Kernel of each channel by the distance in bytes, relative to the uniform density, float32 (3, 256)."""
    span = np.array([CHROMA_SPAN, CHROMA_SPAN, 255.0])[:, None]
    distance = np.arange(256) / 255 * span
    peak = span / (np.sqrt(np.pi) * SPREAD[:, None])
    return np.asarray(peak * np.exp(-((distance / SPREAD[:, None]) ** 2)), np.float32)


FALL = _fall()


@kernel
def fill_density(
    colour: Bytes, wanted: Bytes, box: Ints, samples: Bytes, counts: Ints, fall: Singles, density: Singles
) -> None:
    """Eq. 1 for one person in one view.

    Parameters
    ----------
    colour : uint8 (v, u, 3)
        Of each pixel.
    wanted : uint8 (v, u)
        Not 0 for pixels whose density is wanted.
    box : int64 (4,)
        First and last row (exclusive), first and last column (exclusive).
    samples : uint8 (part, n, 3), counts : int64 (part,)
        Colours of the person's parts, and the number of valid ones of each; a part with none has density 1.
    fall
        FALL.
    density : float32 (part, v, u)
        Filled within the box where wanted.
    """
    for part in range(len(counts)):
        n = counts[part]
        for v in range(box[0], box[1]):
            for u in range(box[2], box[3]):
                if not wanted[v, u]:
                    continue
                if n == 0:
                    density[part, v, u] = 1.0
                    continue
                # Signed: a difference of bytes wraps around.
                r, g, s = np.int64(colour[v, u, 0]), np.int64(colour[v, u, 1]), np.int64(colour[v, u, 2])
                total = 0.0
                for i in range(n):
                    total += (
                        fall[0, abs(r - np.int64(samples[part, i, 0]))]
                        * fall[1, abs(g - np.int64(samples[part, i, 1]))]
                        * fall[2, abs(s - np.int64(samples[part, i, 2]))]
                    )
                density[part, v, u] = (1.0 - _OUTLIERS) * total / n + _OUTLIERS


def histogram(colour: Bytes) -> Floats:
    """Eq. 6 of colours uint8 (n, 3): their share in each bin, float64 (bin,); zeros where there are none."""
    counts = np.bincount(bins_of(colour), minlength=int(np.prod(BINS))).astype(float)
    return np.asarray(counts / max(counts.sum(), 1.0))
