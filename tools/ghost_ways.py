"""What a frame shows before ghosts are removed: every candidate is somebody.

The same views, lattice, prior odds, refinement and filter as the pass, and each candidate is judged by itself: a place
whose evidence, all pixels or boxes at its disposal, outweighs the price of a person (`ghosts.person`; nobody pays for
coming in) is a person, but one of those within half a metre of a better one. Nobody explains anything away, in the
frame or in the volume. Half a metre is the gate of the scores, so nothing is counted twice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.assignment import Assignment
from stseg.detection.body_size import measure
from stseg.detection.detector import Detector
from stseg.detection.evidence import peaks
from stseg.detection.prior import Prior
from stseg.detection.refine import refine
from stseg.detection.views import BoxView, PixelView, ViewObservation
from stseg.model.candidates import Candidates
from stseg.model.expected import Expected
from stseg.model.people import Explanation, People, ViewEvidence
from stseg.tracking.assignment import assign, distances

MERGED = 0.5
"""Distance within which candidates are one, metres."""


class EveryCandidate(Detector):
    """The pass of a frame without the removal of ghosts."""

    def explain(
        self, seen: Sequence[ViewEvidence], expected: Expected | None, proposed: Candidates | None = None
    ) -> Explanation:
        """Everybody who would be there if nobody else were; all of the lattice is tried, so nobody can be proposed."""
        assert proposed is None
        sights = [None if s is None else view.observe(s) for view, s in zip(self.views, seen, strict=True)]
        prior = Prior.of(expected, self.config, self.border)
        pool, parts = self._candidates(sights, prior)
        walker = _walkers(pool, prior)
        best = [
            [_box_of(v, s, pool.at([j])) for j in range(len(pool))] for v, s in zip(self.views, sights, strict=True)
        ]
        nobodys = [np.full(view.shape, -1, np.int64) for view in self.views]
        own = Assignment(np.array(best, np.int64).reshape(len(self.views), len(pool)), nobodys)
        places = refine(pool, self.views, sights, own, prior, walker)
        sizes = measure(places, pool.width, self.views, sights, own, self.config)
        sized = prior.known_sizes(sizes, walker)
        known, alone = prior.known(pool), self.config.person + prior.tall(pool.height)
        before = np.array(
            [p + (known[j, k] if k >= 0 else 0.0) for j, (p, k) in enumerate(zip(alone, walker, strict=True))]
        )
        ones = np.ones_like(parts)
        people = People(
            places.ground, sized.height, sized.width, places.covariance, parts.sum(0) + before, parts, ones, before,
            walker, sizes,
        )  # fmt: skip
        owner = tuple(np.full(view.shape, -1, np.int16) for view in self.views)
        boxes = tuple(np.full(len(sight.edges) if sight else 0, -1, np.int64) for sight in sights)
        return Explanation(
            people,
            _none_of(people),
            owner,
            tuple(view.step for view in self.views),
            boxes,
            np.full(len(self.views), np.nan),
        )

    def _candidates(self, sights: Sequence[ViewObservation | None], prior: Prior) -> tuple[Candidates, Floats]:
        """Candidates worth a person, and what each view says of them, nats, float64 (view, n)."""
        heights, (rows, columns) = np.asarray(self.config.heights), self.lattice_ground.shape[:2]
        said = np.zeros((len(self.views), len(heights), rows * columns))
        for view, sight, part in zip(self.views, sights, said, strict=True):
            if sight is not None:
                shape = len(sight.edges) if isinstance(view, BoxView) else view.shape
                part[:] = view.lattice_score(sight, np.ones(shape, bool))
        score = said.sum(0) + prior.tall(heights)[:, None] + self.config.person
        found = peaks(score.reshape(-1, rows, columns), self.lattice_ground, heights, self.config.width_mean)
        kept: list[int] = []
        for i, away in enumerate(distances(found.ground, found.ground)):
            if not (away[kept] < MERGED).any():
                kept.append(i)
        pool = found.at(kept)
        flat = self.lattice_ground.reshape(-1, 2)
        cell = distances(pool.ground, flat).argmin(1) if len(pool) else np.zeros(0, np.int64)
        return pool, said[:, heights.searchsorted(pool.height), cell]


def _walkers(pool: Candidates, prior: Prior) -> Ints:
    """Which walker each candidate is, one to one, int64 (n,), -1 for newcomers."""
    walker = np.full(len(pool), -1, np.int64)
    rows, columns = assign(-(prior.known(pool) + prior.newcomer(pool.ground)[:, None]), 0.0)
    walker[rows] = columns
    return walker


def _box_of(view: BoxView | PixelView, sight: ViewObservation | None, candidate: Candidates) -> int:
    """The best box, -1 for none; of pixels every one."""
    if isinstance(view, PixelView) or sight is None or not len(sight.edges):
        return -1
    body = view.table.boxes_of(candidate.ground, candidate.height)
    middle = (sight.edges[:, 0] + sight.edges[:, 2]) / 2, sight.edges[:, 1]
    off = np.hypot(middle[0] - (body[0, 0] + body[0, 2]) / 2, middle[1] - body[0, 1])
    tall = body[0, 3] - body[0, 1]
    return int(np.argmin(off)) if off.min() < 0.2 * tall else -1


def _none_of(people: People) -> People:
    """Nobody."""
    none = np.zeros(0, np.int64)
    return People(
        people.ground[none], people.height[none], people.width[none], people.covariance[none], people.evidence[none],
        people.parts[:, none], people.visible[:, none], people.prior[none], people.walker[none], people.sizes.at(none),
    )  # fmt: skip
