"""Overlap of outlines in the views with pixels, as ragged rows: most candidates share no pixel.

A pool grows from search to search of a frame, and the lists of those that it had stay; only pairs with new ones are
looked for.
"""

import numpy as np

from stseg.arrays import Ints
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
    item, edges = np.empty(most, np.int64), np.empty((candidates, 2), np.int64)  # what is not filled takes no memory
    for view in range(views):
        _fill_edges(first[view], spans[view], edges)
        for i in range(candidates):
            begin = 0
            if i < base_candidates:
                begin, row = base_candidates, view * base_candidates + i
                for k in range(base.start[row], base.start[row + 1]):
                    item[number] = base.item[k]
                    number += 1
            for j in range(begin, candidates):
                if i == j or max(edges[i, 0], edges[j, 0]) >= min(edges[i, 1], edges[j, 1]):
                    continue
                if _share_pixel(i, j, first[view], spans[view]):
                    item[number] = j
                    number += 1
            start[view * candidates + i + 1] = number
    return RaggedArray(start, item[:number].copy(), nothing)


@part
def _fill_edges(first: Ints, spans: Spans, edges: Ints) -> None:
    """Fill edges (candidate, 2) with the first and last column (exclusive) of each outline of a view."""
    for i in range(len(edges)):
        edges[i, 0], edges[i, 1] = np.iinfo(np.int16).max, 0
        for row in range(spans.shape[1] if first[i] >= 0 else 0):
            if spans[i, row, 0] < spans[i, row, 1]:
                edges[i, 0], edges[i, 1] = min(edges[i, 0], spans[i, row, 0]), max(edges[i, 1], spans[i, row, 1])


@part
def _share_pixel(i: int, j: int, first: Ints, spans: Spans) -> bool:
    """Whether the outlines of two candidates share a pixel of a view."""
    for row in range(max(first[i], first[j]), min(first[i], first[j]) + spans.shape[1]):
        a, b = spans[i, row - first[i]], spans[j, row - first[j]]
        if max(a[0], b[0]) < min(a[1], b[1]):
            return True
    return False
