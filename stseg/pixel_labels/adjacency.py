"""Potts weights of neighbouring pixels by colour contrast (Huang and Wang 2012, eqs 16 to 18).

    w = c2 max(g(d), 0),     g(d) = tanh((k1 - d) / (2 k2)),

with d the distance of the two colours. The paper's g is negative beyond k1, which makes the energy non-submodular; here
it ends at zero, so colours farther apart than k1 have no weight. g = 2 P(same person | d) - 1 for log-odds linear in d,
from which k1 and k2 were learned.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stseg.arrays import Bytes, Floats, Labels
from stseg.config import LabelConfig
from stseg.graphcut.grid_energy import QUANTUM
from stseg.kernels.accelerate import kernel

_FARTHEST = 3 * 255**2


def adjacency(difference: Floats, config: LabelConfig) -> Floats:
    """Weights in nats at colour distances in grey levels, float64 of the same shape."""
    return config.boundary_weight * np.tanh((config.contrast_limit - difference) / (2 * config.contrast_slope)).clip(0)


def edge_costs(image: Bytes | None, shape: tuple[int, int], config: LabelConfig) -> tuple[Labels, Labels]:
    """Weights between each pixel and the next in its row, and between it and the one below.

    Parameters
    ----------
    image : uint8 (v, u, 3)
        None without colours: all pairs then have the mean weight at borders.
    shape
        Image size (v, u).

    Returns
    -------
    int32 (v, u), int32 (v, u)
        Quanta; 0 without a neighbour.
    """
    across, down = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    if image is None:
        across[:, :-1] = down[:-1] = round(config.boundary_weight * config.colourless_factor / QUANTUM)
    else:
        _fill_edge_costs(image, _table(config), across, down)
    return across, down


@lru_cache(maxsize=8)
def _table(config: LabelConfig) -> Labels:
    """Weights by squared distance, quanta."""
    costs = adjacency(np.sqrt(np.arange(_FARTHEST + 1)), config)
    return np.asarray(np.rint(costs / QUANTUM), np.int32)


@kernel
def _fill_edge_costs(image: Bytes, table: Labels, across: Labels, down: Labels) -> None:
    rows, columns, _ = image.shape
    for v in range(rows):
        for u in range(columns):
            if u + 1 < columns:
                across[v, u] = table[_square(image, v, u, v, u + 1)]
            if v + 1 < rows:
                down[v, u] = table[_square(image, v, u, v + 1, u)]


@kernel
def _square(image: Bytes, v: int, u: int, other_v: int, other_u: int) -> int:
    total = 0
    for channel in range(3):
        off = int(image[v, u, channel]) - int(image[other_v, other_u, channel])
        total += off * off
    return total
