"""MAP estimate of one frame: candidates, and the subset of them that explains all views best.

The estimate is a frozen record of one search (`find_best_set`): members, score, the evidence of each view for each
member, and the assignment of boxes and pixels. A further round makes a further estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Shorts
from stseg.bodies.outlines import paint_outlines
from stseg.bodies.views import BoxView, PixelView
from stseg.detection.evidence.candidate_evidence import ProjectedBodies
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.moves import fill_gains, fill_rises, score_of
from stseg.detection.search.best_set import GAIN_LIMIT, find_best_set
from stseg.kernels.accelerate import kernel
from stseg.records.candidates import Candidates


@dataclass(frozen=True)
class Additions:
    """Candidates, each as a further member of a set; members of it, each beside the others."""

    gain: Floats
    """float64 (m,): change of the score, nats."""
    view_evidence: Floats
    """float64 (view, m): evidence of each view for the candidate, nats."""
    track_index: Ints
    """int64 (m,): the predicted track that it continues, -1 for births."""
    box: Ints
    """int64 (view, m): its box in each view, -1 for none."""


@dataclass(frozen=True)
class MapEstimate:
    """Candidates, and the best set of them that a search found."""

    evidence: FrameEvidence
    """The frame's evidence."""
    pool: Candidates
    """The candidates."""
    bodies: ProjectedBodies
    """The same in the views that deliver boxes."""
    problem: DetectionProblem
    """The same as arrays, for the kernels."""
    members: Ints
    """int64 (n,): the chosen candidates."""
    unfinished: int = 0
    """Candidates of the largest group that was not searched to the end, 0 for none."""

    @classmethod
    def of_search(
        cls, evidence: FrameEvidence, pool: Candidates, start: Ints, enumeration_limit: int = 0, swap_sweeps: int = 0
    ) -> MapEstimate:
        """Search the best set among `pool`, from the candidates `start` int64 (n,) on.

        `enumeration_limit` and `swap_sweeps` are the effort, see `stseg.detection.search.best_set`.
        """
        return cls.of_members(evidence, pool).with_members(start)._searched(enumeration_limit, swap_sweeps)

    @classmethod
    def of_members(cls, evidence: FrameEvidence, pool: Candidates) -> MapEstimate:
        """All of a pool as members, without a search."""
        bodies = ProjectedBodies.of(evidence.views, pool)
        return cls(evidence, pool, bodies, evidence.problem(pool, bodies, None), np.arange(len(pool)))

    def _searched(self, enumeration_limit: int = 0, swap_sweeps: int = 0) -> MapEstimate:
        """The best set among the same candidates, from the members on."""
        members, count = np.zeros(len(self.pool) + 1, np.int64), len(self.members)
        members[:count] = self.members
        count, unfinished = find_best_set(members, count, self.problem, enumeration_limit, swap_sweeps, GAIN_LIMIT)
        return replace(self.with_members(members[:count].copy()), unfinished=unfinished)

    def with_members(self, members: Ints) -> MapEstimate:
        """The same candidates with other members, int64 (n,)."""
        return replace(self, members=members)

    def with_more(self, more: Candidates) -> MapEstimate:
        """The same members among more candidates, which come after those of this estimate."""
        evidence, pool = self.evidence, self.pool.joined_with(more)
        bodies = self.bodies.joined_with(ProjectedBodies.of(evidence.views, more))
        return replace(self, pool=pool, bodies=bodies, problem=evidence.problem(pool, bodies, self.problem))

    def searched_with(self, more: Candidates, start: Ints) -> MapEstimate:
        """Search the best set among more candidates, from the candidates `start` int64 (n,) on."""
        return self.with_more(more).with_members(start)._searched()

    @cached_property
    def total(self) -> float:
        """Score of the members, nats."""
        return score_of(self.members, self.problem)

    @cached_property
    def members_score(self) -> Additions:
        """`additions` of the members."""
        return self.additions(self.members)

    @property
    def track_index(self) -> Ints:
        """The predicted track that each member continues, int64 (member,); -1 for births."""
        return self._assignment[0]

    @property
    def member_boxes(self) -> Ints:
        """The box of each member in each view, int64 (view, member), -1 for none."""
        return self._assignment[1]

    @cached_property
    def _assignment(self) -> tuple[Ints, Ints]:
        known = vars(self).get("members_score")  # has it, too, if it was asked for before
        return self.assignment_of(self.members) if known is None else (known.track_index, known.box)

    def assignment_of(self, candidates: Ints) -> tuple[Ints, Ints]:
        """The track and the boxes of some candidates, as of `additions`: int64 (m,) and (view, m)."""
        found = self._filled(candidates, np.empty(0))
        return found.track_index, found.box

    def additions(self, candidates: Ints) -> Additions:
        """Gains of some candidates, int64 (m,), each by itself; of members, what they are worth."""
        return self._filled(candidates, np.empty(len(candidates)))

    def _filled(self, candidates: Ints, gains: Floats) -> Additions:
        tracks = np.empty(len(candidates), np.int64)
        evidence = np.zeros((len(self.evidence.views), len(candidates)))
        box = np.full(evidence.shape, -1, np.int64)
        fill_gains(self.members, candidates, self.problem, gains, evidence, box, tracks)
        pixels_last = np.argsort([isinstance(view, PixelView) for view in self.evidence.views], kind="stable")
        order = np.argsort(pixels_last)  # the problem has the views with boxes first
        return Additions(gains, evidence[order], tracks, box[order])

    def rises(self, leaving: Flags, joining: Ints) -> Floats:
        """Rise of the score by each exchange, float64 (k,), nats: see `stseg.detection.score.moves`."""
        rises = np.empty(len(joining))
        fill_rises(self.members, leaving, joining, self.problem, rises)
        return rises

    @cached_property
    def others(self) -> Ints:
        """The candidates outside the set, int64 (m,), rising."""
        outside = np.ones(len(self.pool), bool)
        outside[self.members] = False
        return np.flatnonzero(outside)

    @cached_property
    def other_additions(self) -> Additions:
        """`additions` of all candidates outside the set."""
        return self.additions(self.others)

    @property
    def losses(self) -> Floats:
        """Loss of score without each member, nats, float64 (n,)."""
        return self.members_score.gain

    def best_rejected(self) -> Ints:
        """Candidates outside the set, the best of each place, best first: int64 (n,)."""
        distance, count = 2 * self.evidence.prior.config.lattice_spacing, len(self.members)
        order = self.others[np.argsort(-self.other_additions.gain, kind="stable")]
        chosen = np.concatenate([self.members, np.empty(len(order), np.int64)])
        number = _add_separate(self.pool.ground, order, distance, chosen, count)
        return chosen[count:number]

    @cached_property
    def box_assignment(self) -> list[Ints]:
        """For each view the member that each box is assigned to, int64 (box,); -1 for none."""
        pairs = zip(self.evidence.views, self.evidence.observations, strict=True)
        numbers = [len(o.edges) if o and isinstance(view, BoxView) else 0 for view, o in pairs]
        assignment = [np.full(number, -1, np.int64) for number in numbers]
        if not any(numbers):
            return assignment
        for member_of, box in zip(assignment, self.member_boxes, strict=True):
            assigned = np.flatnonzero(box >= 0)
            member_of[box[assigned]] = assigned
        return assignment

    @cached_property
    def pixel_assignment(self) -> list[Shorts]:
        """For each view the nearest member with an outline that covers each raster pixel, int16 (v, u); -1 for none."""
        assignment = [np.full(view.shape, -1, np.int16) for view in self.evidence.views]
        rasters = [a for a, view in zip(assignment, self.evidence.views, strict=True) if isinstance(view, PixelView)]
        pixels = self.problem.pixels
        for k, owner in enumerate(rasters):
            farthest_first = np.argsort(pixels.distance[k][self.members], kind="stable")[::-1].copy()
            paint_outlines(farthest_first, pixels.first[k][self.members], pixels.spans[k][self.members], owner)
        return assignment

    @property
    def owners(self) -> Shorts:
        """The member that each raster pixel is assigned to, of all views with pixels one after the other: (pixel,)."""
        pairs = zip(self.pixel_assignment, self.evidence.views, strict=True)
        rows = [owner.ravel() for owner, view in pairs if isinstance(view, PixelView)]
        return np.concatenate([np.zeros(0, np.int16), *rows])


@kernel
def _add_separate(ground: Floats, order: Ints, distance: float, chosen: Ints, count: int) -> int:
    """Add to the first `count` chosen (n,) the candidates of an order at a distance from all before, metres."""
    for i in order:
        is_close = False
        for k in range(count):
            x, y = ground[chosen[k], 0] - ground[i, 0], ground[chosen[k], 1] - ground[i, 1]
            is_close = is_close or np.hypot(x, y) < distance
        if not is_close:
            chosen[count] = i
            count += 1
    return count
