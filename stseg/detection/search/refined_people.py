"""Members of an estimate at the means of their posteriors, by the boxes and pixels that are assigned to each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.bodies.views import BoxView
from stseg.detection.search.body_sizes import body_sizes
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.refine import EvidenceAssignment, refine_places, refine_places_and_heights
from stseg.records.candidates import Candidates
from stseg.records.sizes import Sizes


@dataclass(frozen=True)
class RefinedPeople:
    """People at the means of their posteriors."""

    pool: Candidates
    """Places, heights by this frame alone (a track's height would confirm itself), and widths."""
    covariance: Floats
    """float64 (n, 2, 2): covariance of each place, square metres."""
    sizes: Sizes
    """Size posteriors of this frame alone, under the population prior."""
    track_sizes: Sizes
    """Size posteriors of all frames so far."""

    def at(self, chosen: Ints) -> RefinedPeople:
        """The chosen, int64 (k,), in that order."""
        return RefinedPeople(
            self.pool.at(chosen), self.covariance[chosen], self.sizes.at(chosen), self.track_sizes.at(chosen)
        )

    def joined_with(self, others: RefinedPeople) -> RefinedPeople:
        """These people, then others."""
        return RefinedPeople(
            self.pool.joined_with(others.pool),
            np.concatenate([self.covariance, others.covariance]),
            self.sizes.joined_with(others.sizes),
            self.track_sizes.joined_with(others.track_sizes),
        )


def moved_members(estimate: MapEstimate, chosen: Ints) -> Candidates:
    """Some of the members, int64 (k,) counted from 0, at the means of their places, each at the size that it has."""
    pool = estimate.pool.at(estimate.members[chosen])
    places = refine_places(pool, estimate.evidence, _assignment(estimate, chosen), estimate.track_index[chosen])
    return Candidates(places.ground, pool.height, pool.width)


def refined_members(estimate: MapEstimate, chosen: Ints | None = None) -> RefinedPeople:
    """Some of the members, int64 (k,) counted from 0, by default all, at the means of their posteriors."""
    if chosen is None:
        chosen, track_index, boxes = np.arange(len(estimate.members)), estimate.track_index, estimate.member_boxes
    else:
        track_index, boxes = estimate.assignment_of(estimate.members[chosen])
    assignment = EvidenceAssignment(boxes, estimate.pixel_assignment, chosen)
    return _refined(estimate, estimate.pool.at(estimate.members[chosen]), assignment, track_index)


def followed_members(estimate: MapEstimate, chosen: Ints, start: Candidates) -> RefinedPeople:
    """Some of the members, int64 (k,) counted from 0, at the means of their places, sought about those of `start`.

    Their sizes are those of their tracks where all views show pixels: a size errs alike in frames that follow each
    other, so few of them need to measure it. Boxes show heights and places together.
    """
    evidence, assignment = estimate.evidence, _assignment(estimate, chosen)
    track_index = estimate.track_index[chosen]
    if any(isinstance(view, BoxView) for view in evidence.views):
        return _refined(estimate, start, assignment, track_index)
    places = refine_places(start, evidence, assignment, track_index)
    unmeasured = Sizes.of_population(len(start), evidence.prior.body)
    sizes = evidence.prior.track_sizes(unmeasured, track_index)
    return RefinedPeople(Candidates(places.ground, sizes.height, sizes.width), places.covariance, unmeasured, sizes)


def _assignment(estimate: MapEstimate, chosen: Ints) -> EvidenceAssignment:
    return EvidenceAssignment(estimate.member_boxes[:, chosen], estimate.pixel_assignment, chosen)


def _refined(
    estimate: MapEstimate, start: Candidates, assignment: EvidenceAssignment, track_index: Ints
) -> RefinedPeople:
    """People at the means of their posteriors, sought about where they start, by the evidence assigned to each."""
    evidence, prior = estimate.evidence, estimate.evidence.prior
    places = refine_places_and_heights(start, evidence, assignment, track_index)
    sizes = body_sizes(places, start.width, evidence.views, evidence.observations, assignment, prior.body)
    track_sizes = prior.track_sizes(sizes, track_index)
    pool = Candidates(places.ground, sizes.height, track_sizes.width)
    return RefinedPeople(pool, places.covariance, sizes, track_sizes)
