"""Frames between key frames: tracked people who stand apart and move as predicted are followed without a search.

In a key frame the whole ground is searched: births, merges, ghosts and sizes. The frames between need it only where
something may be decided otherwise. The best set of the predicted tracks alone is the answer if

- every member continues a track, and the score would lose at least `_DECISION_MARGIN` nats without it,
- no further candidate, of the other tracks or of the lattice by the evidence that the members leave unexplained, comes
  nearer than `_DECISION_MARGIN` nats to being worth a member, a candidate of the lattice being worth up to
  `_FITTING_GAIN` more than it shows,
- no two members are so close that they touch, their places being uncertain by `_PREDICTION_DISTANCE`,
- and every member stands within `_PREDICTION_DISTANCE` of its track's prediction.

A person with a track that is predicted outside the border is found by the lattice alone. So where the lattice shows
candidates, they join the tracks, and the best set of both is the answer if it fulfils the same conditions.

Otherwise the frame is searched as a whole. The rule reads the frame's number, its evidence and its prediction alone, so
it does not depend on the process that works on the frame.
"""

import numpy as np

from stseg.arrays import Floats
from stseg.config import DetectionConfig
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.explanation import explained_by
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.refined_people import followed_members
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation

_DECISION_MARGIN = 3.0
"""Least difference of score between a decision and its opposite, nats: 20 to 1."""
_FITTING_GAIN = 3.0
"""Most that a candidate gains where its place and size are fitted to its pixels, nats: those of spoiled silhouettes."""
_PREDICTION_DISTANCE = 0.13
"""Greatest distance of a person from the prediction, metres: by about as much a body strays from its track."""
_FINAL_STEP = 0.02
"""Greatest step of a place that is not followed by another, metres: a quarter of the spacing of its patch."""
_STEP_LIMIT = 3
"""Steps of a place at most."""


def key_frame_interval(frame_rate: float, config: DetectionConfig) -> int:
    """Frames from one key frame to the next; it divides the numbers of key frames."""
    return max(int(config.key_frame_interval * frame_rate), 1)


def followed_frame(tracks: MapEstimate, lattice_ground: Floats) -> Explanation | None:
    """The explanation of a frame by the best set of its predicted tracks; None where it is to be searched as a whole.

    `tracks` is that set, found among the predicted tracks alone; `lattice_ground` float64 (y, x, 2) the birth lattice,
    metres.
    """
    if not (_are_separate(tracks) and _is_decided(tracks)):
        return None
    if len(births := _possible_births(tracks, lattice_ground)):
        tracks = tracks.searched_with(births, tracks.members)
        if not (_are_separate(tracks) and _is_decided(tracks)) or len(_possible_births(tracks, lattice_ground)):
            return None
    start = predicted = tracks.evidence.prior.expected(tracks.track_index)
    for _ in range(_STEP_LIMIT):
        people = followed_members(tracks, start)
        if _largest_displacement(predicted, people.pool) > _PREDICTION_DISTANCE:
            return None
        if _largest_displacement(start, people.pool) <= _FINAL_STEP:
            return explained_by(tracks, people)
        start = people.pool
    return None


def _largest_displacement(before: Candidates, after: Candidates) -> float:
    """Largest displacement of a candidate, metres."""
    return float(np.hypot(*(after.ground - before.ground).T).max(initial=0.0))


def _are_separate(estimate: MapEstimate) -> bool:
    """Whether no two members touch, or nearly."""
    ground = estimate.pool.ground[estimate.members]
    distance = distances(ground, ground)
    np.fill_diagonal(distance, np.inf)
    return bool((distance >= estimate.evidence.parameters.minimum_distance + _PREDICTION_DISTANCE).all())


def _is_decided(estimate: MapEstimate) -> bool:
    """Whether all members continue tracks, and no track is nearly accepted or nearly rejected."""
    return bool(
        (estimate.track_index >= 0).all()
        and (estimate.losses >= _DECISION_MARGIN).all()
        and (estimate.other_additions.gain <= -_DECISION_MARGIN).all()
    )


def _possible_births(estimate: MapEstimate, lattice_ground: Floats) -> Candidates:
    """Candidates of the lattice that are nearly worth a further member."""
    peaks = _outside_core(lattice_candidates(estimate, lattice_ground), estimate)
    if not len(peaks):
        return peaks
    number = len(estimate.pool)
    together = estimate.with_more(peaks)
    gain = together.additions(np.arange(number, len(together.pool))).gain
    return peaks.at(np.flatnonzero(gain > -_DECISION_MARGIN - _FITTING_GAIN))


def _outside_core(peaks: Candidates, estimate: MapEstimate) -> Candidates:
    """Candidates outside the hard cores of all members: edges of silhouettes leave some within them in most frames."""
    ground, core = estimate.pool.ground[estimate.members], estimate.evidence.parameters.hard_core
    distance = distances(peaks.ground, ground).min(1, initial=np.inf)
    return peaks.at(np.flatnonzero(distance >= core))
