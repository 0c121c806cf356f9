"""Input and result of per-frame detection: view evidence; people, ghosts, and the assignment of boxes and pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Floats, Ints, ViewEvidence
from stseg.geometry import Rig
from stseg.records.sizes import Sizes


@dataclass(frozen=True)
class People:
    """Candidates with places, sizes and evidence: people, or ghosts."""

    ground: Floats
    """float64 (n, 2): metres."""
    height: Floats
    """float64 (n,): by all frames so far, metres."""
    width: Floats
    """float64 (n,): by all frames so far, metres."""
    covariance: Floats
    """float64 (n, 2, 2): square metres."""
    evidence: Floats
    """float64 (n,): log-odds of the person by all views and the prior, given the others, nats."""
    view_evidence: Floats
    """float64 (view, n): part of each view, nats."""
    visibility: Floats
    """float64 (view, n): share of each body that a view sees past nearer people, 0..1."""
    prior: Floats
    """float64 (n,): part of the prior in the evidence, nats."""
    track_index: Ints
    """int64 (n,): the predicted track that each continues, -1 for births."""
    sizes: Sizes
    """Size posteriors of this frame alone, under the population prior."""

    def __len__(self) -> int:
        return len(self.ground)


@dataclass(frozen=True)
class Explanation:
    """Result of per-frame detection."""

    people: People
    """The accepted candidates."""
    ghosts: People
    """The rejected candidates."""
    pixel_assignment: tuple[NDArray[np.int16], ...]
    """tuple of int16 arrays (v, u): for each view the index of the person of the nearest body at each raster pixel, -1
    for none."""
    raster_step: tuple[int, ...]
    """tuple of int: image pixels to a raster pixel of `pixel_assignment`, for each view."""
    box_assignment: tuple[Ints, ...]
    """tuple of int64 arrays (box,): for each view with boxes the person that each box is assigned to, -1 for none;
    empty for other views."""
    residual: Floats
    """float64 (view,): reprojection residual, metres (see `stseg.view_health.reprojection_residuals`); nan where
    nothing was measured."""
    unfinished: int = 0
    """Candidates of the largest group that was not searched to the end, 0 for none."""


def empty_explanation(rig: Rig, evidence: Sequence[ViewEvidence]) -> Explanation:
    """The explanation of a frame without people: every pixel and every box is unassigned."""
    none, views = np.zeros(0), len(evidence)
    people = People(
        np.zeros((0, 2)), none, none, np.zeros((0, 2, 2)), none, np.zeros((views, 0)), np.zeros((views, 0)), none,
        np.zeros(0, np.int64), Sizes(none, none, none, none),
    )  # fmt: skip
    # One raster pixel for the whole image, unassigned.
    steps = tuple(max(camera.size) for camera in rig.cameras)
    owner = tuple(np.full((1, 1), -1, np.int16) for _ in steps)
    boxes = tuple(np.full(len(view) if isinstance(view, Boxes) else 0, -1, np.int64) for view in evidence)
    return Explanation(people, people, owner, steps, boxes, np.full(len(steps), np.nan))
