"""People on open ground as TRAJECTORY rows: two who meet, one who is lost for a while, any few who walk about."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from hypothesis import strategies as st
from strategies import numbers

from stseg.arrays import Rows
from stseg.config import Config
from stseg.geometry import Grid
from stseg.records.border import Border
from stseg.records.tables import TRAJECTORY

RATE = 8.0
CONFIG = Config()
GRID = Grid((-6.0, 6.0), (-6.0, 6.0), cell=0.25, planes=2)
Path = Callable[[float], tuple[float, float]]
"""Where somebody is at a time in seconds, metres."""


def open_area() -> Border:
    """People come and go at the edges of the grid."""
    edge = np.minimum(GRID.ground_x + 6, 6 - GRID.ground_x)
    return Border(np.minimum(edge[None], np.minimum(GRID.ground_y + 6, 6 - GRID.ground_y)[:, None]), GRID)


BORDER = open_area()


def rows_of(people: Mapping[int, tuple[Path, float, range]], noise: float = 0.02) -> Rows:
    """TRAJECTORY rows of people who walk paths, so tall, in these frames; sorted by frame, then id."""
    rng = np.random.default_rng(3)
    told = sorted(
        (frame, track, path(frame / RATE), tall) for track, (path, tall, frames) in people.items() for frame in frames
    )
    rows = np.zeros(len(told), TRAJECTORY)
    for row, (frame, track, place, tall) in zip(rows, told, strict=True):
        row["frame"], row["id"], row["height"] = frame, track, tall + rng.normal(0, CONFIG.tracking.height_noise)
        row["x"], row["y"] = np.array(place) + rng.normal(0, noise, 2)
    return rows


def visit(side: float) -> Path:
    """Someone comes from one side to the middle, stands there from 9 s to 11 s, nearest at 10 s, and goes back."""
    return lambda t: (side * (0.1 + 0.02 * abs(t - 10) + 0.5 * max(abs(t - 10) - 1, 0)), 0.0)


def swapped(rows: Rows, frame: int) -> Rows:
    """Tracks 1 and 2 change places from a frame on."""
    other = rows.copy()
    late = rows["frame"] >= frame
    other["id"][late] = 3 - rows["id"][late]
    return other


def gone(seconds: float, tall: float = 1.7, path: Path = lambda t: (-3 + 0.7 * t, 0.5)) -> Rows:
    """Track 1 is lost at 3 s; track 2 begins some seconds later, further along the path."""
    begin = 24 + round(seconds * RATE)
    return rows_of({1: (path, 1.7, range(24)), 2: (path, tall, range(begin, begin + 24))})


def straight(x: float, y: float, vx: float, vy: float) -> Path:
    """Constant velocity, metres per second."""
    return lambda t: (x + vx * t, y + vy * t)


@st.composite
def runs(draw: st.DrawFn, most: int) -> Rows:
    """A few people in a small place, each seen from time to time; ids that say nothing."""
    people: dict[int, tuple[Path, float, range]] = {}
    for track in draw(st.lists(st.integers(1, 9), unique=True, max_size=most)):
        x, y, vx, vy = (draw(numbers(-w, w)) for w in (2, 2, 0.5, 0.5))
        first, length = draw(st.integers(0, 25)), draw(st.integers(1, 20))
        tall = draw(st.sampled_from((1.6, 1.7, 1.8)))
        people[track] = straight(x, y, vx, vy), tall, range(first, first + length)
    rows = rows_of(people)
    unseen = draw(st.sets(st.integers(0, len(rows) - 1), max_size=2)) if len(rows) else set[int]()
    return np.delete(rows, sorted(unseen))
