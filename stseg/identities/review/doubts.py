"""Decisions of a run in the order of doubt: encounters, gaps, births and deaths inside the area."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Rows, by_track, columns, some_columns
from stseg.records.border import Border
from stseg.records.track_heights import median_measured
from stseg.tracking.row_groups import EXCHANGE_DISTANCE

_COMPARED_TIME = 2.0
"""Time before and after an encounter in which heights are compared, seconds."""
_HEIGHT_ERROR = 0.05
"""Standard deviation of a track's median height, metres."""
_SPEED_ERROR = 0.6
"""Standard deviation of a velocity, metres a second."""
_ACCELERATION = 1.0
"""Standard deviation of the acceleration over a gap, metres a second squared."""
_PLACE_ERROR = 0.3
"""Standard deviation of positions extrapolated over a moment, metres."""
_LONGEST_GAP = 10.0
"""Longest absence that may be one person's, seconds."""
_BORDER_WIDTH = 0.5
"""Distance from the border of the area within which tracks may begin and end, metres."""
_MARGIN_LIMIT = 12.0
"""Greatest doubt-free margin, nats: larger margins count as equal."""
_COMPARED = columns("frame:<i8 id:<i8 x:<f8 y:<f8 height:<f4 score:<f4")
"""Columns of TRAJECTORY that decide: the others of a day take a GB more."""


@dataclass(frozen=True)
class Doubt:
    """A decision that may be wrong."""

    question: str
    """"encounter": were two tracks swapped; "gap": does one track continue another; "birth": does a track that begins
    beside another continue the person of that one; "false": is a track a person."""
    track: int
    """Id; 0 for none."""
    other: int
    """Id; 0 for none."""
    first: int
    """First frame of the decision."""
    last: int
    """Last frame of the decision."""
    margin: float
    """Evidence for the decision against its alternative, nats; small is doubtful."""

    @property
    def frame(self) -> int:
        """The frame in which it is decided: the middle one."""
        return (self.first + self.last + 1) // 2

    @property
    def chance(self) -> float:
        """Probability that it is wrong."""
        return float(expit(-self.margin))


def find_doubts(trajectory: Rows, frame_rate: float, border: Border) -> list[Doubt]:
    """Doubtful decisions of a run, the most doubtful first; `frame_rate` is in frames per second."""
    found = [*identity_doubts(trajectory, frame_rate), *_weak(_by_track(trajectory), frame_rate, border)]
    return sorted(found, key=lambda one: (one.margin, one.first, one.track))


def identity_doubts(trajectory: Rows, frame_rate: float) -> list[Doubt]:
    """Encounters, births and gaps of TRAJECTORY (n,), at frames per second: all but the question of existence."""
    rows = _by_track(trajectory)
    if not rows:
        return []
    met = _encounters(rows, frame_rate)
    births = _births(rows, frame_rate, {(one.other, one.track, one.first) for one in met})
    return [*met, *births, *_gaps(rows, frame_rate)]


def _by_track(trajectory: Rows) -> dict[int, Rows]:
    """Rows of each track in the order of time, by rising id: what is compared of them."""
    return {int(part["id"][0]): part for part in by_track(some_columns(trajectory, _COMPARED))}


def _encounters(rows: dict[int, Rows], frame_rate: float) -> list[Doubt]:
    """Times in which two tracks were near each other."""
    found = []
    for a, b in _together(rows):
        common, in_a, in_b = np.intersect1d(rows[a]["frame"], rows[b]["frame"], return_indices=True)
        if not len(common):
            continue
        offset: list[Floats] = [rows[a][axis][in_a] - rows[b][axis][in_b] for axis in ("x", "y")]
        distance = np.hypot(*offset)
        encounter = common[distance < EXCHANGE_DISTANCE]
        for part in np.split(encounter, np.flatnonzero(np.diff(encounter) > frame_rate) + 1):
            if len(part):
                first, last = int(part[0]), int(part[-1])
                margin = _swap_margin(rows[a], rows[b], first, last, frame_rate)
                found.append(Doubt("encounter", a, b, first, last, margin))
    return found


def _together(rows: dict[int, Rows]) -> Iterator[tuple[int, int]]:
    """Pairs of tracks of which neither ends before the other begins, in the order of their ids."""
    ids = sorted(rows)
    first, last = np.array([rows[one]["frame"][[0, -1]] for one in ids]).T
    for k, one in enumerate(ids):
        for later in np.flatnonzero((first[k + 1 :] <= last[k]) & (last[k + 1 :] >= first[k])).tolist():
            yield one, ids[k + 1 + later]


def _between(of_track: Rows, first: float, last: float) -> Rows:
    """Rows of a track from one frame to another, both included."""
    return of_track[np.searchsorted(of_track["frame"], first) : np.searchsorted(of_track["frame"], last, "right")]


def _swap_margin(a: Rows, b: Rows, first: int, last: int, frame_rate: float) -> float:
    """Log-odds of the identities as they are against swapped ones: heights, and motion over short encounters."""
    length = round(_COMPARED_TIME * frame_rate)
    parts = [(_between(one, first - length, first), _between(one, last, last + length)) for one in (a, b)]
    (a0, a1), (b0, b1) = parts
    height = _height(a0, b1) + _height(b0, a1) - _height(a0, a1) - _height(b0, b1)
    motion = _motion(a0, b1, frame_rate) + _motion(b0, a1, frame_rate)
    motion -= _motion(a0, a1, frame_rate) + _motion(b0, b1, frame_rate)
    return float(np.clip(height + motion, -_MARGIN_LIMIT, _MARGIN_LIMIT))


def _height(before: Rows, after: Rows) -> float:
    off = median_measured(before["height"]) - median_measured(after["height"])
    return 0.25 * (off / _HEIGHT_ERROR) ** 2 if np.isfinite(off) else 0.0


def _motion(before: Rows, after: Rows, frame_rate: float) -> float:
    """Cost of a constant velocity from the end of one part to the beginning of the other, nats."""
    gap = max(int(after["frame"][0] - before["frame"][-1]), 0) / frame_rate
    here = np.array([before["x"][-1], before["y"][-1]])
    after_place = np.array([after["x"][0], after["y"][0]])
    start = max(len(before) - 1 - round(frame_rate), 0)
    span = max(int(before["frame"][-1] - before["frame"][start]), 1) / frame_rate
    velocity = (here - np.array([before["x"][start], before["y"][start]])) / span
    spread = _PLACE_ERROR + _SPEED_ERROR * gap + _ACCELERATION * gap**2 / 2
    return 0.5 * float(((after_place - here - velocity * gap) ** 2).sum()) / spread**2


def _gaps(rows: dict[int, Rows], frame_rate: float) -> list[Doubt]:
    """Tracks that begin where another ended shortly before: the decision is that they are two people."""
    found, ids = [], list(rows)
    last = np.array([of_track["frame"][-1] for of_track in rows.values()])
    for late, of_track in rows.items():
        best: Doubt | None = None
        gaps = (of_track["frame"][0] - last) / frame_rate
        for k in np.flatnonzero((gaps > 0) & (gaps <= _LONGEST_GAP)).tolist():
            early, other = ids[k], rows[ids[k]]
            margin = _motion(other, of_track, frame_rate) + _height(other, of_track) + np.log1p(gaps[k]) - 1.0
            if margin < _MARGIN_LIMIT and (best is None or margin < best.margin):
                best = Doubt("gap", early, late, int(other["frame"][-1]), int(of_track["frame"][0]), float(margin))
        found += [] if best is None else [best]
    return found


def _births(rows: dict[int, Rows], frame_rate: float, met: set[tuple[int, int, int]]) -> list[Doubt]:
    """Tracks that begin while another one goes on from where it may come; `met` there are asked about already."""
    found, ids = [], list(rows)
    begin, end = np.array([of_track["frame"][[0, -1]] for of_track in rows.values()]).T
    for late, of_track in rows.items():
        first = int(of_track["frame"][0])
        for other in (ids[k] for k in np.flatnonzero((begin < first) & (end >= first)).tolist()):
            if {(other, late, first), (late, other, first)} & met:
                continue
            before = rows[other][: np.searchsorted(rows[other]["frame"], first)]
            if first - int(before["frame"][-1]) <= frame_rate:
                begun = _between(of_track, first, first + _COMPARED_TIME * frame_rate)
                margin = _motion(before, of_track, frame_rate) + _height(before[-len(begun) :], begun)
                if margin < _MARGIN_LIMIT:
                    found.append(Doubt("birth", other, late, int(before["frame"][-1]), first, margin))
    return found


def _weak(rows: dict[int, Rows], frame_rate: float, border: Border) -> list[Doubt]:
    """Tracks that begin and end inside the area: the decision is that they are people."""
    found: list[Doubt] = []
    if not rows:
        return found
    first, last = min(one["frame"][0] for one in rows.values()), max(one["frame"][-1] for one in rows.values())
    for identity, of_track in rows.items():
        ends = np.array([[of_track["x"][k], of_track["y"][k]] for k in (0, -1)])
        inside = border.away(ends) > _BORDER_WIDTH
        if inside.all() and of_track["frame"][0] > first and of_track["frame"][-1] < last:
            margin = min(float(of_track["score"].mean()) * min(len(of_track) / frame_rate / 2.0, 3.0), _MARGIN_LIMIT)
            found.append(Doubt("false", identity, 0, int(of_track["frame"][0]), int(of_track["frame"][-1]), margin))
    return found
