"""Correspondences between roughly calibrated views: feet of several views within a gate on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.calibration.automatic.endpoints import Endpoints

_MAX_WALKING_SPEED = 2.5
"""Greatest walking speed, metres per second."""
_LINK_SECONDS = 0.5
"""Longest gap between two points of one track, seconds."""


@dataclass(frozen=True)
class Correspondences:
    """Points (a person in a frame) that several views observe, and the endpoints of each observation."""

    frame: Ints
    """int64 (n,): frame of the recording, for each point."""
    ground: Floats
    """float64 (n, 2): approximate ground point, metres."""
    velocity: Floats
    """float64 (n, 2): metres per second; 0 where it is not known."""
    person: Ints
    """int64 (n,): track that the point belongs to."""
    point: Ints
    view: Ints
    """int64 (m,) each: point and view of each observation."""
    foot: Floats
    head: Floats
    """float64 (m, 2) each: pixels."""

    def of(self, points: Ints) -> Correspondences:
        """A subset of the points, by increasing index, with their observations."""
        number = np.full(len(self.frame), -1, np.int64)
        number[points] = np.arange(len(points))
        kept = number[self.point] >= 0
        ends = (self.foot[kept], self.head[kept])
        places = (self.frame[points], self.ground[points], self.velocity[points], self.person[points])
        return Correspondences(*places, number[self.point[kept]], self.view[kept], *ends)


def match_endpoints(
    endpoints: Sequence[Endpoints], delay: Ints, ground: Sequence[Floats], gate: float, frame_rate: float
) -> Correspondences:
    """Match endpoints of two or more views that agree in time and, within the gate, in place.

    Parameters
    ----------
    endpoints
        Endpoints of each view, by its own frames.
    delay : int64 (view,)
        Own frame = the recording's frame + delay.
    ground
        float64 (n, 2) for each view: ground points of its feet, metres; nan above the horizon.
    gate
        Greatest distance between two views of one person, metres.
    frame_rate
        Frames per second.
    """
    view = np.repeat(np.arange(len(endpoints)), [len(one) for one in endpoints])
    frame = np.concatenate([one.frame - delay_frames for one, delay_frames in zip(endpoints, delay, strict=True)])
    place = np.concatenate(ground)
    on_ground: Flags = np.asarray(np.isfinite(place).all(axis=1))
    order = np.lexsort((view, frame))
    order = order[on_ground[order]]
    bounds = np.flatnonzero(np.diff(frame[order])) + 1
    groups = [group for rows in np.split(order, bounds) for group in _groups(rows, view, place, gate)]
    point = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    rows = np.array([row for group in groups for row in group], np.int64)
    point_place = np.array([place[group].mean(axis=0) for group in groups]).reshape(-1, 2)
    point_frame = np.array([frame[group[0]] for group in groups], np.int64)
    person, velocity = _link_points(point_frame, point_place, frame_rate)
    foot, head = (np.concatenate([getattr(one, end) for one in endpoints])[rows] for end in ("foot", "head"))
    return Correspondences(point_frame, point_place, velocity, person, point, view[rows], foot, head)


def _groups(rows: Ints, view: Ints, place: Floats, gate: float) -> list[list[int]]:
    """Agglomerative grouping of one frame's rows: nearest pairs first, one row a view, all within the gate."""
    away = np.hypot(*np.moveaxis(place[rows][:, None] - place[rows][None], -1, 0))
    first, second = np.nonzero(np.triu(away <= gate, 1))
    group = {k: [k] for k in range(len(rows))}
    group_of = list(range(len(rows)))
    for k in np.argsort(away[first, second], kind="stable"):
        a, b = group_of[first[k]], group_of[second[k]]
        if a == b or {view[rows[x]] for x in group[a]} & {view[rows[x]] for x in group[b]}:
            continue
        if away[np.ix_(group[a], group[b])].max() > gate:
            continue
        for x in group[b]:
            group_of[x] = a
        group[a] += group.pop(b)
    return [[int(rows[x]) for x in sorted(members)] for members in group.values() if len(members) > 1]


def _link_points(frame: Ints, ground: Floats, frame_rate: float) -> tuple[Ints, Floats]:
    """Track number of each point, and velocity in metres per second."""
    before, after = (np.full(len(frame), -1, np.int64) for _ in range(2))
    most = max(1, round(_LINK_SECONDS * frame_rate))
    for gap in range(1, most + 1):
        reach = 0.25 + _MAX_WALKING_SPEED * gap / frame_rate
        begin = np.searchsorted(frame, frame + gap, "left")
        end = np.searchsorted(frame, frame + gap, "right")
        for k in np.flatnonzero((after < 0) & (end > begin)):
            later = np.arange(begin[k], end[k])
            away = np.hypot(*(ground[later] - ground[k]).T)
            candidates = later[away < reach]
            if len(candidates) == 1 and before[candidates[0]] < 0:
                after[k], before[candidates[0]] = candidates[0], k
    person = np.arange(len(frame))
    for k in np.flatnonzero(before >= 0):  # in order of frames
        person[k] = person[before[k]]
    velocity = np.zeros((len(frame), 2))
    both = np.flatnonzero((before >= 0) & (after >= 0))
    span = frame[after[both]] - frame[before[both]]
    velocity[both] = (ground[after[both]] - ground[before[both]]) * (frame_rate / span)[:, None]
    return np.unique(person, return_inverse=True)[1].astype(np.int64), velocity
