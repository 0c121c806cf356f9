"""Calibration from upright people: endpoints in, checked solution out (the core of `stseg calibrate auto`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stseg.arrays import Bytes
from stseg.calibration.adjusted_rig import cameras_of, centred, grid_of
from stseg.calibration.automatic.auto_diagnosis import require_correspondences, require_merged, require_people
from stseg.calibration.automatic.floor_features import floor_marks
from stseg.calibration.automatic.solution import (
    ROUNDS,
    CalibrationInput,
    Solution,
    placed_views,
    refine,
    refine_with_marks,
    single_view_cameras,
    view_paths,
)
from stseg.calibration.automatic.view_merging import align_all, merge_views
from stseg.errors import SourceError

_FLOOR_ROUNDS = 2
"""Rounds of floor features: a better rig rectifies the floor better, which finds more features."""
_FLOOR_CELL = 0.1
"""Cell of the rectified floor, metres."""


def steps_of(views: int) -> int:
    """Number of progress calls of `calibrate_from_people`."""
    return views + views * (views - 1) // 2 + ROUNDS


def calibrate_from_people(names: Sequence[str], views: CalibrationInput, progress: Callable[[], None]) -> Solution:
    """Calibrate cameras from the feet and heads of walking people alone.

    Parameters
    ----------
    names
        Names of the views in error messages.
    views
        Endpoints of isolated people in every view.
    progress
        Called after each step.

    Raises
    ------
    SourceError
        For a view with too few people, or one that does not show the same people at the same time.
    """
    if len(views.endpoints) < 2:
        raise SourceError(names[0] if names else "videos", "", f"{len(views.endpoints)} views", "two or more")
    for name, endpoints in zip(names, views.endpoints, strict=True):
        require_people(name, endpoints)
    single_cameras = single_view_cameras(views, progress)
    paths = view_paths(views, single_cameras)
    most = round(views.most_delay * views.frame_rate)
    merged = merge_views(paths, align_all(paths, views.frame_rate, most, progress))
    require_merged(names, paths, merged, views.frame_rate, most)
    delay = np.array([merged.placed[k].delay for k in range(len(names))], np.int64)
    solution = refine(views, placed_views(single_cameras, merged), delay, progress)
    require_correspondences(names, solution)
    return centred(solution)


def sharpen_by_floor(views: CalibrationInput, solution: Solution, backgrounds: Sequence[Bytes]) -> tuple[Solution, int]:
    """Refine a solution by floor features; returns their number too, 0 on a bare floor.

    Parameters
    ----------
    views
        Input of `solution`.
    solution
        Cameras calibrated from people.
    backgrounds
        The empty scene in each view, uint8 (v, u, 3).
    """
    names = [str(view) for view in range(len(backgrounds))]
    count = 0
    for _ in range(_FLOOR_ROUNDS):
        marks = floor_marks(backgrounds, cameras_of(solution, names), grid_of(solution, _FLOOR_CELL))
        if not len(marks):
            break
        solution, count = centred(refine_with_marks(views, solution, marks)), len(marks)
    return solution, count
