"""From everybody's ends to a checked solution: the way of `stseg calibrate auto`, without files."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stseg.arrays import Bytes
from stseg.calibration.adjusted_rig import cameras_of, centred, grid_of
from stseg.calibration.auto_diagnosis import require_met, require_placed, require_walkers
from stseg.calibration.floor_features import floor_marks
from stseg.calibration.solution import (
    ROUNDS,
    Solution,
    Views,
    placed_views,
    refine,
    refine_with_marks,
    views_alone,
    walks_of,
)
from stseg.calibration.view_merging import align_all, assemble
from stseg.errors import SourceError

_FLOOR_ROUNDS = 2
"""Marks are found better once the plans fit better."""
_FLOOR_CELL = 0.1
"""Metres."""


def steps_of(views: int) -> int:
    """How often `calibrate_from_people` tells of progress."""
    return views + views * (views - 1) // 2 + ROUNDS


def calibrate_from_people(names: Sequence[str], views: Views, progress: Callable[[], None]) -> Solution:
    """Cameras on one ground, from people who walk there and nothing else.

    Parameters
    ----------
    names
        What messages call the views.
    views
        Ends of isolated people in every view.
    progress
        Told after each step.

    Raises
    ------
    SourceError
        Names the view in which too few people walk, or which does not show the same people at the same time.
    """
    if len(views.ends) < 2:
        raise SourceError(names[0] if names else "videos", "", f"{len(views.ends)} views", "two or more")
    for name, ends in zip(names, views.ends, strict=True):
        require_walkers(name, ends)
    alone = views_alone(views, progress)
    walks = walks_of(views, alone)
    most = round(views.most_delay * views.frame_rate)
    assembly = assemble(walks, align_all(walks, views.frame_rate, most, progress))
    require_placed(names, walks, assembly, views.frame_rate, most)
    delay = np.array([assembly.placed[k].delay for k in range(len(names))], np.int64)
    solution = refine(views, placed_views(alone, assembly), delay, progress)
    require_met(names, solution)
    return centred(solution)


def sharpen_by_floor(views: Views, solution: Solution, backgrounds: Sequence[Bytes]) -> tuple[Solution, int]:
    """The same with the help of marks on the floor, and how many there are; 0 on a bare one.

    Parameters
    ----------
    views
        What `solution` was made of.
    solution
        Views placed by people.
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
