"""The border over which people enter and leave."""

from __future__ import annotations

import numpy as np
from scenes import room

from stseg.records.border import Border


def test_points_have_the_distance_of_their_cell() -> None:
    border = Border.of(room())
    grid, (rows, columns) = border.grid, border.distance.shape
    ground = grid.ground.reshape(-1, 2) + np.random.default_rng(0).uniform(-0.49, 0.49, (rows * columns, 2)) * grid.cell
    np.testing.assert_array_equal(border.away(ground), border.distance.reshape(-1))
    (left, right), (low, high) = grid.x, grid.y
    out = np.array([[left - 0.01, 0], [right + 0.01, 0], [0, low - 0.01], [0, high + 0.01], [-1e30, 1e30]])
    np.testing.assert_array_equal(border.away(out), 0.0)
    assert border.distance.max() > 1.0
