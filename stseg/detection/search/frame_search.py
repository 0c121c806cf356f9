"""The search of one frame: rounds of candidates from the tracks and the lattice, then the final search.

Candidates come from a ground lattice, scored by the evidence that is not explained yet, so that people behind others
are found once those are. After each round the set is searched again, until a round changes nothing. Before the final
search, rejected candidates that were nearly accepted are fitted to their pixels (docs/how-it-works.md, Detection).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.search.best_set import ENUMERATION_LIMIT
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.merge_moves import merged
from stseg.detection.search.open_ground import EVERYWHERE, OpenGround
from stseg.detection.search.refined_people import moved_members, refined_members
from stseg.detection.search.restarts import restarted, weak_members
from stseg.records.candidates import Candidates

_MINIMUM_FITTED_GAIN = -15.0
"""Gain above which a rejected candidate is fitted to its pixels, nats: what the right place and size may add."""
_MINIMUM_FITTED_EVIDENCE = 2.0
"""Summed evidence of all views above which it is, nats: less is no foreground that is left unexplained."""

_WEAK_REACH = 2.0
"""Distance of a weak member up to which people are searched without tracks, metres."""


@dataclass(frozen=True)
class FrameSearch:
    """The search, for the views of one rig."""

    lattice_ground: Floats
    """float64 (y, x, 2): the birth lattice, metres."""
    has_boxes: bool
    """Whether any view delivers boxes."""
    rounds: int
    """Rounds of candidates, at most."""
    swap_sweeps: int
    """Sweeps of swap moves in the final search, at most."""
    restarts: int
    """Restarts in the final search, at most."""

    @property
    def without_restarts(self) -> FrameSearch:
        """The same search without restarts, for one that begins without weak members, or of an alternative."""
        return replace(self, restarts=0)

    def of_tracks(self, evidence: FrameEvidence) -> MapEstimate:
        """The best set of the predicted tracks alone."""
        tracks = evidence.prior.pool()
        return MapEstimate.of_search(evidence, tracks, np.arange(len(tracks)))

    def whole(
        self, estimate: MapEstimate, proposals: Candidates | None = None, ground: OpenGround = EVERYWHERE
    ) -> MapEstimate:
        """All rounds, from an estimate on; proposals join the lattice in the first one.

        People join, move and leave on open ground alone, by default everywhere.
        """
        is_open = ground.covers(self.lattice_ground.reshape(-1, 2)).reshape(self.lattice_ground.shape[:2])
        for _ in range(self.rounds):
            more = lattice_candidates(estimate, self.lattice_ground, is_open).new_to(estimate.pool)
            if proposals is not None:
                spacing = estimate.evidence.prior.config.lattice_spacing
                more, proposals = more.joined_if_distant(proposals, spacing), None
            open_members = ground.members_of(estimate)
            moved = self._moved(estimate, open_members)
            if not len(more) and not len(moved):
                break
            number, before = len(estimate.pool), estimate.members
            searched = estimate.searched_with(moved.joined_with(more), before)
            estimate = merged(searched, ground)
            if (searched.members < number).all():
                break
            is_unmerged = len(estimate.members) == len(searched.members)
            if is_unmerged and _same_people(estimate.members, before, number, open_members):
                break
        return self._final(estimate, ground)

    def without_tracks(self, untracked: FrameEvidence, estimate: MapEstimate) -> Candidates:
        """The people of a search with the track prior removed (`untracked`), about weak members of an estimate.

        The others stand as they are, if they are the most.
        """
        weak = estimate.pool.ground[estimate.members[weak_members(estimate)]]
        ground = OpenGround(weak, _WEAK_REACH)
        strong = np.delete(estimate.members, ground.members_of(estimate))
        if 2 * len(strong) <= len(estimate.members):
            strong, ground = strong[:0], EVERYWHERE
        start = MapEstimate.of_search(untracked, estimate.pool.at(strong), np.arange(len(strong)))
        result = self.without_restarts.whole(start, None, ground)
        return result.pool.at(result.members)

    def repeated(self, estimate: MapEstimate, start: Candidates) -> MapEstimate:
        """Repeat the search from people of a search without tracks.

        With few views many sets are better than all that exchange one or two members, and tracks lead into one of them.
        """
        evidence = estimate.evidence
        pool = start.joined_with(evidence.prior.pool()).joined_with(estimate.pool.at(estimate.members))
        begun = MapEstimate.of_search(evidence, pool, np.arange(len(start)))
        return self.without_restarts._final(merged(begun), EVERYWHERE)

    def _moved(self, estimate: MapEstimate, chosen: Ints) -> Candidates:
        """Some members, int64 (k,) counted from 0, nearer to where they stand: a step between two searches.

        Where all views show pixels and all members continue tracks, the tracks' heights are good enough for it.
        """
        if self.has_boxes or (estimate.track_index < 0).any():
            return refined_members(estimate, chosen).pool
        return moved_members(estimate, chosen)

    def _final(self, estimate: MapEstimate, ground: OpenGround) -> MapEstimate:
        """The final search: from the refined places, which may show two members to be one, then thoroughly."""
        chosen, number = ground.members_of(estimate), len(estimate.pool)
        refined = self._moved(estimate, chosen)
        start = np.concatenate([np.delete(estimate.members, chosen), np.arange(number, number + len(refined))])
        moved = estimate.searched_with(refined, start)
        moved = restarted(moved, self.lattice_ground, self.restarts)
        rejected = moved.best_rejected()
        rejected = rejected[ground.covers(moved.pool.ground[rejected])]
        pool = moved.pool.at(np.concatenate([moved.members, rejected]))
        if not self.has_boxes:
            pool = pool.joined_with(_fitted(moved, rejected))
        start = np.arange(len(moved.members))
        return merged(MapEstimate.of_search(moved.evidence, pool, start, ENUMERATION_LIMIT, self.swap_sweeps), ground)


def _fitted(estimate: MapEstimate, rejected: Ints) -> Candidates:
    """Rejected candidates that are nearly worth a member, at the places and sizes that their own pixels show.

    The lattice tries few heights and one width of each: a child is worth less than nothing at the size of an adult.
    """
    additions = estimate.additions(rejected)
    evidence = additions.view_evidence.sum(0)
    chosen = rejected[(additions.gain > _MINIMUM_FITTED_GAIN) & (evidence > _MINIMUM_FITTED_EVIDENCE)]
    if not len(chosen):
        return estimate.pool.at(chosen)
    together = estimate.with_members(np.concatenate([estimate.members, chosen]))
    return refined_members(together, np.arange(len(estimate.members), len(together.members))).pool


def _same_people(members: Ints, before: Ints, number: int, chosen: Ints) -> bool:
    """Whether a search among `number` candidates, those that some of `before` moved to, and others kept all people.

    `members` int64 (m,) and `before` (n,) are candidates, `chosen` (k,) counts those of `before` that were moved.
    """
    moved = (members >= number) & (members < number + len(chosen))
    origin = members.copy()
    origin[moved] = before[chosen[members[moved] - number]]
    return np.array_equal(np.sort(origin), np.sort(before))
