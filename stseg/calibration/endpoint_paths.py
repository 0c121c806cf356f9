"""Paths of people through one view: ends of frame after frame that nobody else could be."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints
from stseg.calibration.endpoints import Ends

_STEP = 0.25
"""How far foot and head may move between two frames, in lengths of the person, and again for each second between."""
_GAP = 0.35
"""Seconds that a path may be without ends."""


def path_of(ends: Ends, frame_rate: float) -> Ints:
    """Number of the path that each row belongs to, int64 (n,).

    A path goes on with the nearest ends in reach where there is no second choice on either side.
    """
    path = np.full(len(ends), -1, np.int64)
    places = np.stack([ends.foot, ends.head], 1)
    length = ends.length
    open_rows: list[int] = []
    started = 0
    for frame in np.unique(ends.frame):
        now = np.flatnonzero(ends.frame == frame)
        open_rows = [row for row in open_rows if frame - ends.frame[row] <= max(1.0, _GAP * frame_rate)]
        before = np.array(open_rows, np.int64)
        seconds = (frame - ends.frame[before]) / frame_rate
        away = np.abs(places[before][:, None] - places[now][None]).max(axis=(2, 3))
        near = away <= (_STEP * (1 + seconds) * length[before])[:, None]
        for k, row in enumerate(now):
            (mine,) = np.nonzero(near[:, k])
            if len(mine) == 1 and near[mine[0]].sum() == 1:
                path[row] = path[before[mine[0]]]
                open_rows.remove(int(before[mine[0]]))
            else:
                path[row] = started
                started += 1
            open_rows.append(int(row))
    return path
