"""Pixels of a set: each is assigned to the nearest member that covers it, and one more member changes its outline's.

Candidates whose outlines share no pixel in a view have nothing to do with each other there.
"""

from typing import NamedTuple

from stseg.arrays import Flags, Floats
from stseg.detection.problem import PixelAssignment, PixelEvidence, RaggedArray
from stseg.kernels.accelerate import kernel, part


class PixelState(NamedTuple):
    """Outlines of the candidates, and the assignment of pixels to a set."""

    evidence: PixelEvidence
    """The pixels, and the candidates' outlines."""
    owner: PixelAssignment
    """The set's assignment of pixels, -1 for none."""
    view_evidence: Floats
    """float64 (view, candidate): evidence for each candidate as a further member by its last `pixel_gain`, for
    observations of weight 1."""


@part
def overlaps(row: int, j: int, overlapping: RaggedArray) -> bool:
    """Whether candidate j is in a row of overlaps."""
    is_found = False
    for k in range(overlapping.start[row], overlapping.start[row + 1]):
        is_found = is_found or overlapping.item[k] == j
    return is_found


@part
def _rows(view: int, i: int, state: PixelState) -> int:
    """Rows of candidate i's outline that may lie on a view's raster."""
    first, pixels = state.evidence.first[view, i], state.evidence
    return min(pixels.spans.shape[2], pixels.raster.shape[1] - first) if first >= 0 else 0


@kernel
def assign_pixels(i: int, state: PixelState) -> None:
    """Assign to candidate i all pixels that no nearer member covers."""
    for view in range(len(state.evidence.raster)):
        assign_in_view(view, i, state)


@part
def assign_in_view(view: int, i: int, state: PixelState) -> None:
    """The same in one view."""
    pixels, owner = state.evidence, state.owner
    distance = pixels.distance[view]
    for k in range(_rows(view, i, state)):
        line = (pixels.first[view, i] + k) * pixels.raster.shape[2]
        for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
            before = owner[view, line + u]
            if before < 0 or distance[before] > distance[i]:
                owner[view, line + u] = i


@kernel
def reassign_pixels(view: int, i: int, inside: Flags, state: PixelState) -> None:
    """Reassign candidate i's pixels of a view to the nearest other member, inside (candidate,), that covers each."""
    pixels, owner, overlapping = state.evidence, state.owner[view], state.evidence.overlapping
    first, spans, distance = pixels.first[view], pixels.spans[view], pixels.distance[view]
    rows, row = _rows(view, i, state), view * len(inside) + i
    for k in range(rows):
        line = (first[i] + k) * pixels.raster.shape[2]
        for u in range(spans[i, k, 0], spans[i, k, 1]):
            if owner[line + u] == i:
                owner[line + u] = -1
    for a in range(overlapping.start[row], overlapping.start[row + 1]):
        j = overlapping.item[a]
        lower = first[j] - first[i]
        for k in range(max(lower, 0), min(rows, lower + spans.shape[1]) if inside[j] else 0):
            line, below = (first[i] + k) * pixels.raster.shape[2], k - lower
            for u in range(max(spans[i, k, 0], spans[j, below, 0]), min(spans[i, k, 1], spans[j, below, 1])):
                before = owner[line + u]
                if before < 0 or distance[before] > distance[j]:
                    owner[line + u] = j


@kernel
def pixel_gain(view: int, i: int, state: PixelState) -> float:
    """Change of a view's pixel score when candidate i joins the set, for observations of weight 1.

    The view's evidence for i, which leaves out what other members lose, is noted in `view_evidence`.
    """
    pixels, owner = state.evidence, state.owner[view]
    first, raster, distance = pixels.first[view, i], pixels.raster[view], pixels.distance[view]
    scale, area, gained, evidence = pixels.scale[view], pixels.area[view], 0.0, 0.0
    for k in range(_rows(view, i, state)):
        line = (first + k) * pixels.raster.shape[2]
        for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
            before = owner[line + u]
            if before < 0 or distance[before] > distance[i]:
                value = raster[first + k, u] / max(area[i], scale[first + k, u])
                gained, evidence = gained + value, evidence + value
            if before >= 0 and distance[before] > distance[i]:
                gained -= raster[first + k, u] / max(area[before], scale[first + k, u])
    state.view_evidence[view, i] = evidence
    return gained


@kernel
def release_pixels(i: int, state: PixelState) -> None:
    """Assign no pixel of candidate i's outlines."""
    pixels = state.evidence
    for view in range(len(pixels.raster)):
        for k in range(_rows(view, i, state)):
            line = (pixels.first[view, i] + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                state.owner[view, line + u] = -1
