"""MAP estimate of one frame: candidates, and the subset of them that explains all views best.

The estimate is a frozen record of one search (`search`): members, score, what each view says of each
member, and the assignment of boxes and pixels. A further round makes a further estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stseg.arrays import Floats, Ints, Shorts, Singles
from stseg.bodies.views import BoxView, PixelView, ViewObservation
from stseg.detection.evidence.blob_scale import blob_scales
from stseg.detection.evidence.box_lattice import BoxLattice
from stseg.detection.evidence.evidence import ProjectedBodies, box_evidence, pixel_evidence, stacked_rasters
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.prior import Prior
from stseg.detection.problem import Parameters, Problem
from stseg.detection.score.additions import fill_additions
from stseg.detection.score.assignment import Assignment
from stseg.detection.score.set_scores import fill_assignments, fill_set_scores
from stseg.detection.search.body_size import measure
from stseg.detection.search.refine import refine, refine_places
from stseg.detection.search.search import search
from stseg.kernels.accelerate import kernel
from stseg.records.candidates import Candidates
from stseg.records.sizes import Sizes


@dataclass(frozen=True)
class FrameEvidence:
    """What stays the same in all rounds of a frame: views, their observations (None where blind), and the prior.

    `lattice` has the birth lattice's pillars in the views that deliver pixels.
    """

    views: Sequence[BoxView | PixelView]
    observations: Sequence[ViewObservation | None]
    prior: Prior
    parameters: Parameters
    lattice: PixelLattice

    @cached_property
    def extremes(self) -> Floats:
        """The lowest and the highest log-odds of each view that delivers pixels, 0 where it is blind: (view, 2)."""
        pairs = zip(self.views, self.observations, strict=True)
        own = [seen.extremes if seen else (0.0, 0.0) for view, seen in pairs if isinstance(view, PixelView)]
        return np.array(own).reshape(-1, 2)

    @cached_property
    def rasters(self) -> Singles:
        """`stacked_rasters` of the views' log-odds."""
        return stacked_rasters(self.views, [None if seen is None else seen.raster for seen in self.observations])

    @cached_property
    def assigned(self) -> Ints:
        """Scratch of scores; see `Problem`."""
        boxes = max((len(seen.edges) for seen in self.observations if seen), default=0)
        return np.empty(max(self.rasters[:1].size, boxes, len(self.prior.predicted), 1), np.int64)

    @cached_property
    def box_lattices(self) -> list[BoxLattice | None]:
        """The lattice of each view that delivers boxes beside those of the frame; None where there are none."""
        return [
            BoxLattice(view, seen) if isinstance(view, BoxView) and seen is not None else None
            for view, seen in zip(self.views, self.observations, strict=True)
        ]

    @cached_property
    def patch_scores(self) -> dict[bytes, Floats]:
        """What `stseg.detection.search.refine` has found of places and their boxes in this frame."""
        return {}

    @cached_property
    def scales(self) -> Singles:
        """Scales of their pixels (`stseg.detection.evidence.blob_scale`)."""
        return blob_scales(self.rasters, self.extremes, self.lattice, self.prior.config, self.prior.body)


@dataclass(frozen=True)
class RefinedPeople:
    """The members of an estimate at the means of their posteriors.

    Attributes
    ----------
    pool
        Places, heights by this frame alone (a known height would confirm itself), and widths.
    covariance : float64 (n, 2, 2)
        Of each place, square metres.
    sizes
        Size posteriors of this frame alone, under the population prior.
    known
        Size posteriors of all frames so far.
    """

    pool: Candidates
    covariance: Floats
    sizes: Sizes
    known: Sizes


@dataclass(frozen=True)
class SetScore:
    """Score of a set of candidates.

    Attributes
    ----------
    total
        Nats.
    view_evidence : float64 (view, member)
        What each view says of each member, nats.
    track_index : int64 (member,)
        The predicted track that each member continues, -1 for births.
    """

    total: float
    view_evidence: Floats
    track_index: Ints


@dataclass(frozen=True)
class Additions:
    """Candidates outside a set, each as a further member.

    Attributes
    ----------
    gain : float64 (m,)
        Change of the score, nats.
    view_evidence : float64 (view, m)
        What each view says of the candidate, nats.
    track_index : int64 (m,)
        The predicted track that it would continue, -1 for births.
    """

    gain: Floats
    view_evidence: Floats
    track_index: Ints


@dataclass(frozen=True)
class MapEstimate:
    """Candidates, and the best set of them that a search found.

    Attributes
    ----------
    evidence
        What the frame is judged by.
    pool
        The candidates.
    bodies
        The same in the views that deliver boxes.
    problem
        The same as arrays, for the kernels.
    members : int64 (n,)
        The chosen candidates.
    """

    evidence: FrameEvidence
    pool: Candidates
    bodies: ProjectedBodies
    problem: Problem
    members: Ints

    @classmethod
    def of_search(
        cls, evidence: FrameEvidence, pool: Candidates, start: Ints, enumerated: int = 0, swap_rounds: int = 0
    ) -> MapEstimate:
        """Search the best set among `pool`, from the candidates `start` int64 (n,) on.

        `enumerated` and `swap_rounds` are the effort, see `stseg.detection.search.search`.
        """
        bodies = ProjectedBodies.of(evidence.views, pool)
        unsearched = cls(evidence, pool, bodies, _problem(evidence, pool, bodies, None), start)
        return unsearched._searched(enumerated, swap_rounds)

    def _searched(self, enumerated: int = 0, swap_rounds: int = 0) -> MapEstimate:
        """The best set among the same candidates, from the members on."""
        scratch, count = np.zeros(len(self.pool) + 1, np.int64), len(self.members)
        scratch[:count] = self.members
        count = search(scratch, count, self.problem, enumerated, swap_rounds)
        return self.with_members(scratch[:count].copy())

    def with_members(self, members: Ints) -> MapEstimate:
        """The same candidates with other members, int64 (n,)."""
        return MapEstimate(self.evidence, self.pool, self.bodies, self.problem, members)

    def with_more(self, more: Candidates) -> MapEstimate:
        """The same members among more candidates, which come after those of this estimate."""
        evidence, pool = self.evidence, self.pool.joined_with(more)
        bodies = self.bodies.joined_with(ProjectedBodies.of(evidence.views, more))
        problem = _problem(evidence, pool, bodies, self.problem)
        return MapEstimate(evidence, pool, bodies, problem, self.members)

    def searched_with(self, more: Candidates, start: Ints) -> MapEstimate:
        """Search the best set among more candidates, from the candidates `start` int64 (n,) on."""
        return self.with_more(more).with_members(start)._searched()

    def score(self, members: Ints) -> SetScore:
        """Score of any set of the candidates, int64 (n,)."""
        totals, view_evidence, tracks = self._scores(members[None])
        return SetScore(float(totals[0]), view_evidence[0], tracks[0])

    def _scores(self, sets: Ints) -> tuple[Floats, Floats, Ints]:
        """What `SetScore` has, of sets (set, member) of candidates, with the set before the other axes."""
        number, count = sets.shape
        totals, tracks = np.empty(number), np.empty((number, count), np.int64)
        view_evidence = np.empty((number, len(self.evidence.views), count))
        fill_set_scores(sets, self.problem, totals, view_evidence, tracks)
        return totals, view_evidence[:, self._row], tracks

    @cached_property
    def members_score(self) -> SetScore:
        """Score of the members."""
        return self.score(self.members)

    @cached_property
    def _row(self) -> Ints:
        """Row of each view of the rig in the problem's `view_evidence`, which has the views with boxes first."""
        pixels_last = np.argsort([isinstance(view, PixelView) for view in self.evidence.views], kind="stable")
        return np.argsort(pixels_last)

    def additions(self, others: Ints) -> Additions:
        """What each of some candidates outside the set, int64 (m,), would add to it."""
        totals, tracks = np.empty(len(others)), np.empty(len(others), np.int64)
        view_evidence = np.empty((len(others), len(self.evidence.views)))
        fill_additions(self.members, others, self.problem, totals, view_evidence, tracks)
        return Additions(totals - self.members_score.total, view_evidence[:, self._row].T, tracks)

    @cached_property
    def others(self) -> Ints:
        """The candidates outside the set, int64 (m,), rising."""
        outside = np.ones(len(self.pool), bool)
        outside[self.members] = False
        return np.flatnonzero(outside)

    @cached_property
    def other_additions(self) -> Additions:
        """What each of the candidates outside the set would add to it."""
        return self.additions(self.others)

    @cached_property
    def losses(self) -> Floats:
        """What the score loses without each member, nats, float64 (n,)."""
        count = len(self.members)
        others = np.tile(self.members, (count, 1))[~np.eye(count, dtype=bool)].reshape(count, max(count - 1, 0))
        return self.members_score.total - self._scores(others)[0]

    def alternatives(self) -> Ints:
        """Candidates outside the set, the best of each place, best first: int64 (n,)."""
        apart = 2 * self.evidence.prior.config.lattice_spacing
        others = self.others
        gain = self.other_additions.gain
        order, count = others[np.argsort(-gain, kind="stable")], len(self.members)
        standing = np.concatenate([self.members, np.empty(len(others), np.int64)])
        number = _keep_apart(self.pool.ground, order, apart, standing, count)
        return standing[count:number]

    @cached_property
    def box_assignment(self) -> list[Ints]:
        """For each view the member whom each box is assigned to, int64 (box,); -1 for none."""
        rows = iter(self._assignments[0])
        pairs = zip(self.evidence.views, self.evidence.observations, strict=True)
        return [
            next(rows)[: len(seen.edges) if seen else 0] if isinstance(view, BoxView) else np.zeros(0, np.int64)
            for view, seen in pairs
        ]

    @cached_property
    def pixel_assignment(self) -> list[Shorts]:
        """For each view the member whom each raster pixel is assigned to, int16 (v, u); -1 for none."""
        assigned, start = [], 0
        for view in self.evidence.views:
            if isinstance(view, PixelView):
                stop = start + view.shape[0] * view.shape[1]
                assigned.append(self.owners[start:stop].reshape(view.shape))
                start = stop
            else:
                assigned.append(np.full(view.shape, -1, np.int16))
        return assigned

    @property
    def owners(self) -> Shorts:
        """The member whom each raster pixel is assigned to, of all views with pixels one after the other: (pixel,)."""
        return self._assignments[1]

    @cached_property
    def _assignments(self) -> tuple[Ints, Shorts]:
        """Boxes and pixels of all views that have such."""
        shapes = self.evidence.lattice.shapes
        boxes = np.empty(self.problem.boxes.match.shape[::2], np.int64)
        owners = np.empty(int(shapes.prod(1).sum()), np.int16)
        fill_assignments(self.members, self.problem, shapes, boxes, owners)
        return boxes, owners

    @property
    def track_index(self) -> Ints:
        """The predicted track that each member continues, int64 (member,); -1 for births."""
        return self.members_score.track_index

    def moved(self) -> Candidates:
        """The members at the means of their places, each at the size that it has."""
        evidence, pool = self.evidence, self.pool.at(self.members)
        own = Assignment.of_all(self._box_of_each(), self.pixel_assignment)
        places = refine_places(pool, evidence.views, evidence.observations, own, evidence.prior, self.track_index)
        return Candidates(places.ground, pool.height, pool.width)

    def followed(self, start: Candidates) -> RefinedPeople:
        """The members at the means of their places, which are sought about those of `start`, one for each member.

        Their sizes are those of their tracks where all views show pixels: a size errs alike in frames that follow each
        other, so few of them need to measure it. Boxes show heights and places together.
        """
        evidence, own = self.evidence, Assignment.of_all(self._box_of_each(), self.pixel_assignment)
        if any(isinstance(view, BoxView) for view in evidence.views):
            return self._refined(start, own, self.track_index)
        places = refine_places(start, evidence.views, evidence.observations, own, evidence.prior, self.track_index)
        unmeasured = Sizes.of_population(len(start), evidence.prior.body)
        known = evidence.prior.known_sizes(unmeasured, self.track_index)
        sized = Candidates(places.ground, known.height, known.width)
        return RefinedPeople(sized, places.covariance, unmeasured, known)

    def refined(self) -> RefinedPeople:
        """The members at the means of their posteriors."""
        return self.some_refined(np.arange(len(self.members)))

    def some_refined(self, chosen: Ints) -> RefinedPeople:
        """Some of the members, int64 (k,) counted from 0, at the means of their posteriors."""
        own = Assignment.of_all(self._box_of_each(), self.pixel_assignment).of(chosen)
        return self._refined(self.pool.at(self.members[chosen]), own, self.track_index[chosen])

    def _refined(self, start: Candidates, own: Assignment, track_index: Ints) -> RefinedPeople:
        """People at the means of their posteriors, sought about where they start, by what is assigned to each."""
        views, observations, prior = self.evidence.views, self.evidence.observations, self.evidence.prior
        places = refine(start, views, observations, own, prior, track_index, self.evidence.patch_scores)
        sizes = measure(places, start.width, views, observations, own, prior.body)
        known = prior.known_sizes(sizes, track_index)
        return RefinedPeople(Candidates(places.ground, sizes.height, known.width), places.covariance, sizes, known)

    def _box_of_each(self) -> Ints:
        """The box of each member in each view, int64 (view, member), -1 for none."""
        box = np.full((len(self.evidence.views), len(self.members)), -1, np.int64)
        if not len(self.problem.boxes.boxes):
            return box
        for row, assigned in zip(box, self.box_assignment, strict=True):
            taken = np.flatnonzero(assigned >= 0)
            row[assigned[taken]] = taken
        return box


@kernel
def _keep_apart(ground: Floats, order: Ints, apart: float, standing: Ints, count: int) -> int:
    """Add to the first `count` of standing (n,) the candidates of an order that stand apart from all before, metres."""
    for i in order:
        near = False
        for k in range(count):
            x, y = ground[standing[k], 0] - ground[i, 0], ground[standing[k], 1] - ground[i, 1]
            near = near or np.hypot(x, y) < apart
        if not near:
            standing[count] = i
            count += 1
    return count


def _problem(evidence: FrameEvidence, pool: Candidates, bodies: ProjectedBodies, known: Problem | None) -> Problem:
    """All that is known of the candidates, as the search kernels read it; `known` is that of the first ones."""
    views, observations, prior = evidence.views, evidence.observations, evidence.prior
    shown = any(isinstance(view, PixelView) for view in views)  # boxes show no widths
    more = pool if known is None else pool.after(len(known.ground))
    boxes = box_evidence(views, observations, bodies, None if known is None else known.boxes)
    pixels = pixel_evidence(views, evidence.rasters, evidence.scales, more)
    size_prior = prior.log_size(more.height, more.width) if shown else prior.log_height(more.height)
    birth_cost, track_gain = prior.birth_cost(more.ground), prior.track_log_ratio(more)
    common = evidence.parameters.common_width
    breadth = np.maximum(more.width / common, 1.0) if shown else np.ones(len(more))
    if known is not None:
        pixels = known.pixels.joined_with(pixels)
        size_prior = np.concatenate([known.size_prior, size_prior])
        birth_cost = np.concatenate([known.birth_cost, birth_cost])
        track_gain = np.concatenate([known.track_gain, track_gain])
        breadth = np.concatenate([known.breadth, breadth])
    return Problem(
        boxes=boxes,
        pixels=pixels,
        size_prior=size_prior,
        birth_cost=birth_cost,
        track_gain=track_gain,
        ground=pool.ground,
        breadth=breadth,
        parameters=evidence.parameters,
        assigned=evidence.assigned,
        owner=evidence.lattice.nobody,
        view_evidence=np.zeros((len(views), len(pool) + 1)),
    )
