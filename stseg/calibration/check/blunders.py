"""Blunders of a recording rather than of a camera's pose: swapped streams and delayed streams."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from stseg.arrays import Floats, Ints
from stseg.bodies.pillars import BodyTable
from stseg.calibration.check.box_correspondence import (
    SPANS,
    BoxCorrespondences,
    candidates,
    match_boxes,
    mismatch,
    wholly_visible,
)
from stseg.calibration.check.leave_one_out import edge_residuals, locate
from stseg.calibration.check.verdict import MIN_PEOPLE
from stseg.geometry import Camera, Grid, Rig

BoxesByFrame = Mapping[int, Sequence[Floats]]
"""Boxes of every view, float64 (n, 4), by frame."""
_SWAP_GAIN = 1.2
"""Least ratio of people of two views who meet others, after swapping their streams to before.

In 17 recordings of two to eight views it is 1.9 or more where two are swapped, and 0.6 or less where they are right.
"""
_MEETING_SHARE = 0.05
"""Least number of people who meet others, beyond chance, of two views that were swapped, a person and other view."""
_CERTAIN = 3.0
"""Standard deviations of the numbers of people who meet, within which two swaps, or one and none, fit alike."""
_MEETING_DISTANCE, _LAGS = 0.5, (0.3, 0.5, 0.7)
"""Distance within which people of two views meet, metres; shifts in time that show chance, lengths of the frames."""
_DELAY_MISFIT = 0.75
"""Share of the misfit that a delay may leave for the stream to count as delayed."""


class Standing(NamedTuple):
    """Where the people of a stream stand."""

    frame: Ints
    """int64 (n,): numbers of frames."""
    ground: Floats
    """float64 (n, 2): their places in these, metres."""
    tree: cKDTree
    """For neighbours in one frame: places as in `_apart`."""


@dataclass(frozen=True)
class StreamDelay:
    """A view with a delayed stream."""

    view: int
    """Index in the rig."""
    frames: int
    """Delay in frames; negative where the stream runs early."""


def match_frames(
    rig: Rig, tables: Sequence[BodyTable], boxes_by_frame: BoxesByFrame, frames: Sequence[int]
) -> BoxCorrespondences:
    """Correspondences of several frames, see `match_boxes`."""
    nothing = np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0), np.zeros((0, len(tables), 4))
    found = (match_boxes(rig, tables, frame, boxes_by_frame[frame]) for frame in frames)
    parts = [nothing, *((one.frame, one.ground, one.height, one.box) for one in found)]
    return BoxCorrespondences(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def find_swapped_streams(rig: Rig, boxes_by_frame: BoxesByFrame) -> tuple[tuple[int, int], ...]:
    """Pairs of views, with images of one size, whose people meet those of other views with their streams swapped.

    People meet where candidates of two views (feet, and heads at a usual height) are near each other more often than at
    other times: in crowds, too. Where views stand symmetrically, another pair fits as well: the people are turned about
    the middle. Both are given, the best first, of those that meet alike within chance.
    """
    frames = [boxes_by_frame[frame] for frame in sorted(boxes_by_frame)]
    streams = [[boxes[view] for boxes in frames] for view in range(len(rig.cameras))]
    places = [_standing(camera, rig.grid, boxes) for camera, boxes in zip(rig.cameras, streams, strict=True)]
    now = np.zeros((len(places), len(places), 2))
    for a, b in combinations(range(len(places)), 2):
        pair = [(places[a], places[b])]
        met = _meetings(pair, len(frames))
        now[a, b] = now[b, a] = met - _meetings_by_chance(pair, len(frames)), met
    gains, best = dict[tuple[int, int], float](), 0.0
    for a, b in combinations(range(len(places)), 2):
        if rig.cameras[a].size != rig.cameras[b].size:
            continue
        swapped = _standing(rig.cameras[a], rig.grid, streams[b]), _standing(rig.cameras[b], rig.grid, streams[a])
        others = [(one, places[view]) for view in range(len(places)) if view not in (a, b) for one in swapped]
        before, pairs = now[a].sum(axis=0) + now[b].sum(axis=0) - now[a, b], [swapped, *others]
        met, people = _meetings(pairs, len(frames)), sum(len(one.frame) for one in swapped)
        least = max(_SWAP_GAIN * before[0], _MEETING_SHARE * people, MIN_PEOPLE)
        chance = _CERTAIN * float(met + before[1]) ** 0.5
        if met - before[0] <= chance or met <= least:
            continue  # whatever it is beyond chance
        after = met - _meetings_by_chance(pairs, len(frames))
        gain = float(after - before[0])
        if gain > chance and after > least:
            gains[a, b], best = gain, max(best, gain - chance)
    return tuple(sorted((pair for pair in gains if gains[pair] >= best), key=lambda pair: -gains[pair]))


def _standing(camera: Camera, grid: Grid, boxes: Sequence[Floats]) -> Standing:
    """Where the people of a stream, boxes (n, 4) a frame, would stand if it were this camera's."""
    ground, _, box = candidates(camera, grid, np.concatenate(boxes))
    frame = np.repeat(np.arange(len(boxes)), [len(part) for part in boxes])[box]
    return Standing(frame, ground, cKDTree(_apart(frame, ground)))


def _meetings_by_chance(pairs: Sequence[tuple[Standing, Standing]], frames: int) -> float:
    """Number of people near one of another view at other times."""
    return float(np.mean([_meetings(pairs, frames, int(lag * frames)) for lag in _LAGS]))


def _meetings(pairs: Sequence[tuple[Standing, Standing]], frames: int, lag: int = 0) -> int:
    """Number of people of the first views who are near one of the second, as many frames later."""
    number = 0
    for one, other in pairs:
        later = (one.frame + lag) % frames  # the recording begins anew at its end
        away, _ = other.tree.query(_apart(later, one.ground), distance_upper_bound=_MEETING_DISTANCE)
        number += int(np.count_nonzero(away < _MEETING_DISTANCE))
    return number


def _apart(frame: Ints, ground: Floats) -> Floats:
    """Places (n, 3) of which those of two frames are farther from each other than people are near, metres."""
    return np.column_stack([frame * 2 * _MEETING_DISTANCE, ground])


def find_stream_delay(
    tables: Sequence[BodyTable], boxes_by_frame: BoxesByFrame, people: BoxCorrespondences, most: int
) -> StreamDelay | None:
    """The view with boxes that fit the others best at a different time; None where each fits best undelayed.

    `boxes_by_frame` are those of all frames, without gaps, `people` correspondences in some of them, and `most` is the
    largest delay in either direction, frames.
    """
    clearest, found = _DELAY_MISFIT, None
    shifts = range(-most, most + 1)
    for view in range(len(tables)):
        others = [other for other in range(len(tables)) if other != view]
        located = locate(people, tables, others, min(2, len(others)))
        misfit = np.array([_misfit(tables[view], view, boxes_by_frame, located, shift) for shift in shifts])
        if not np.isfinite(misfit).all():
            continue
        share, delay = float(misfit.min() / misfit[most]), shifts[int(misfit.argmin())]
        if share < clearest and _is_lasting(tables[view], view, boxes_by_frame, located, delay):
            clearest, found = share, StreamDelay(view, delay)
    return found


def _is_lasting(
    table: BodyTable, view: int, boxes_by_frame: BoxesByFrame, people: BoxCorrespondences, shift: int
) -> bool:
    """Whether a delay fits better without each span of time, too: one person who turns may pass for a delay."""
    parts = [people.without_span(span) for span in range(SPANS)]
    misfits = [[_misfit(table, view, boxes_by_frame, part, at) for at in (0, shift)] for part in parts]
    return all(delayed < _DELAY_MISFIT * undelayed for undelayed, delayed in misfits)


def without_delay(boxes_by_frame: BoxesByFrame, one: StreamDelay, size: int) -> dict[int, list[Floats]]:
    """The boxes with one view's delay undone; no boxes where its stream has ended."""
    nothing = [np.zeros((0, 4))] * size
    return {
        frame: [
            boxes_by_frame.get(frame + one.frames, nothing)[view] if view == one.view else view_boxes
            for view, view_boxes in enumerate(boxes)
        ]
        for frame, boxes in boxes_by_frame.items()
    }


def _misfit(table: BodyTable, view: int, boxes_by_frame: BoxesByFrame, people: BoxCorrespondences, shift: int) -> float:
    """Scatter of the nearest boxes `shift` frames later around a plane over the ground, in body heights.

    The plane is removed because a displaced or turned camera has one too, whatever its delay.
    """
    inside = wholly_visible(table, people.ground, people.height)
    offsets, places = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for frame in np.unique(people.frame[inside]).tolist():
        rows = np.flatnonzero(inside & (people.frame == frame))
        boxes = boxes_by_frame.get(frame + shift)
        if boxes is None or not len(boxes[view]):
            continue
        distance = mismatch(table, people.ground[rows], people.height[rows], boxes[view])
        matched = np.isfinite(distance.min(axis=1))
        nearest = boxes[view][distance.argmin(axis=1)[matched]]
        rows = rows[matched]
        residual, _, pixel_height = edge_residuals(table, people.ground[rows], people.height[rows], nearest)
        offsets.append(residual[:, :2] / pixel_height[:, None])
        places.append(people.ground[rows])
    scatter, ground = np.concatenate(offsets), np.concatenate(places)
    if len(scatter) < MIN_PEOPLE:
        return np.nan
    basis = np.column_stack([np.ones(len(ground)), ground])
    rest = scatter - basis @ np.linalg.lstsq(basis, scatter)[0]
    return float(np.median(np.hypot(*rest.T)))
