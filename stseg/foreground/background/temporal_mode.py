"""Temporal mode: the colour that a pixel shows most often, which is the background among walking people.

A median needs the background in more than half of the frames, which a crowded scene does not offer. People wear many
colours and the background has one, so the colour with the most similar ones finds it wherever it is the commonest.
"""

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Singles
from stseg.kernels.accelerate import kernel


def commonest_colours(frames: NDArray[np.uint8], reach: float) -> tuple[Singles, Singles]:
    """Mean and variance of each pixel's commonest colour.

    Parameters
    ----------
    frames : uint8 (n, v, u, 3)
        n of 1 or more.
    reach
        Grey levels, Euclidean, within which two colours are companions.

    Returns
    -------
    float32 (v, u, 3), float32 (v, u)
        Mean, and variance per channel, of the companions of the colour that has most of them (the first of equals; the
        first that has more than half of the frames is enough).
    """
    mean = np.empty(frames.shape[1:], np.float32)
    variance = np.empty(frames.shape[1:3], np.float32)
    _gather(frames, reach * reach, np.empty(len(frames), np.bool_), mean, variance)
    return mean, variance


@kernel
def _gather(
    frames: NDArray[np.uint8], reach_squared: float, companion: NDArray[np.bool_], mean: Singles, variance: Singles
) -> None:
    count = len(frames)
    for v in range(frames.shape[1]):
        for u in range(frames.shape[2]):
            best, most = 0, 0
            for i in range(count):
                companions = _mark_companions(frames[:, v, u], i, reach_squared, companion)
                if companions > most:
                    best, most = i, companions
                if 2 * most > count:
                    break
            _mark_companions(frames[:, v, u], best, reach_squared, companion)
            spread = 0.0
            for c in range(3):
                total, squares = 0.0, 0.0
                for j in range(count):
                    if companion[j]:
                        total += float(frames[j, v, u, c])
                        squares += float(frames[j, v, u, c]) ** 2
                mean[v, u, c] = total / most
                spread += squares / most - (total / most) ** 2
            variance[v, u] = max(spread, 0.0) / 3.0


@kernel
def _mark_companions(colours: NDArray[np.uint8], of: int, reach_squared: float, companion: NDArray[np.bool_]) -> int:
    """Mark which colours (n, 3) lie within reach of colour `of`, and count them."""
    count = 0
    for j in range(len(colours)):
        d0 = float(colours[j, 0]) - float(colours[of, 0])
        d1 = float(colours[j, 1]) - float(colours[of, 1])
        d2 = float(colours[j, 2]) - float(colours[of, 2])
        companion[j] = d0 * d0 + d1 * d1 + d2 * d2 <= reach_squared
        count += companion[j]
    return count
