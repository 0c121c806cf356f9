"""Global illumination gain: one factor per channel and frame.

A lamp, a cloud or the camera's exposure multiplies all pixels of a view. The ratio of image to background is then the
same wherever the background shows, and scatters where people are. So the gain is the peak of the histogram of ratios;
this holds even where people cover more than half of the view.
"""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Bytes, Floats, Ints, Singles

_STRIDE = 4  # pixels; a sixteenth of them are ample for one number
_BIN = 0.01  # of the natural logarithm of the ratio
_BINS = 221  # ratios from a third to three
_REACH = 2  # bins on each side of the peak that belong to it
_DARKEST, _BRIGHTEST = 24.0, 250.0  # grey levels: below, rounding spoils the ratio; above, the sensor is saturated
_ENOUGH = 0.02  # share of the sampled pixels that the peak must hold to be accepted
_FEWEST = 16  # and no fewer than this many


def channel_gains(image: Bytes, mean: Singles, weight: Singles) -> Floats:
    """Gain of the image over the background, channel by channel.

    Parameters
    ----------
    image : uint8 (v, u, 3)
    mean : float32 (v, u, K, 3)
        Grey levels of the background's modes in the light that they were learned in.
    weight : float32 (v, u, K)
        Weights of the modes; the strongest mode of each pixel is used.

    Returns
    -------
    float64 (3,)
        Factors within 1/3..3 that turn the means into the image's light; 1 where too few pixels agree on one.
    """
    counts = np.zeros((3, _BINS), np.int64)
    _count_ratios(image, mean, weight, counts)
    asked = math.ceil(image.shape[0] / _STRIDE) * math.ceil(image.shape[1] / _STRIDE)
    return np.array([_peak(channel, _ENOUGH * asked) for channel in counts])


@kernel
def _count_ratios(image: Bytes, mean: Singles, weight: Singles, counts: Ints) -> None:
    middle = _BINS // 2
    for v in range(0, image.shape[0], _STRIDE):
        for u in range(0, image.shape[1], _STRIDE):
            strongest = weight[v, u].argmax()
            for c in range(3):
                seen, expected = float(image[v, u, c]), float(mean[v, u, strongest, c])
                if min(seen, expected) < _DARKEST or max(seen, expected) > _BRIGHTEST:
                    continue
                place = middle + round(math.log(seen / expected) / _BIN)
                if 0 <= place < _BINS:
                    counts[c, place] += 1


def _peak(counts: Ints, enough: float) -> float:
    """The gain at the histogram's peak: the centroid of the bins around it."""
    window = np.convolve(counts, np.ones(2 * _REACH + 1, np.int64), "same")
    highest = int(window.argmax())
    if window[highest] < max(enough, _FEWEST):
        return 1.0
    bins = np.arange(max(0, highest - _REACH), min(_BINS, highest + _REACH + 1))
    centroid = float((counts[bins] * bins).sum() / counts[bins].sum())
    return math.exp((centroid - _BINS // 2) * _BIN)
