"""Two sets of people for one frame: where they differ, and the log-likelihood ratio by the frame without tracks.

Tracks lead the search into the set of people that they predict. A search without tracks may find another set that
explains the frame better. One frame does not decide between them (`stseg.trackers.alternative_tracks` follows both).
"""

import numpy as np
from scipy.sparse.csgraph import connected_components

from stseg.arrays import Ints
from stseg.detection.explanation import explained_frame
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.key_frames import followed_frame
from stseg.detection.search.frame_search import FrameSearch
from stseg.detection.search.map_estimate import MapEstimate
from stseg.geometry.distances import distances, unmatched
from stseg.records.candidates import Candidates
from stseg.records.people import SAME_PLACE, Alternative, Explanation

_GROUP_DISTANCE = 1.0
"""Distance below which differences depend on each other, metres."""
_LEAST_GAIN = 2.0
"""Least gain of an alternative that is worth following, and of each exchange beside its others, nats."""


def followed_alternative(
    search: FrameSearch, followed: FrameEvidence, untracked: FrameEvidence, explanation: Explanation
) -> Alternative:
    """The reading of a frame by alternative tracks, those of the evidence `followed`, beside its explanation."""
    tracks = search.of_tracks(followed)
    other = followed_frame(tracks, search) or explained_frame(search.without_restarts.whole(tracks))
    gain = likelihood_gain(untracked, explanation.people.candidates, other.people.candidates)
    return Alternative(other, gain)


def found_alternative(
    estimate: MapEstimate, untracked: FrameEvidence, explanation: Explanation, people: Candidates
) -> Alternative | None:
    """The reading of a frame by people of a search without tracks; None where the frame does not prefer them.

    The explanation is that of the estimate.
    """
    best = best_alternative(untracked, explanation.people.candidates, people)
    if best is None:
        return None
    return Alternative(explained_frame(MapEstimate.of_members(estimate.evidence, best[0])), best[1])


def likelihood_gain(untracked: FrameEvidence, people: Candidates, alternative: Candidates) -> float | None:
    """Gain of the score if people are exchanged for others, by the frame without tracks, nats; None for the same."""
    estimate, differing = _both(untracked, people, alternative)
    return _gain(estimate, differing) if len(differing) else None


def best_alternative(
    untracked: FrameEvidence, people: Candidates, alternative: Candidates
) -> tuple[Candidates, float] | None:
    """People with the exchanges for which their frame has evidence, and the gain, nats; None for too little.

    Differences of the alternative near each other are one exchange. Exchanges far from each other may need each other:
    with two views a ghost stands where the lines of sight of two people cross. So all are taken together, and each that
    adds too little to the others is left out again.
    """
    estimate, differing = _both(untracked, people, alternative)
    ground = estimate.pool.ground[differing]
    number, group = connected_components(distances(ground, ground) < _GROUP_DISTANCE, directed=False)
    exchanges = [differing[group == k] for k in range(number)]
    gain = _gain(estimate, differing)
    while exchanges:
        fewer = [np.concatenate([differing[:0], *exchanges[:k], *exchanges[k + 1 :]]) for k in range(len(exchanges))]
        gains = [_gain(estimate, exchanged) for exchanged in fewer]
        weakest = int(np.argmax(gains))
        if gains[weakest] <= gain - _LEAST_GAIN:
            break
        gain = gains[weakest]
        del exchanges[weakest]
    if gain <= _LEAST_GAIN:
        return None
    return estimate.pool.at(np.setxor1d(estimate.members, np.concatenate(exchanges))), gain


def _both(untracked: FrameEvidence, people: Candidates, alternative: Candidates) -> tuple[MapEstimate, Ints]:
    """An estimate with the people as members, before those of the alternative alone; candidates of one set (k,)."""
    lost = unmatched(people.ground, alternative.ground, SAME_PLACE)
    more = alternative.at(unmatched(alternative.ground, people.ground, SAME_PLACE))
    estimate = MapEstimate.of_members(untracked, people.joined_with(more))
    differing = np.append(lost, len(people) + np.arange(len(more)))
    return estimate.with_members(np.arange(len(people))), differing


def _gain(estimate: MapEstimate, exchanged: Ints) -> float:
    return estimate.with_members(np.setxor1d(estimate.members, exchanged)).total - estimate.total
