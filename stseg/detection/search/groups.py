"""Groups of candidates that interact, each decided by itself (HW12 section IV-B).

Two candidates interact where their projections overlap in a view with pixels, where one hides the other or both fit one
box in a view with boxes, where both may continue one track, and where they stand too close for two bodies. The score of
a set is the sum of the scores of its groups, exactly.
"""

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.problem import RaggedArray
from stseg.detection.score.set_state import SetState
from stseg.kernels.accelerate import kernel, part


@kernel
def fill_groups(state: SetState, group: Ints) -> int:
    """Fill group (candidate,) with numbers from 0, in the order of their first candidates; returns how many."""
    candidates = len(group)
    linked, waiting, number = np.empty(candidates, np.bool_), np.empty(candidates, np.int64), 0
    group[:] = -1
    for first in range(candidates):
        if group[first] >= 0:
            continue
        group[first], waiting[0], count = number, first, 1
        while count > 0:
            count -= 1
            mark_interacting(waiting[count], state, linked)
            for j in range(candidates):
                if group[j] < 0 and linked[j]:
                    group[j], waiting[count] = number, j
                    count += 1
        number += 1
    return number


@kernel
def mark_interacting(i: int, state: SetState, linked: Flags) -> None:
    """Fill linked (candidate,): whether the gain of candidate i depends on each; on itself, too."""
    boxes, tracks, neighbours, candidates = state.boxes, state.tracks, state.problem.neighbours, len(linked)
    for j in range(candidates):
        linked[j] = j == i
    for k in range(neighbours.start[i], neighbours.start[i + 1]):
        if neighbours.value[k] > 0:
            linked[neighbours.item[k]] = True
    overlapping = state.pixels.evidence.overlapping
    for row in range(i, len(overlapping.start) - 1, candidates):
        _mark_row(row, overlapping, linked)
    for k in range(tracks.gains.start[i], tracks.gains.start[i + 1]):
        _mark_row(tracks.gains.item[k], tracks.followers, linked)
    for view in range(boxes.views):
        row = view * candidates + i
        for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
            _mark_row(view * boxes.boxes + boxes.fits.item[k], boxes.fitting, linked)
        _mark_row(row, boxes.occluded, linked)
        _mark_row(row, boxes.occluders, linked)


@part
def _mark_row(row: int, rows: RaggedArray, linked: Flags) -> None:
    for k in range(rows.start[row], rows.start[row + 1]):
        linked[rows.item[k]] = True
