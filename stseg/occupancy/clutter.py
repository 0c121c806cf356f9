"""Clutter of a view and the weight that follows from it (Khan and Shah 2009, eqs 5 to 7)."""

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.kernels.accelerate import kernel


def clutter(likelihood: Singles, side: int) -> float:
    """Schmieder and Weathersby's clutter of a likelihood map (Khan and Shah 2009, eq. 5).

    C = sqrt(1/N sum_k var_k) over square cells of `side` pixels, partial cells at the border included.

    Parameters
    ----------
    likelihood : float32 (v, u)
        The map.
    side
        Side of a cell, pixels; about twice the largest target's height, at most a quarter of the image.
    """
    height, width = likelihood.shape
    cells = np.empty((-(-height // side), -(-width // side)))
    _fill_variances(likelihood, side, cells)
    return float(np.sqrt(cells.mean()))


def clutter_side(size: tuple[int, int], minimum: int = 8) -> int:
    """Side of a cell for images of a size, pixels: a quarter of the shorter side. People near the camera
    are taller than half of that, so eq. 5's cell of twice a target's height would exceed its own upper limit."""
    return max(min(size) // 4, minimum)


@kernel
def _fill_variances(likelihood: Singles, side: int, variance: Floats) -> None:
    """Fill variance (cell row, cell column); sums are kept column by column, so that a row is added at once."""
    height, width = likelihood.shape
    sums, squares = np.empty(width), np.empty(width)
    for j in range(variance.shape[0]):
        sums[:], squares[:] = 0.0, 0.0
        bottom = min((j + 1) * side, height)
        for v in range(j * side, bottom):
            for u in range(width):
                value = np.float64(likelihood[v, u])
                sums[u] += value
                squares[u] += value * value
        for i in range(variance.shape[1]):
            right = min((i + 1) * side, width)
            count = (right - i * side) * (bottom - j * side)
            mean = sums[i * side : right].sum() / count
            variance[j, i] = max(squares[i * side : right].sum() / count - mean * mean, 0.0)


def clutter_weights(clutters: Floats) -> Floats:
    """Weights 1 / C_i of the views, before they are normalised over those that see a cell (Khan and Shah 2009, eq. 7).

    C is floored at the median over the views, so that an empty map does not outweigh the others.

    Parameters
    ----------
    clutters : float64 (view,)
        C of each view; nan for a blind view, which gets weight 0.

    Returns
    -------
    float64 (view,)
        Scaled to a mean of 1 over the views that are not blind.
    """
    weights = np.zeros(len(clutters))
    sighted = ~np.isnan(clutters)
    if sighted.any():
        floor = max(float(np.median(clutters[sighted])), 1e-6)
        weights[sighted] = 1.0 / np.maximum(clutters[sighted], floor)
        weights /= weights[sighted].mean()
    return weights
