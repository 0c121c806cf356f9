"""One frame while it is being explained: its candidates, and the set of them that explains it best so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.assignment import Assignment
from stseg.detection.body_size import measure
from stseg.detection.evidence import box_evidence, pixel_evidence
from stseg.detection.prior import Prior
from stseg.detection.problem import Parameters, Problem
from stseg.detection.refine import refine
from stseg.detection.scoring import box_score, pixel_score, set_score, walker_score
from stseg.detection.search import search
from stseg.detection.views import BoxView, PixelView, ViewObservation
from stseg.model.candidates import Candidates
from stseg.model.sizes import Sizes


@dataclass(frozen=True)
class FrameEvidence:
    """What stays the same while a frame is explained: the views, what each shows (None where blind), and the prior."""

    views: Sequence[BoxView | PixelView]
    sights: Sequence[ViewObservation | None]
    prior: Prior
    terms: Parameters


@dataclass(frozen=True)
class RefinedPeople:
    """A set's people, as exactly as the frame tells.

    Attributes
    ----------
    pool
        Where they stand, as tall as the frame by itself says: a height that was known before would confirm itself.
    covariance : float64 (n, 2, 2)
        Of each place, square metres.
    sizes
        What the frame by itself says of them, anybody's sizes the prior.
    known
        Their sizes by all that was seen of each so far.
    """

    pool: Candidates
    covariance: Floats
    sizes: Sizes
    known: Sizes


class MapEstimate:
    """Candidates, and the best set of them that a search finds.

    Parameters
    ----------
    seen
        What the frame is judged by.
    pool
        The candidates.
    members : int64 (n,)
        The candidates with whom the search begins.
    enumerated, trades
        How well the set is searched, see `stseg.detection.search`.
    """

    def __init__(
        self, seen: FrameEvidence, pool: Candidates, members: Ints, enumerated: int = 0, trades: int = 0
    ) -> None:
        self.seen, self.pool = seen, pool
        self.case = _case(seen, pool)
        # The scores' parts have the views with boxes first; `row` finds those of each view of the rig.
        pixels_last = np.argsort([isinstance(view, PixelView) for view in seen.views], kind="stable")
        self.row = np.argsort(pixels_last)
        room = np.zeros(len(pool) + 1, np.int64)
        room[: len(members)] = members
        count = search(room, len(members), self.case, enumerated, trades)
        self.members = room[:count].copy()
        self.total = self.score(self.members)
        self.box_owner, self.pixel_owner = self._owners()
        self.walker = self._walkers()

    def score(self, members: Ints) -> float:
        """Score of a set; the case's `parts` then holds what each view says of each member."""
        return set_score(members, len(members), self.case)

    def rivals(self) -> Ints:
        """Candidates outside the set, the best of each place, best first: int64 (n,)."""
        apart = 2 * self.seen.prior.config.lattice_spacing
        others = np.setdiff1d(np.arange(len(self.pool)), self.members)
        gain = np.array([self.score(np.append(self.members, i)) - self.total for i in others])
        standing, kept = self.pool.ground[self.members], []
        for i in others[np.argsort(-gain, kind="stable")]:
            place = self.pool.ground[i]
            if not (np.hypot(*(standing - place).T) < apart).any():
                standing = np.concatenate([standing, place[None]])
                kept.append(i)
        return np.array(kept, np.int64)

    def _owners(self) -> tuple[list[Ints], list[Ints]]:
        """For each view whose boxes are whose, and whose pixels are whose; -1 for nobody."""
        boxes, pixels = [], []
        case, count = self.case, len(self.members)
        box_view = pixel_view = 0
        for view, sight in zip(self.seen.views, self.seen.sights, strict=True):
            owner = np.full(len(sight.edges) if sight else 0, -1, np.int64)
            raster = np.full(view.shape, -1, np.int64)
            if isinstance(view, BoxView):
                box_score(box_view, self.members, count, case.boxes, case.terms, case.owner, case.parts[0])
                owner[:] = case.owner[: len(owner)]
                box_view += 1
            else:
                case.owner[:] = -1
                pixel_score(pixel_view, self.members, count, case.pixels, case.terms, case.owner, case.parts[0])
                rows, columns = case.pixels.raster.shape[1:]
                raster[:] = case.owner[: rows * columns].reshape(rows, columns)[: view.shape[0], : view.shape[1]]
                pixel_view += 1
            boxes.append(owner)
            pixels.append(raster)
        return boxes, pixels

    def _walkers(self) -> Ints:
        """Which walker each member is, int64 (member,), -1 for newcomers."""
        case, walker = self.case, np.full(len(self.members), -1, np.int64)
        walker_score(self.members, len(self.members), case.known, case.newcomer, case.owner)
        for k, place in enumerate(case.owner[: case.known.shape[1]]):
            if place >= 0:
                walker[place] = k
        return walker

    def free(self) -> list[Flags]:
        """For each view the boxes, or the pixels, that nobody explains."""
        return [
            (pixels if isinstance(view, PixelView) else boxes) < 0
            for view, boxes, pixels in zip(self.seen.views, self.box_owner, self.pixel_owner, strict=True)
        ]

    def refined(self) -> RefinedPeople:
        """The set's people at the means of their posteriors."""
        views, sights, prior, pool = self.seen.views, self.seen.sights, self.seen.prior, self.pool.at(self.members)
        own = Assignment(self._boxes(), self.pixel_owner)
        places = refine(pool, views, sights, own, prior, self.walker)
        sizes = measure(places, pool.width, views, sights, own, prior.body)
        known = prior.known_sizes(sizes, self.walker)
        return RefinedPeople(Candidates(places.ground, sizes.height, known.width), places.covariance, sizes, known)

    def _boxes(self) -> Ints:
        """The box of each member in each view, int64 (view, member), -1 for none."""
        box = np.full((len(self.seen.views), len(self.members)), -1, np.int64)
        for row, owner in zip(box, self.box_owner, strict=True):
            taken = np.flatnonzero(owner >= 0)
            row[owner[taken]] = taken
        return box


def _case(seen: FrameEvidence, pool: Candidates) -> Problem:
    """All that is known of the candidates, as the search reads it."""
    views, sights, prior = seen.views, seen.sights, seen.prior
    boxes, pixels = box_evidence(views, sights, pool), pixel_evidence(views, sights, pool)
    owner = np.empty(max(pixels.raster[:1].size, boxes.match.shape[2], len(prior.expected), 1), np.int64)
    parts = np.zeros((len(views), len(pool) + 1))
    own, newcomer, known = prior.tall(pool.height), prior.newcomer(pool.ground), prior.track_log_ratio(pool)
    return Problem(boxes, pixels, own, newcomer, known, pool.ground, seen.terms, owner, parts)
