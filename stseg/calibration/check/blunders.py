"""Blunders of a recording rather than of a camera's pose: swapped streams and delayed streams."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stseg.arrays import Floats
from stseg.bodies.pillars import BodyTable
from stseg.calibration.check.box_correspondence import (
    MATCH_GATE,
    BoxCorrespondences,
    match_boxes,
    mismatch,
    wholly_visible,
)
from stseg.calibration.check.leave_one_out import edge_residuals, locate
from stseg.calibration.check.verdict import MIN_PEOPLE
from stseg.geometry import Rig

BoxesByFrame = Mapping[int, Sequence[Floats]]
"""Boxes of every view, float64 (n, 4), by frame."""
_SWAP_GAIN = 1.3
"""Least ratio of fitting boxes, after swapping two streams to before."""
_SWAP_TIE = 2.0
"""Standard deviations of the number of fitting boxes within which two swaps fit alike."""
_FIT_DISTANCE = 0.35
"""Distance, in gates, within which a box fits a person located by all views."""
_DELAY_MISFIT = 0.75
"""Share of the misfit that a delay may leave for the stream to count as delayed."""


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


def find_swapped_streams(
    rig: Rig,
    tables: Sequence[BodyTable],
    boxes_by_frame: BoxesByFrame,
    frames: Sequence[int],
    people: BoxCorrespondences,
) -> tuple[tuple[int, int], ...]:
    """Pairs of views, with images of one size, that fit far better with their streams swapped.

    Where views stand symmetrically, another pair fits as well: the people are turned about the middle. Both are given,
    the best first, of those that count as many fitting boxes within chance. `people` are the correspondences in
    `frames` under the rig as it is, `tables` those of `tables_of`.
    """
    least, fits = _SWAP_GAIN * max(_fitting_boxes(tables, people), MIN_PEOPLE), {}
    for first, second in combinations(range(len(tables)), 2):
        if rig.cameras[first].size != rig.cameras[second].size:
            continue
        order = list(range(len(tables)))
        order[first], order[second] = second, first
        swapped_boxes = {frame: [boxes_by_frame[frame][view] for view in order] for frame in frames}
        fits[first, second] = _fitting_boxes(tables, match_frames(rig, tables, swapped_boxes, frames))
    best = max(fits.values(), default=0)
    least = max(least, best - _SWAP_TIE * best**0.5)
    return tuple(sorted((pair for pair in fits if fits[pair] > least), key=lambda pair: -fits[pair]))


def _fitting_boxes(tables: Sequence[BodyTable], people: BoxCorrespondences) -> int:
    """Number of boxes close to their person's body as located by all views."""
    views = len(tables)
    located = locate(people, tables, range(views), min(3, views))
    measured = np.isfinite(located.height)
    count = 0
    for view, table in enumerate(tables):
        residual, uncut, pixel_height = edge_residuals(
            table, located.ground[measured], located.height[measured], people.box[measured, view]
        )
        with np.errstate(invalid="ignore"):
            off = np.hypot(residual[:, 0], residual[:, 1]) / pixel_height
            count += int((uncut[:, :2].all(axis=1) & (off < _FIT_DISTANCE * MATCH_GATE)).sum())
    return count


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
        best = int(misfit.argmin())
        if misfit[best] < clearest * misfit[most]:
            clearest, found = float(misfit[best] / misfit[most]), StreamDelay(view, shifts[best])
    return found


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
