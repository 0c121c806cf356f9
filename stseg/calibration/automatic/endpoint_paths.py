"""Image tracks of isolated people: endpoints linked from frame to frame where only one link is possible."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints
from stseg.calibration.automatic.endpoints import Endpoints

_LINK_GATE = 0.25
"""Gate of a link: movement of foot and head in body lengths, plus as much for each second between."""
_PATH_GAP = 0.35
"""Longest gap within a path, seconds."""


def path_of(endpoints: Endpoints, frame_rate: float) -> Ints:
    """Path number of each row, int64 (n,).

    A path continues where the gate holds exactly one candidate on either side.
    """
    path = np.full(len(endpoints), -1, np.int64)
    places = np.stack([endpoints.foot, endpoints.head], 1)
    length = endpoints.length
    open_rows: list[int] = []
    started = 0
    for frame in np.unique(endpoints.frame):
        now = np.flatnonzero(endpoints.frame == frame)
        open_rows = [row for row in open_rows if frame - endpoints.frame[row] <= max(1.0, _PATH_GAP * frame_rate)]
        before = np.array(open_rows, np.int64)
        seconds = (frame - endpoints.frame[before]) / frame_rate
        away = np.abs(places[before][:, None] - places[now][None]).max(axis=(2, 3))
        in_gate = away <= (_LINK_GATE * (1 + seconds) * length[before])[:, None]
        for k, row in enumerate(now):
            (predecessors,) = np.nonzero(in_gate[:, k])
            if len(predecessors) == 1 and in_gate[predecessors[0]].sum() == 1:
                path[row] = path[before[predecessors[0]]]
                open_rows.remove(int(before[predecessors[0]]))
            else:
                path[row] = started
                started += 1
            open_rows.append(int(row))
    return path
