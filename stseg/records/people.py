"""Input and result of per-frame detection: view evidence; people, ghosts, and the assignment of boxes and pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints
from stseg.records.candidates import Candidates
from stseg.records.sizes import Sizes

SAME_PLACE = 0.2
"""Distance below which people of two readings of a frame are one, metres."""


_FREE_SHARE = 0.95
"""Least share of a whole body's detection rate where it stands free, 0..1."""


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
    found_share: Floats
    """float64 (view, n): share of a whole body's detection rate with which a view of boxes finds each, past nearer
    people, 0..1; 1 in views of pixels."""
    prior: Floats
    """float64 (n,): part of the prior in the evidence, nats."""
    track_index: Ints
    """int64 (n,): the predicted track that each continues, -1 for births."""
    sizes: Sizes
    """Size posteriors of this frame alone, under the population prior."""

    def __len__(self) -> int:
        return len(self.ground)

    @property
    def candidates(self) -> Candidates:
        """Their places and sizes."""
        return Candidates(self.ground, self.height, self.width)

    @property
    def is_free(self) -> Flags:
        """bool (view, n): those whom a view of boxes finds as it finds whole bodies."""
        return np.asarray(self.found_share >= _FREE_SHARE)

    def supported_without(self, view: int, least: float) -> Flags:
        """Those for whom all evidence but one view's is some nats at least, bool (n,)."""
        return np.asarray(self.evidence - self.view_evidence[view] >= least)

    def at(self, chosen: Ints) -> People:
        """The chosen of them, int64 (k,)."""
        columns = {name: getattr(self, name)[..., chosen] for name in _BY_VIEW}
        rows = {name: getattr(self, name)[chosen] for name in _BY_PERSON}
        return People(**rows, **columns, sizes=self.sizes.at(chosen))

    def joined_with(self, other: People) -> People:
        """These, then others."""
        columns = {name: np.concatenate([getattr(self, name), getattr(other, name)], 1) for name in _BY_VIEW}
        rows = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in _BY_PERSON}
        return People(**rows, **columns, sizes=self.sizes.joined_with(other.sizes))


_BY_VIEW = "view_evidence", "found_share"
"""Fields (view, n)."""
_BY_PERSON = "ground", "height", "width", "covariance", "evidence", "prior", "track_index"
"""Fields (n, ...)."""


@dataclass(frozen=True)
class Alternative:
    """Another reading of a frame."""

    explanation: Explanation
    """The frame's explanation by other people."""
    gain: float | None
    """Gain of the score without tracks by them, nats; None where they are the same."""


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
    followed: Alternative | None = None
    """The reading by alternative tracks; None where none are followed."""
    found: Alternative | None = None
    """The reading by a search without tracks; None where it has no other people who gain enough."""
