"""MAP estimate of one frame: candidates, and the subset of them that explains all views best.

The estimate is a frozen record of one search (`find_best_set`): members, score, the evidence of each view for each
member, and the assignment of boxes and pixels. A further round makes a further estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stseg.arrays import Floats, Ints, Shorts
from stseg.bodies.outlines import paint_outlines
from stseg.bodies.views import BoxView, PixelView
from stseg.detection.evidence.candidate_evidence import ProjectedBodies
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.moves import fill_gains
from stseg.detection.score.scoring import fill_box_assignment, fill_set_score
from stseg.detection.search.best_set import GAIN_LIMIT, find_best_set
from stseg.kernels.accelerate import kernel
from stseg.records.candidates import Candidates


@dataclass(frozen=True)
class SetScore:
    """Score of a set of candidates."""

    total: float
    """Nats."""
    view_evidence: Floats
    """float64 (view, member): evidence of each view for each member, nats."""
    track_index: Ints
    """int64 (member,): the predicted track that each member continues, -1 for births."""


@dataclass(frozen=True)
class Additions:
    """Candidates, each as a further member of a set."""

    gain: Floats
    """float64 (m,): change of the score, nats."""
    view_evidence: Floats
    """float64 (view, m): evidence of each view for the candidate, nats."""
    track_index: Ints
    """int64 (m,): the predicted track that it would continue, -1 for births."""


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
        bodies = ProjectedBodies.of(evidence.views, pool)
        unsearched = cls(evidence, pool, bodies, evidence.problem(pool, bodies, None), start)
        return unsearched._searched(enumeration_limit, swap_sweeps)

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
    def members_score(self) -> SetScore:
        """Score of the members."""
        count = len(self.members)
        view_evidence, tracks = np.empty((len(self.evidence.views), count)), np.empty(count, np.int64)
        total = fill_set_score(self.members, self.problem, view_evidence, tracks)
        return SetScore(total, self._of_views(view_evidence), tracks)

    @property
    def track_index(self) -> Ints:
        """The predicted track that each member continues, int64 (member,); -1 for births."""
        return self.members_score.track_index

    def additions(self, candidates: Ints) -> Additions:
        """Gains of some candidates, int64 (m,), each by itself; of members, what they are worth, and that alone."""
        gains, tracks = np.empty(len(candidates)), np.empty(len(candidates), np.int64)
        view_evidence = np.zeros((len(self.evidence.views), len(candidates)))
        fill_gains(self.members, candidates, self.problem, gains, view_evidence, tracks)
        return Additions(gains, self._of_views(view_evidence), tracks)

    def _of_views(self, view_evidence: Floats) -> Floats:
        """The problem's evidence, which has the views with boxes first, in the order of the views."""
        pixels_last = np.argsort([isinstance(view, PixelView) for view in self.evidence.views], kind="stable")
        return view_evidence[np.argsort(pixels_last)]

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

    @cached_property
    def losses(self) -> Floats:
        """Loss of score without each member, nats, float64 (n,)."""
        return self.additions(self.members).gain

    def alternatives(self) -> Ints:
        """Candidates outside the set, the best of each place, best first: int64 (n,)."""
        distance, count = 2 * self.evidence.prior.config.lattice_spacing, len(self.members)
        order = self.others[np.argsort(-self.other_additions.gain, kind="stable")]
        chosen = np.concatenate([self.members, np.empty(len(order), np.int64)])
        number = _add_separate(self.pool.ground, order, distance, chosen, count)
        return chosen[count:number]

    @cached_property
    def box_assignment(self) -> list[Ints]:
        """For each view the member that each box is assigned to, int64 (box,); -1 for none."""
        boxes = np.empty(self.problem.boxes.match.shape[::2], np.int64)
        fill_box_assignment(self.members, self.problem, boxes)
        rows = iter(boxes)
        return [
            next(rows)[: len(observation.edges) if observation else 0]
            if isinstance(view, BoxView)
            else np.zeros(0, np.int64)
            for view, observation in zip(self.evidence.views, self.evidence.observations, strict=True)
        ]

    @cached_property
    def member_boxes(self) -> Ints:
        """The box of each member in each view, int64 (view, member), -1 for none."""
        box = np.full((len(self.evidence.views), len(self.members)), -1, np.int64)
        if len(self.problem.boxes.boxes):
            for row, member_of in zip(box, self.box_assignment, strict=True):
                assigned = np.flatnonzero(member_of >= 0)
                row[member_of[assigned]] = assigned
        return box

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
