"""Mean shift: the modes of a weighted lattice, each with the mean and covariance of its samples (HW12 section III-C).

Samples X_k of weight G(X_k) move, each by itself, to the weighted mean around where they are, until they stand still:

    y <- sum_k X_k G(X_k) exp(-|y - X_k|^2 / C^2) / sum_k G(X_k) exp(-|y - X_k|^2 / C^2)     (eq. 7)

Those that meet are one mode, with mean and covariance

    m = sum_k G_k X_k / sum_k G_k,      S = sum_k G_k (X_k - m) (X_k - m)^T / sum_k G_k      (eqs 8, 9)

to which the variance within a cell of the lattice is added. The paper takes C = 0.80 m.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel

_KERNEL_EXTENT = 2.5
"""Extent of the kernel, in C: there it is 0.002 of its height."""
_REST_STEP = 1e-3
"""A sample stands still once a step is shorter, in spacings of the lattice."""
_STEP_LIMIT = 200
_MODE_RADIUS = 0.25
"""Samples that come to rest so near each other are of one mode, in C."""


class Modes(NamedTuple):
    """Modes, heaviest first."""

    ground: Floats
    """float64 (n, 2): means of the samples, metres."""
    covariance: Floats
    """float64 (n, 2, 2): their covariances, square metres."""
    peak: Floats
    """float64 (n, 2): where the samples met, metres."""
    weight: Floats
    """float64 (n,): sum of the samples' weights."""

    def __len__(self) -> int:
        return len(self.ground)


def modes(weight: Floats, ground: Floats, spacing: float, kernel: float) -> Modes:
    """The modes of a lattice.

    Parameters
    ----------
    weight : float64 (y, x)
        G of each place; 0 where there is no sample.
    ground : float64 (y, x, 2)
        The places, metres, along x and y.
    spacing
        Between neighbours, metres.
    kernel
        C, metres.
    """
    found = np.empty((np.count_nonzero(weight), 2))
    mode = np.empty(len(found), np.int64)
    number = fill_modes(weight, kernel / spacing, found, mode)
    sample = np.argwhere(weight > 0)
    place, share = ground[tuple(sample.T)], weight[tuple(sample.T)]
    total = np.asarray(np.bincount(mode, share, number), float)
    mean = np.stack([np.bincount(mode, share * axis, number) for axis in place.T], -1) / total[:, None]
    off = place - mean[mode]
    spread = np.empty((number, 2, 2))
    for a in range(2):
        for b in range(2):
            spread[:, a, b] = np.bincount(mode, share * off[:, a] * off[:, b], number) / total
    spread += np.eye(2) * spacing**2 / 12
    order = np.argsort(-total, kind="stable")
    peak = ground[0, 0] + found[:number, ::-1] * spacing
    return Modes(mean[order], spread[order], peak[order], total[order])


@kernel
def fill_modes(weight: Floats, reach: float, found: Floats, mode: Ints) -> int:
    """Move every sample of a lattice (y, x) to its mode; returns how many there are.

    Parameters
    ----------
    reach
        C in spacings.
    found : float64 (sample, 2)
        The first rows are filled with the modes' places, row and column.
    mode : int64 (sample,)
        The mode of each sample, in the order of rows and columns.
    """
    rows, columns = weight.shape
    window = int(np.ceil(_KERNEL_EXTENT * reach))
    down, across = np.empty(2 * window + 2), np.empty(2 * window + 2)
    number, sample = 0, 0
    for row in range(rows):
        for column in range(columns):
            if not weight[row, column] > 0:
                continue
            y, x = float(row), float(column)
            for _ in range(_STEP_LIMIT):
                to_y, to_x = _mean_around(weight, y, x, reach, window, down, across)
                moved = np.hypot(to_y - y, to_x - x)
                y, x = to_y, to_x
                if moved < _REST_STEP:
                    break
            mode[sample] = -1
            for m in range(number):
                if np.hypot(found[m, 0] - y, found[m, 1] - x) < _MODE_RADIUS * reach:
                    mode[sample] = m
                    break
            if mode[sample] < 0:
                found[number, 0], found[number, 1], mode[sample] = y, x, number
                number += 1
            sample += 1
    return number


@kernel
def _mean_around(
    weight: Floats, y: float, x: float, reach: float, window: int, down: Floats, across: Floats
) -> tuple[float, float]:
    """The weighted mean around a place of the lattice, row and column (eq. 7)."""
    top, left = max(int(np.ceil(y - window)), 0), max(int(np.ceil(x - window)), 0)
    bottom, right = min(int(np.floor(y + window)), len(weight) - 1), min(int(np.floor(x + window)), weight.shape[1] - 1)
    for row in range(top, bottom + 1):
        down[row - top] = np.exp(-(((row - y) / reach) ** 2))
    for column in range(left, right + 1):
        across[column - left] = np.exp(-(((column - x) / reach) ** 2))
    total, sum_y, sum_x = 0.0, 0.0, 0.0
    for row in range(top, bottom + 1):
        line, line_x = 0.0, 0.0
        for column in range(left, right + 1):
            share = weight[row, column] * across[column - left]
            line += share
            line_x += share * column
        total += line * down[row - top]
        sum_y += line * down[row - top] * row
        sum_x += line_x * down[row - top]
    return sum_y / total, sum_x / total
