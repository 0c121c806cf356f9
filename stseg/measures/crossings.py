"""Crossings of lines by tracks, by direction."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.measures.areas import Line
from stseg.measures.zones import by_track, stays

CROSSING = np.dtype(
    [("line", "O"), ("frame", "<i8"), ("time", "<f8"), ("id", "<i8"), ("to", "O"), ("x", "<f8"), ("y", "<f8"),
     ("speed", "<f8")]
)  # fmt: skip
"""One row per crossing: seconds, the side that is reached as seen along the line, place in metres, metres a second."""


def line_crossings(line: Line, trajectory: Rows, frame_rate: float, band: float) -> Rows:
    """Crossings of a line, CROSSING (n,), by time.

    A crossing and the next one back count only where the track goes farther than `band` metres from the line between
    them: a person who stands on it does not cross it again and again.
    """
    found = []
    for stay in (stay for track in by_track(trajectory) for stay in stays(track, frame_rate)):
        ground = np.stack([stay["x"], stay["y"]], -1)
        kept: list[tuple[int, float, int]] = []
        for row, share, side in _intersections(line, ground):
            if kept and kept[-1][2] != side and not _far(line, ground[kept[-1][0] + 1 : row + 1], band):
                kept.pop()
            else:
                kept.append((row, share, side))
        for row, share, side in kept:
            step = stay["frame"][row + 1] - stay["frame"][row]
            frame = stay["frame"][row] + share * step
            x, y = ground[row] + share * (ground[row + 1] - ground[row])
            speed = float(np.hypot(*(ground[row + 1] - ground[row]))) * frame_rate / step
            reached = "left" if side > 0 else "right"
            place = (round(float(x), 4), round(float(y), 4), round(speed, 4))
            found.append((line.name, int(np.ceil(frame)), frame / frame_rate, int(stay["id"][0]), reached, *place))
    return np.sort(np.array(found, CROSSING), order=["time", "id"])


def _far(line: Line, ground: Floats, band: float) -> bool:
    return bool(len(ground) and line.distance(ground).max() > band)


def _intersections(line: Line, ground: Floats) -> list[tuple[int, float, int]]:
    """Steps that intersect the line: row before, share of the step, and side reached (1 left, -1 right)."""
    start, way = line.points[:-1], np.diff(line.points, axis=0)
    step = np.diff(ground, axis=0)
    cross = step[:, None, 0] * way[None, :, 1] - step[:, None, 1] * way[None, :, 0]
    to = start[None] - ground[:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (to[..., 0] * way[None, :, 1] - to[..., 1] * way[None, :, 0]) / cross
        along = (to[..., 0] * step[:, None, 1] - to[..., 1] * step[:, None, 0]) / cross
    hit = (cross != 0) & (share >= 0) & (share < 1) & (along >= 0) & (along <= 1)
    rows, segments = np.nonzero(hit)
    order = np.lexsort((share[rows, segments], rows))
    return [
        (int(rows[k]), float(share[rows[k], segments[k]]), -1 if cross[rows[k], segments[k]] > 0 else 1) for k in order
    ]
