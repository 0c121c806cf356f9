"""How cluttered a view is, and what weight that leaves it (KS09 eqs 5 to 7; METHODS 3)."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Singles


def clutter(likelihood: Singles, side: int) -> float:
    """Schmieder and Weathersby's clutter of a likelihood map (KS09 eq. 5).

    C = sqrt(1/N sum_k var_k) over square cells of `side` pixels, partial cells at the border included.

    Parameters
    ----------
    likelihood : float32 (v, u)
        The map.
    side
        Side of a cell, pixels; about twice the largest target's height, at most a quarter of the image.
    """
    height, width = likelihood.shape
    rows, columns = np.arange(0, height, side), np.arange(0, width, side)

    def cell_means(values: Floats) -> Floats:
        sums = np.add.reduceat(np.add.reduceat(values, rows, 0), columns, 1)
        counts = np.outer(np.diff(np.append(rows, height)), np.diff(np.append(columns, width)))
        return np.asarray(sums / counts)

    values = likelihood.astype(float)
    variance = cell_means(values**2) - cell_means(values) ** 2
    return float(np.sqrt(variance.clip(0).mean()))


def clutter_weights(clutters: Floats) -> Floats:
    """Weights 1 / C_i of the views, before they are normalised over those that see a cell (KS09 eq. 7).

    C is floored at the median over the views, so that a view that sees nothing does not silence the others.

    Parameters
    ----------
    clutters : float64 (view,)
        C of each view; nan for a blind one, whose weight is then 0.

    Returns
    -------
    float64 (view,)
        Scaled to a mean of 1 over the views that are not blind.
    """
    weights = np.zeros(len(clutters))
    awake = ~np.isnan(clutters)
    if awake.any():
        floor = max(float(np.median(clutters[awake])), 1e-6)
        weights[awake] = 1.0 / np.maximum(clutters[awake], floor)
        weights /= weights[awake].mean()
    return weights
