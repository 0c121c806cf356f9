"""Who is who between views that are roughly placed: one person is where the feet of several views meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.calibration.endpoints import Ends

_PACE = 2.5
"""Metres per second that nobody walks faster than."""
_LINK_SECONDS = 0.5
"""Between two meetings of one person, at most."""


@dataclass(frozen=True)
class Meetings:
    """People at moments in which several views see them, and the ends by which each does.

    Attributes
    ----------
    frame : int64 (n,)
        Of the recording, for each person and moment.
    ground : float64 (n, 2)
        Roughly where, metres.
    velocity : float64 (n, 2)
        Metres per second; 0 where it is not known.
    person : int64 (n,)
        Whose meetings follow each other.
    point, view : int64 (m,)
        For each sighting, the meeting and the view.
    foot, head : float64 (m, 2)
        Pixels.
    """

    frame: Ints
    ground: Floats
    velocity: Floats
    person: Ints
    point: Ints
    view: Ints
    foot: Floats
    head: Floats

    def of(self, points: Ints) -> Meetings:
        """Some of the meetings, by increasing index."""
        number = np.full(len(self.frame), -1, np.int64)
        number[points] = np.arange(len(points))
        kept = number[self.point] >= 0
        return Meetings(
            self.frame[points],
            self.ground[points],
            self.velocity[points],
            self.person[points],
            number[self.point[kept]],
            self.view[kept],
            self.foot[kept],
            self.head[kept],
        )


def meetings(ends: Sequence[Ends], delay: Ints, ground: Sequence[Floats], gate: float, frame_rate: float) -> Meetings:
    """Everybody whom two or more views see at one time and, within the gate, at one place.

    Parameters
    ----------
    ends
        Each view's ends, by its own frames.
    delay : int64 (view,)
        Own frame = the recording's frame + delay.
    ground
        float64 (n, 2) a view: where its ends' feet stand, metres; nan where they stand nowhere.
    gate
        Metres between two views of one person, at most.
    frame_rate
        Frames per second.
    """
    view = np.repeat(np.arange(len(ends)), [len(one) for one in ends])
    frame = np.concatenate([one.frame - late for one, late in zip(ends, delay, strict=True)])
    place = np.concatenate(ground)
    known: Flags = np.asarray(np.isfinite(place).all(axis=1))
    order = np.lexsort((view, frame))
    order = order[known[order]]
    bounds = np.flatnonzero(np.diff(frame[order])) + 1
    groups = [group for rows in np.split(order, bounds) for group in _groups(rows, view, place, gate)]
    point = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    rows = np.array([row for group in groups for row in group], np.int64)
    at = np.array([place[group].mean(axis=0) for group in groups]).reshape(-1, 2)
    when = np.array([frame[group[0]] for group in groups], np.int64)
    person, velocity = _followed(when, at, frame_rate)
    foot, head = (np.concatenate([getattr(one, end) for one in ends])[rows] for end in ("foot", "head"))
    return Meetings(when, at, velocity, person, point, view[rows], foot, head)


def _groups(rows: Ints, view: Ints, place: Floats, gate: float) -> list[list[int]]:
    """Rows of one moment that are one person: the nearest pairs first, one row a view, all within the gate."""
    away = np.hypot(*np.moveaxis(place[rows][:, None] - place[rows][None], -1, 0))
    first, second = np.nonzero(np.triu(away <= gate, 1))
    group = {k: [k] for k in range(len(rows))}
    of = list(range(len(rows)))
    for k in np.argsort(away[first, second], kind="stable"):
        a, b = of[first[k]], of[second[k]]
        if a == b or {view[rows[x]] for x in group[a]} & {view[rows[x]] for x in group[b]}:
            continue
        if away[np.ix_(group[a], group[b])].max() > gate:
            continue
        for x in group[b]:
            of[x] = a
        group[a] += group.pop(b)
    return [[int(rows[x]) for x in sorted(members)] for members in group.values() if len(members) > 1]


def _followed(frame: Ints, ground: Floats, frame_rate: float) -> tuple[Ints, Floats]:
    """Number of the person of each meeting, and velocity in metres per second."""
    before, after = (np.full(len(frame), -1, np.int64) for _ in range(2))
    most = max(1, round(_LINK_SECONDS * frame_rate))
    for gap in range(1, most + 1):
        reach = 0.25 + _PACE * gap / frame_rate
        begin = np.searchsorted(frame, frame + gap, "left")
        end = np.searchsorted(frame, frame + gap, "right")
        for k in np.flatnonzero((after < 0) & (end > begin)):
            later = np.arange(begin[k], end[k])
            away = np.hypot(*(ground[later] - ground[k]).T)
            near = later[away < reach]
            if len(near) == 1 and before[near[0]] < 0:
                after[k], before[near[0]] = near[0], k
    person = np.arange(len(frame))
    for k in np.flatnonzero(before >= 0):  # in order of frames
        person[k] = person[before[k]]
    velocity = np.zeros((len(frame), 2))
    both = np.flatnonzero((before >= 0) & (after >= 0))
    span = frame[after[both]] - frame[before[both]]
    velocity[both] = (ground[after[both]] - ground[before[both]]) * (frame_rate / span)[:, None]
    return np.unique(person, return_inverse=True)[1].astype(np.int64), velocity
