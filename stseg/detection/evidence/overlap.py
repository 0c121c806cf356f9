"""Overlap of outlines in the views with pixels, as ragged rows: most candidates share no pixel.

A pool grows from search to search of a frame, and the lists of those that it had stay; only pairs with new ones are
looked for.
"""

import numpy as np

from stseg.arrays import Flags, Ints, Shorts
from stseg.bodies.outlines import Spans
from stseg.detection.problem import RaggedArray
from stseg.kernels.accelerate import kernel, part


@kernel
def overlaps_of(first: Ints, spans: Spans, base: RaggedArray, base_candidates: int) -> RaggedArray:
    """The others whose outlines share a pixel with each candidate's, rising.

    Outlines are `first` (view, candidate) and `spans` (view, candidate, row, 2) of `PixelEvidence`; `base` are the
    lists of the first `base_candidates`. The row of a candidate in a view is view * candidates + candidate.
    """
    views, candidates = first.shape
    start, number, nothing = np.zeros(views * candidates + 1, np.int64), 0, np.empty(0)
    most = len(base.item) + views * (candidates * candidates - base_candidates * base_candidates)
    item, bounds = np.empty(most, np.int64), np.empty((4, candidates), np.int16)  # what is not filled takes no memory
    is_near = np.empty(candidates, np.bool_)
    for view in range(views):
        _fill_bounds(first[view], spans[view], bounds)
        for i in range(candidates):
            begin = 0
            if i < base_candidates:
                begin, row = base_candidates, view * base_candidates + i
                for k in range(base.start[row], base.start[row + 1]):
                    item[number] = base.item[k]
                    number += 1
            _mark_near(i, bounds, is_near)
            for j in range(begin, candidates):
                if is_near[j] and i != j and _share_pixel(i, j, first[view], spans[view], bounds):
                    item[number] = j
                    number += 1
            start[view * candidates + i + 1] = number
    return RaggedArray(start, item[:number].copy(), nothing)


@part
def _fill_bounds(first: Ints, spans: Spans, bounds: Shorts) -> None:
    """Fill bounds (4, candidate) with the first and last column and row (exclusive) of each outline of a view."""
    for i in range(len(first)):
        left, right, bottom = np.iinfo(np.int16).max, 0, 0
        for row in range(spans.shape[1] if first[i] >= 0 else 0):
            if spans[i, row, 0] < spans[i, row, 1]:
                left, right, bottom = min(left, spans[i, row, 0]), max(right, spans[i, row, 1]), first[i] + row + 1
        bounds[0, i], bounds[1, i], bounds[2, i], bounds[3, i] = left, right, first[i], bottom


@part
def _mark_near(i: int, bounds: Shorts, is_near: Flags) -> None:
    """Fill is_near (candidate,): whether the bounds of candidate i and of each overlap."""
    left, right, top, bottom = bounds[0, i], bounds[1, i], bounds[2, i], bounds[3, i]
    for j in range(len(is_near)):  # without a branch: vector code
        columns = (bounds[0, j] < right) & (left < bounds[1, j])
        is_near[j] = columns & (bounds[2, j] < bottom) & (top < bounds[3, j])


@part
def _share_pixel(i: int, j: int, first: Ints, spans: Spans, bounds: Shorts) -> bool:
    """Whether the outlines of two candidates share a pixel of a view: most do in the middle of the rows of both."""
    top, bottom = max(bounds[2, i], bounds[2, j]), min(bounds[3, i], bounds[3, j])
    row = (top + bottom) // 2
    for _ in range(bottom - top):
        a, b = spans[i, row - first[i]], spans[j, row - first[j]]
        if max(a[0], b[0]) < min(a[1], b[1]):
            return True
        row = row + 1 if row + 1 < bottom else top
    return False
