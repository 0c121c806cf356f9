"""One frame's detection problem: candidates and their evidence, as arrays that the search kernels read.

Two forms of evidence stand side by side, since a rig may mix them: boxes, each assigned to one person at most, and
pixels, each assigned to the nearest person whose body covers it. Both are used once (docs/how-it-works.md, Detection).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Floats, Ints, Singles
from stseg.bodies.outlines import Spans
from stseg.config import DetectionConfig
from stseg.detection.evidence.ragged_lists import Lists

PixelAssignment = NDArray[np.int16]
"""int16 (view, v * u): the candidate whom each raster pixel is assigned to, -1 for none. Small, for speed."""


class Parameters(NamedTuple):
    """Constants of the score; see `stseg.config.DetectionConfig` for their meaning. Nats, shares and metres."""

    prior_log_odds: float
    minimum_distance: float
    hard_core: float
    common_width: float
    box_log_ratio: float
    box_miss_rate: float
    hidden_visibility: float
    full_visibility: float
    hidden_detection_rate: float
    effective_observations: float

    @classmethod
    def of(cls, config: DetectionConfig, hard_core: float, common_width: float) -> Parameters:
        """Those of a configuration; the hard core between bodies of common width, metres, depends on the views."""
        same = {name: getattr(config, name) for name in cls._fields if name not in ("hard_core", "common_width")}
        return cls(**same, hard_core=hard_core, common_width=common_width)


class BoxEvidence(NamedTuple):
    """Boxes of all views that deliver boxes.

    Attributes
    ----------
    match : float64 (view, candidate, box)
        Log-likelihood of the box given the candidate's pillar, nats, 0 at a perfect fit; -inf where there is no box.
    boxes : int64 (view,)
        Number of boxes of each view.
    hiders
        Candidates who hide a part of one, rising, with the share that they leave; the row of a candidate in a view is
        view * candidates + candidate.
    inside : float64 (view, candidate)
        Share of the candidate's pillar inside the image.
    left : float64 (candidate,)
        Scratch, 1 before and after: the share that each candidate leaves of one of them.
    """

    match: Floats
    boxes: Ints
    hiders: Lists
    inside: Floats
    left: Floats


class PixelEvidence(NamedTuple):
    """Foreground pixels of all views that deliver them, on rasters coarser than the images.

    Attributes
    ----------
    raster : float32 (view, v, u)
        Log-odds of foreground, nats.
    scale : float32 (view, v, u)
        Raster pixels of the largest body that explains each pixel (`blob_scale`); 0 where none does.
    first : int64 (view, candidate)
        First raster row of each candidate's outline; -1 where the view does not see it.
    spans : int16 (view, candidate, row, 2)
        First and last column (exclusive) of each row from `first` on; empty rows have both 0.
    area : float64 (view, candidate)
        Pixels of the whole outline, those outside the raster included.
    order : float64 (view, candidate)
        Distance from the camera on the ground, metres.
    """

    raster: Singles
    scale: Singles
    first: Ints
    spans: Spans
    area: Floats
    order: Floats

    def joined_with(self, other: PixelEvidence) -> PixelEvidence:
        """The evidence for these candidates, then for those of the other, by the same pixels."""
        views, number = self.first.shape
        every, tall = number + other.first.shape[1], max(self.spans.shape[2], other.spans.shape[2])
        spans = np.zeros((views, every, tall, 2), np.int16)
        spans[:, :number, : self.spans.shape[2]] = self.spans
        spans[:, number:, : other.spans.shape[2]] = other.spans
        first = np.concatenate([self.first, other.first], 1)
        area, order = np.concatenate([self.area, other.area], 1), np.concatenate([self.order, other.order], 1)
        return PixelEvidence(self.raster, self.scale, first, spans, area, order)


class Problem(NamedTuple):
    """The candidates of a frame and all that is known of them.

    Attributes
    ----------
    boxes, pixels
        Evidence of the views.
    size_prior : float64 (candidate,)
        Log prior density of each candidate's height and width beside that of the means, nats.
    birth_cost : float64 (candidate,)
        Cost of a birth at each place, nats.
    track_gain : float64 (candidate, track)
        Log-ratio of each candidate being each predicted track against being a birth that costs nothing, nats.
    ground : float64 (candidate, 2)
        Metres.
    breadth : float64 (candidate,)
        Width of each body beside a common one, at least 1: wider bodies need more room. 1 where boxes alone are seen.
    parameters
        Constants of the score.
    assigned : int64 (at least boxes, at least v * u, at least tracks)
        Scratch: after a view was scored, the place in the set of the member whom each box or pixel is assigned to, -1
        for none; after the tracks were scored, of the member who continues each track.
    owner : int16 (view, v * u)
        Scratch, -1 before and after: the candidate whom each pixel is assigned to while sets are searched.
    view_evidence : float64 (view, candidate + 1)
        Scratch: after a set was scored, what each view says of each of its members, nats; views with boxes first.
    """

    boxes: BoxEvidence
    pixels: PixelEvidence
    size_prior: Floats
    birth_cost: Floats
    track_gain: Floats
    ground: Floats
    breadth: Floats
    parameters: Parameters
    assigned: Ints
    owner: PixelAssignment
    view_evidence: Floats
