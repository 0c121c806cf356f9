"""People who are followed without a search: members of whom nothing is open, and a search of the ground beside them.

Their places are found by their own evidence, a few steps from their tracks' predictions. Where the ground about others
is searched, they stand as they are, so the search costs what the others cost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.explanation import explained_by, is_observed
from stseg.detection.search.frame_search import FrameSearch
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.open_ground import OpenGround
from stseg.detection.search.refined_people import RefinedPeople, followed_members, refined_members
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation

DECISION_MARGIN = 3.0
"""Least difference of score between a decision and its opposite, nats: 20 to 1."""
PREDICTION_DISTANCE = 0.13
"""Greatest distance of a person from the prediction, metres: by about as much a body strays from its track."""
_FINAL_STEP = 0.02
"""Greatest step of a place that is not followed by another, metres: a quarter of the spacing of its patch."""
_STEP_LIMIT = 3
"""Steps of a place at most."""
_SEARCH_LIMIT = 2
"""Searches of the open ground at most: the second about those, too, that the first left in doubt."""


class FollowedPeople(NamedTuple):
    """Members of an estimate where their own evidence shows them."""

    member: Ints
    """int64 (n,): which of the members each is, counted from 0."""
    people: RefinedPeople
    """Their places and sizes."""
    track_index: Ints
    """int64 (n,): the predicted track of each."""

    def at(self, chosen: Ints) -> FollowedPeople:
        """The chosen, int64 (k,), in that order."""
        return FollowedPeople(self.member[chosen], self.people.at(chosen), self.track_index[chosen])

    def off(self, ground: OpenGround) -> FollowedPeople:
        """Those who do not stand on an open ground."""
        return self.at(np.flatnonzero(~ground.covers(self.people.pool.ground)))


def followed_people(tracks: MapEstimate, chosen: Ints) -> tuple[FollowedPeople, Flags]:
    """Some members, int64 (n,) counted from 0, and whether each strays from its track, bool (n,).

    A member strays that stands far from its prediction, or would still move after the last step.
    """
    track_index = tracks.track_index[chosen]
    predicted = tracks.evidence.prior.expected(track_index)
    people, order = followed_members(tracks, chosen, predicted), np.arange(len(chosen))
    step = _displacement(predicted, people.pool)
    for _ in range(_STEP_LIMIT - 1):
        moving = np.flatnonzero(step > _FINAL_STEP)
        if not len(moving):
            break
        before, replaced = people.pool.at(moving), order.copy()
        further = followed_members(tracks, chosen[moving], before)
        step[moving], replaced[moving] = _displacement(before, further.pool), len(order) + np.arange(len(moving))
        people = people.joined_with(further).at(replaced)
    strays = (_displacement(predicted, people.pool) > PREDICTION_DISTANCE) | (step > _FINAL_STEP)
    return FollowedPeople(chosen, people, track_index), strays


def searched_beside(
    followed: FollowedPeople, tracks: MapEstimate, births: Candidates, ground: OpenGround, search: FrameSearch
) -> Explanation | None:
    """The explanation by followed people and a search of the open ground; None where that leaves too many in doubt.

    `tracks` is the estimate that has them as members, `births` are candidates that join its own in the search.
    """
    rest = np.delete(np.arange(len(tracks.pool)), tracks.members[followed.member])
    is_open = np.isin(rest, np.delete(tracks.members, followed.member))
    pool, number = followed.people.pool.joined_with(tracks.pool.at(rest)).joined_with(births), len(followed.member)
    start = np.concatenate([np.arange(number), number + np.flatnonzero(is_open)])
    estimate = MapEstimate.of_search(tracks.evidence, pool, start)
    for _ in range(_SEARCH_LIMIT):
        estimate = search.whole(estimate, None, ground)
        member, is_sure = _members_of(followed, estimate)
        if is_sure.all():
            return _explained(estimate, member, followed.people)
        ground = ground.joined_with(followed.people.pool.ground[~is_sure])
        followed = followed.off(ground)
    return None


def _members_of(followed: FollowedPeople, estimate: MapEstimate) -> tuple[Ints, Flags]:
    """The member that each is, int64 (n,), and whether it surely is one, of the same track, bool (n,)."""
    away = distances(followed.people.pool.ground, estimate.pool.ground[estimate.members])
    if not len(estimate.members):
        return np.zeros(len(away), np.int64), np.zeros(len(away), bool)
    member = away.argmin(1)
    is_sure = (away.min(1) == 0) & (estimate.losses[member] >= DECISION_MARGIN)
    return member, is_sure & (estimate.track_index[member] == followed.track_index)


def _explained(estimate: MapEstimate, member: Ints, followed: RefinedPeople) -> Explanation:
    """The explanation by members (n,) who were followed and by the others, refined."""
    others = np.setdiff1d(np.flatnonzero(is_observed(estimate)), member)
    ordered = estimate.with_members(estimate.members[np.concatenate([member, others])])
    found = refined_members(ordered, np.arange(len(member), len(ordered.members)))
    return explained_by(ordered, followed.joined_with(found))


def _displacement(before: Candidates, after: Candidates) -> Floats:
    """Displacement of each candidate, metres, float64 (n,)."""
    return np.asarray(np.hypot(*(after.ground - before.ground).T))
