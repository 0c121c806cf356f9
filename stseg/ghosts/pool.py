"""The candidates of a frame, and all views' evidence for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from stseg.arrays import Floats, Ints
from stseg.ghosts.boxes import fill_cover, fill_inside, fill_match
from stseg.ghosts.evidence import BoxEvidence, PixelEvidence
from stseg.ghosts.views import BoxView, PixelView, Sight, View

MOST = 250
"""Candidates that one round adds at most."""
_WORTH = 0.0
"""Score above which a peak of the lattice is a candidate, nats."""


@dataclass(frozen=True)
class Pool:
    """Places where somebody may stand: ground float64 (n, 2), height and width float64 (n,), all in metres."""

    ground: Floats
    height: Floats
    width: Floats

    def __len__(self) -> int:
        return len(self.ground)

    def and_(self, other: Pool) -> Pool:
        """This pool's candidates, then the other's."""
        pairs = ((self.ground, other.ground), (self.height, other.height), (self.width, other.width))
        return Pool(*map(np.concatenate, pairs))

    def and_apart(self, other: Pool, apart: float) -> Pool:
        """This pool's candidates, then those of the other that stand `apart` metres or more from all before them."""
        every = self.and_(other)
        kept = list(range(len(self)))
        for i in range(len(self), len(every)):
            if not (np.hypot(*(every.ground[kept] - every.ground[i]).T) < apart).any():
                kept.append(i)
        return every.at(kept)

    def at(self, chosen: Sequence[int] | Ints) -> Pool:
        """The chosen candidates, in that order."""
        index = np.asarray(chosen, int)
        return Pool(self.ground[index], self.height[index], self.width[index])


def peaks(score: Floats, lattice_ground: Floats, heights: Floats, width: float) -> Pool:
    """Local maxima of a lattice score (height, y, x) over the ground (y, x, 2), all of one width, best first."""
    best, tallest = score.max(0), score.argmax(0)
    rows, columns = np.nonzero((best == maximum_filter(best, 3)) & (best > _WORTH))
    order = np.argsort(-best[rows, columns], kind="stable")[:MOST]
    rows, columns = rows[order], columns[order]
    return Pool(lattice_ground[rows, columns], heights[tallest[rows, columns]], np.full(len(rows), width))


def box_evidence(views: Sequence[View], sights: Sequence[Sight | None], pool: Pool) -> BoxEvidence:
    """Evidence of all views that deliver boxes; a blind one (None) has the candidates outside its image."""
    chosen = [(view, sight) for view, sight in zip(views, sights, strict=True) if isinstance(view, BoxView)]
    most = max((len(sight.edges) for _, sight in chosen if sight), default=0)
    n = len(pool)
    evidence = BoxEvidence(
        np.full((len(chosen), n, most), -np.inf),
        np.array([len(sight.edges) if sight else 0 for _, sight in chosen], np.int64),
        np.zeros((len(chosen), n, n)),
        np.zeros((len(chosen), n)),
    )
    for k, (view, sight) in enumerate(chosen):
        if sight is not None:
            width, height = map(float, view.camera.size)
            bodies = view.table.boxes_of(pool.ground, pool.height)
            match = evidence.match[k, :, : len(sight.edges)]
            fill_match(bodies, sight.edges, sight.tolerance, sight.belief, width, height, match)
            fill_inside(bodies, width, height, evidence.inside[k])
            fill_cover(bodies, view.distance(pool.ground), width, height, evidence.cover[k])
    return evidence


def pixel_evidence(views: Sequence[View], sights: Sequence[Sight | None], pool: Pool) -> PixelEvidence:
    """Evidence of all views that deliver pixels; a blind one (None) shows log-odds of zero everywhere."""
    chosen = [(view, sight) for view, sight in zip(views, sights, strict=True) if isinstance(view, PixelView)]
    rows = max((view.shape[0] for view, _ in chosen), default=0)
    columns = max((view.shape[1] for view, _ in chosen), default=0)
    drawn = [view.outlines(pool.ground, pool.height, pool.width) for view, _ in chosen]
    tall = max((spans.shape[1] for _, spans, _ in drawn), default=0)
    n = len(pool)
    evidence = PixelEvidence(
        np.zeros((len(chosen), rows, columns), np.float32),
        np.full((len(chosen), n), -1, np.int64),
        np.zeros((len(chosen), n, tall, 2), np.int16),
        np.ones((len(chosen), n)),
        np.zeros((len(chosen), n)),
    )
    for k, ((view, sight), (first, spans, area)) in enumerate(zip(chosen, drawn, strict=True)):
        if sight is not None:
            evidence.raster[k, : view.shape[0], : view.shape[1]] = sight.raster
        evidence.first[k], evidence.area[k], evidence.order[k] = first, area, view.distance(pool.ground)
        evidence.spans[k, :, : spans.shape[1]] = spans
    return evidence
