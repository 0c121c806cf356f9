"""The search of one frame: rounds of candidates from the tracks and the lattice, then the final search.

Candidates come from a ground lattice, scored by the evidence that is not explained yet, so that people behind others
are found once those are. After each round the set is searched again, until a round changes nothing. Before the final
search, rejected candidates that were nearly accepted are fitted to their pixels (docs/how-it-works.md, Detection).
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.search.best_set import ENUMERATION_LIMIT
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.merge_moves import merged
from stseg.detection.search.refined_people import moved_members, refined_members
from stseg.detection.search.restarts import restarted
from stseg.records.candidates import Candidates

_MINIMUM_FITTED_GAIN = -15.0
"""Gain above which a rejected candidate is fitted to its pixels, nats: what the right place and size may add."""
_MINIMUM_FITTED_EVIDENCE = 2.0
"""Summed evidence of all views above which it is, nats: less is no foreground that is left unexplained."""


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

    def of_tracks(self, evidence: FrameEvidence) -> MapEstimate:
        """The best set of the predicted tracks alone."""
        tracks = evidence.prior.pool()
        return MapEstimate.of_search(evidence, tracks, np.arange(len(tracks)))

    def whole(self, estimate: MapEstimate, proposals: Candidates | None = None) -> MapEstimate:
        """The whole search, from the predicted tracks on; proposals join the lattice in the first round."""
        for _ in range(self.rounds):
            more = lattice_candidates(estimate, self.lattice_ground).new_to(estimate.pool)
            if proposals is not None:
                spacing = estimate.evidence.prior.config.lattice_spacing
                more, proposals = more.joined_if_distant(proposals, spacing), None
            moved = self._moved(estimate)
            if not len(more) and not len(moved):
                break
            number, before = len(estimate.pool), estimate.members
            searched = estimate.searched_with(moved.joined_with(more), before)
            estimate = merged(searched)
            if (searched.members < number).all():
                break
            is_unmerged = len(estimate.members) == len(searched.members)
            if is_unmerged and not self.has_boxes and _same_people(estimate.members, before, number):
                break
        return self._final(estimate)

    def without_tracks(self, untracked: FrameEvidence) -> Candidates:
        """The people of a search with the track prior removed (`untracked`)."""
        result = self.whole(self.of_tracks(untracked))
        return result.pool.at(result.members)

    def repeated(self, estimate: MapEstimate, start: Candidates) -> MapEstimate:
        """Repeat the search from people of a search without tracks.

        With few views many sets are better than all that exchange one or two members, and tracks lead into one of them.
        """
        evidence = estimate.evidence
        pool = start.joined_with(evidence.prior.pool()).joined_with(estimate.pool.at(estimate.members))
        return self._final(merged(MapEstimate.of_search(evidence, pool, np.arange(len(start)))))

    def _moved(self, estimate: MapEstimate) -> Candidates:
        """The members nearer to where they stand: a step between two searches.

        Where all views show pixels and all members continue tracks, the tracks' heights are good enough for it.
        """
        if self.has_boxes or (estimate.track_index < 0).any():
            return refined_members(estimate).pool
        return moved_members(estimate)

    def _final(self, estimate: MapEstimate) -> MapEstimate:
        """The final search: from the refined places, which may show two members to be one, then thoroughly."""
        refined, number = self._moved(estimate), len(estimate.pool)
        moved = estimate.searched_with(refined, np.arange(number, number + len(refined)))
        if self.has_boxes:
            moved = restarted(moved, self.lattice_ground)
        rejected = moved.best_rejected()
        pool = moved.pool.at(np.concatenate([moved.members, rejected]))
        if not self.has_boxes:
            pool = pool.joined_with(_fitted(moved, rejected))
        start = np.arange(len(moved.members))
        return merged(MapEstimate.of_search(moved.evidence, pool, start, ENUMERATION_LIMIT, self.swap_sweeps))


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


def _same_people(members: Ints, before: Ints, number: int) -> bool:
    """Whether a search among `number` candidates, those that `before` moved to, and others kept just these people."""
    moved = (members >= number) & (members < number + len(before))
    origin = members.copy()
    origin[moved] = before[members[moved] - number]
    return np.array_equal(np.sort(origin), np.sort(before))
