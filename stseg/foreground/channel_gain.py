"""Global illumination gain: one factor per channel and frame.

A lamp, a cloud or the camera's exposure multiplies all pixels of a view. The ratio of image to background is then the
same wherever the background shows, and scatters where people are. So the gain is the peak of the histogram of ratios;
this holds even where people cover more than half of the view.
"""

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Ints, Singles
from stseg.kernels.accelerate import kernel

STRIDE = 4
"""Pixels from one sample to the next along u and v; a sixteenth of all pixels is ample for one number."""
_BIN = 0.01  # of the natural logarithm of the ratio
_BINS = 221  # ratios from a third to three
_PEAK_RADIUS = 2  # bins on each side of the peak that belong to it
_DARKEST, _BRIGHTEST = 24.0, 250.0  # grey levels: below, rounding spoils the ratio; above, the sensor is saturated
_LEAST_SHARE = 0.02  # share of the samples that the peak must hold to be accepted
_LEAST_SAMPLES = 16  # and no fewer than this many
_LOG_STEPS = 16  # steps of a grey level in the table of logarithms: errors of 0.13 % at most, against bins of 1 %
_LOG = np.log(np.maximum(np.arange(256 * _LOG_STEPS), 1) / _LOG_STEPS)


def channel_gains(image: Bytes, background: Singles) -> Floats:
    """Gain of an image over the background, channel by channel.

    Parameters
    ----------
    image : uint8 (v, u, 3)
        Samples of an image.
    background : float32 (v, u, 3)
        The same samples of the background, grey levels in the light that it was learned in.

    Returns
    -------
    float64 (3,)
        Factors within 1/3..3 that turn the background into the image's light; 1 where too few pixels agree on one.
    """
    counts, gains = np.zeros((3, _BINS), np.int64), np.empty(3)
    _count_ratios(image, background, _LOG, counts)
    fill_gains(counts, max(_LEAST_SHARE * image.shape[0] * image.shape[1], _LEAST_SAMPLES), gains)
    return gains


def to_common_light(frames: NDArray[np.uint8]) -> None:
    """Divide frames, uint8 (n, v, u, 3) BGR, in place by their gains over the temporal median of each pixel.

    The median of a light is the same for all pixels that show background in most frames: people do not spoil it.
    """
    samples = frames[:, ::STRIDE, ::STRIDE]
    median = np.median(samples, 0).astype(np.float32)
    for frame, sample in zip(frames, samples, strict=True):
        for channel, gain in enumerate(channel_gains(np.ascontiguousarray(sample), median)):
            levels = np.rint(np.arange(256) / gain).clip(0, 255).astype(np.uint8)
            frame[..., channel] = levels.take(frame[..., channel], mode="clip")


@kernel
def _count_ratios(image: Bytes, background: Singles, logarithm: Floats, counts: Ints) -> None:
    """Fill the histograms counts (3, bin) of the logarithm of image over background."""
    middle, bins = counts.shape[1] // 2, 1.0 / _BIN
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            for c in range(3):
                observed, expected = float(image[v, u, c]), float(background[v, u, c])
                if min(observed, expected) < _DARKEST or max(observed, expected) > _BRIGHTEST:
                    continue
                ratio = logarithm[_LOG_STEPS * int(observed)] - logarithm[int(_LOG_STEPS * expected + 0.5)]
                place = middle + int(np.rint(ratio * bins))
                if 0 <= place < counts.shape[1]:
                    counts[c, place] += 1


@kernel
def fill_gains(counts: Ints, enough: float, gains: Floats) -> None:
    """Fill gains (3,): the centroid of the bins around the peak of each histogram, counts (3, bin)."""
    bins = counts.shape[1]
    for c in range(3):
        most, total, in_window, weighted = 0, 0, 0, 0
        for last in range(bins + _PEAK_RADIUS):  # the last of the bins around a middle, which are moved by one
            if last < bins:
                in_window += counts[c, last]
                weighted += counts[c, last] * (last - bins // 2)
            before = last - 2 * _PEAK_RADIUS - 1
            if before >= 0:
                in_window -= counts[c, before]
                weighted -= counts[c, before] * (before - bins // 2)
            if last >= _PEAK_RADIUS and in_window > most:
                most, total = in_window, weighted
        gains[c] = np.exp(float(total) / most * _BIN) if most >= enough else 1.0
