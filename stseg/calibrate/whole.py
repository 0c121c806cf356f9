"""From everybody's ends to a checked solution: the way of `stseg calibrate auto`, without files."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stseg.calibrate.assemble import align_all, assemble
from stseg.calibrate.doubts import require_met, require_placed, require_walkers
from stseg.calibrate.result import centred
from stseg.calibrate.solve import ROUNDS, Solution, Views, placed_views, refine, views_alone, walks_of
from stseg.errors import SourceError


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
