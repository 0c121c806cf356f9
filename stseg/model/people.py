"""What goes into the pass of one frame and what comes out of it: people, ghosts, and who explains what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Floats, Ints, ViewEvidence
from stseg.geometry import Rig
from stseg.model.sizes import Sizes


@dataclass(frozen=True)
class People:
    """Places of bodies.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres.
    height, width : float64 (n,)
        By all that is known of each, metres.
    covariance : float64 (n, 2, 2)
        Square metres.
    evidence : float64 (n,)
        What all views and the prior say, nats.
    view_evidence : float64 (view, n)
        What each view says, nats.
    visibility : float64 (view, n)
        How much of each body a view can see past nearer people, 0..1.
    prior : float64 (n,)
        What of the evidence spoke before any view was asked, nats.
    track_index : int64 (n,)
        Whom of those expected each is, -1 for newcomers.
    sizes
        What the frame by itself says of their sizes, anybody's the prior.
    """

    ground: Floats
    height: Floats
    width: Floats
    covariance: Floats
    evidence: Floats
    view_evidence: Floats
    visibility: Floats
    prior: Floats
    track_index: Ints
    sizes: Sizes

    def __len__(self) -> int:
        return len(self.ground)


@dataclass(frozen=True)
class Explanation:
    """Who is there, who is not, and who explains what.

    Attributes
    ----------
    people
        The true candidates.
    ghosts
        Candidates that were weighed and found to be nobody.
    pixel_assignment : tuple of int16 arrays (v, u)
        For each view the index of the person whose body is nearest at each raster pixel, -1 for nobody.
    raster_step : tuple of int
        Image pixels to a raster pixel of `pixel_assignment`, for each view.
    box_assignment : tuple of int64 arrays (box,)
        For each view with boxes the person whom each box shows, -1 for nobody; empty for other views.
    residual : float64 (view,)
        How far beside their places each view sees people, metres (see `ghosts.aside`); nan where it tells nothing.
    """

    people: People
    ghosts: People
    pixel_assignment: tuple[NDArray[np.int16], ...]
    raster_step: tuple[int, ...]
    box_assignment: tuple[Ints, ...]
    residual: Floats


def empty_explanation(rig: Rig, seen: Sequence[ViewEvidence]) -> Explanation:
    """The explanation of a frame without people: every pixel and every box is unassigned."""
    none, views = np.zeros(0), len(seen)
    people = People(
        np.zeros((0, 2)), none, none, np.zeros((0, 2, 2)), none, np.zeros((views, 0)), np.zeros((views, 0)), none,
        np.zeros(0, np.int64), Sizes(none, none, none, none),
    )  # fmt: skip
    # One raster pixel for the whole image: nobody's everywhere.
    steps = tuple(max(camera.size) for camera in rig.cameras)
    owner = tuple(np.full((1, 1), -1, np.int16) for _ in steps)
    boxes = tuple(np.full(len(view) if isinstance(view, Boxes) else 0, -1, np.int64) for view in seen)
    return Explanation(people, people, owner, steps, boxes, np.full(len(steps), np.nan))
