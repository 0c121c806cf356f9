"""Labels of occupied cells without a cut: the nearest track within reach."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.trackers.protocol import FusedFrame


def reached_cells(fused: FusedFrame, ground: Floats, ids: Ints, grid: Grid, reach: float) -> tuple[Labels, Floats]:
    """Label the occupied cells of a frame with the nearest track within reach.

    Parameters
    ----------
    ground : float64 (n, 2)
        Places of the tracks, metres.
    ids : int64 (n,)
        Track numbers.
    reach
        Metres.

    Returns
    -------
    int32 (plane, y, x), float64 (n,)
        Track ids of the cells, 0 for background; ground area of each track, square metres.
    """
    near = nearest_person(grid.ground, ground, reach)
    occupied = (fused.log_odds > 0) & (near >= 0)
    label = np.where(occupied, np.append(ids, 0)[near], 0).astype(np.int32)
    cells = np.bincount(near[occupied.any(0)], minlength=len(ids))[: len(ids)]
    return label, np.asarray(cells * grid.cell**2, float)
