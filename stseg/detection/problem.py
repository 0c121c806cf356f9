"""One frame's detection problem: candidates and their evidence, as arrays that the search kernels read.

Two forms of evidence stand side by side, since a rig may mix them: boxes, each assigned to one person at most, and
pixels, each assigned to the nearest person that covers it. Both are used once (docs/how-it-works.md, Detection).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Floats, Ints, Singles
from stseg.bodies.outlines import Spans
from stseg.config import DetectionConfig
from stseg.kernels.accelerate import kernel, part

PixelAssignment = NDArray[np.int16]
"""int16 (view, v * u): the candidate that each raster pixel is assigned to, -1 for none. Small, for speed."""


class RaggedArray(NamedTuple):
    """Rows of different lengths, one behind the other: row r is `item[start[r]:start[r + 1]]`, with its values."""

    start: Ints
    """int64 (row + 1,)."""
    item: Ints
    """int64 (k,)."""
    value: Floats
    """float64 (k,)."""


@kernel
def ragged_array(number: Ints) -> tuple[RaggedArray, Ints]:
    """Rows with room for number (row,) of items each, and the places of their next items, int64 (row,)."""
    start = np.zeros(len(number) + 1, np.int64)
    for row in range(len(number)):
        start[row + 1] = start[row] + number[row]
    return RaggedArray(start, np.empty(start[-1], np.int64), np.empty(start[-1])), start[:-1].copy()


@part
def append(rows: RaggedArray, place: Ints, row: int, item: int, value: float) -> None:
    """Add an item to a row, at its next place."""
    rows.item[place[row]], rows.value[place[row]] = item, value
    place[row] += 1


def no_rows() -> RaggedArray:
    """Make an array without rows."""
    return RaggedArray(np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0))


class ScoreParameters(NamedTuple):
    """Constants of the score; see `stseg.config.DetectionConfig` for their meaning. Nats, shares and metres."""

    prior_log_odds: float
    minimum_distance: float
    hard_core: float
    common_width: float
    box_log_ratio: float
    box_miss_rate: float
    full_visibility: float
    hidden_detection_rate: float
    effective_observations: float

    @classmethod
    def of(cls, config: DetectionConfig, hard_core: float, common_width: float) -> ScoreParameters:
        """Those of a configuration; the hard core between bodies of common width, metres, depends on the views."""
        same = {name: getattr(config, name) for name in cls._fields if name not in ("hard_core", "common_width")}
        return cls(**same, hard_core=hard_core, common_width=common_width)


class BoxEvidence(NamedTuple):
    """Boxes of all views that deliver boxes."""

    match: Floats
    """float64 (view, candidate, box): log-likelihood of the box given the candidate's pillar, nats, 0 at a perfect fit;
    -inf where there is no box."""
    boxes: Ints
    """int64 (view,): number of boxes of each view."""
    occluders: RaggedArray
    """Candidates who hide a part of one, rising, with the share that they leave; the row of a candidate in a view is
    view * candidates + candidate."""
    inside: Floats
    """float64 (view, candidate): share of the candidate's pillar inside the image."""


class PixelEvidence(NamedTuple):
    """Foreground pixels of all views that deliver them, on rasters coarser than the images."""

    raster: Singles
    """float32 (view, v, u): log-odds of foreground, nats."""
    scale: Singles
    """float32 (view, v, u): raster pixels of the largest body that explains each pixel (`blob_scale`); 0 where none
    does."""
    first: Ints
    """int64 (view, candidate): first raster row of each candidate's outline; -1 where the view does not see it."""
    spans: Spans
    """int16 (view, candidate, row, 2): first and last column (exclusive) of each row from `first` on; empty rows have
    both 0."""
    area: Floats
    """float64 (view, candidate): pixels of the whole outline, those outside the raster included."""
    distance: Floats
    """float64 (view, candidate): distance from the camera on the ground, metres."""
    overlapping: RaggedArray
    """The others whose outlines share a pixel with each candidate's, rising; the row of a candidate in a view is view *
    candidates + candidate."""


class DetectionProblem(NamedTuple):
    """The candidates of a frame, their evidence and their prior."""

    boxes: BoxEvidence
    """Evidence of the views with boxes."""
    pixels: PixelEvidence
    """Evidence of the views with pixels."""
    size_prior: Floats
    """float64 (candidate,): log prior density of each candidate's height and width, less that of the means, nats."""
    birth_cost: Floats
    """float64 (candidate,): cost of a birth at each place, nats."""
    track_gain: Floats
    """float64 (candidate, track): log-ratio of each candidate being each predicted track against being a birth that
    costs nothing, nats."""
    ground: Floats
    """float64 (candidate, 2): metres."""
    breadth: Floats
    """float64 (candidate,): ratio of each body's width to a common one, at least 1: wider bodies need more room. 1
    without pixels."""
    neighbours: RaggedArray
    """The others within the distance of replacements or of crowding, rising, with the cost of the pair, nats."""
    parameters: ScoreParameters
    """Constants of the score."""
    owner: PixelAssignment
    """int16 (view, v * u): scratch, -1 before and after: the candidate that each pixel is assigned to while sets are
    searched."""
