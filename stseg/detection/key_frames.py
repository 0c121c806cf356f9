"""Frames between key frames: people of whom nothing is open are followed, and only the ground about others is searched.

In a key frame, and in the first frames of a session, the whole ground is searched: births, merges, ghosts and sizes.
The frames between need it only where something may be decided otherwise than by the best set of the predicted tracks
alone. Open are the places

- of members that continue no track, and of those without which the score would lose less than `DECISION_MARGIN` nats,
- of further candidates, of the other tracks or of the lattice by the evidence that the members leave unexplained, that
  come nearer than `DECISION_MARGIN` nats to being worth a member, a candidate of the lattice being worth up to
  `_FITTING_GAIN` more than it shows,
- of members that touch, or nearly, their places being uncertain by `PREDICTION_DISTANCE`,
- and of members that stand farther than `PREDICTION_DISTANCE` from their track's prediction.

Members far from all of these are followed: each stands where its own evidence shows it. If nothing is open, they are
the answer. If they are the majority, the open ground is searched beside them, and that is the answer if each of them is
worth `DECISION_MARGIN` nats after it. Otherwise the frame is searched as a whole. The rule reads the frame's number,
its evidence and its session alone, so it does not depend on the process that works on the frame.
"""

import numpy as np

from stseg.arrays import Floats
from stseg.config import DetectionConfig
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.explanation import explained_by
from stseg.detection.followed_people import DECISION_MARGIN, PREDICTION_DISTANCE, followed_people, searched_beside
from stseg.detection.search.frame_search import FrameSearch
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.open_ground import OpenGround
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation

_BOX_INTERVAL = 0.2
"""Greatest interval of key frames by boxes, seconds: people who are followed may exchange single boxes meanwhile."""
_FITTING_GAIN = 3.0
"""Most that a candidate gains where its place and size are fitted to its pixels, nats: those of spoiled silhouettes."""


def key_frame_interval(frame_rate: float, config: DetectionConfig, has_boxes: bool) -> int:
    """Frames from one key frame to the next; it divides the numbers of key frames."""
    seconds = min(config.key_frame_interval, _BOX_INTERVAL) if has_boxes else config.key_frame_interval
    return max(int(seconds * frame_rate), 1)


def followed_frame(tracks: MapEstimate, search: FrameSearch) -> Explanation | None:
    """The explanation of a frame by its predicted tracks; None where it is to be searched as a whole.

    `tracks` is the best set of the predicted tracks alone.
    """
    ground = OpenGround(_open_places(tracks))
    if not _leaves_most(ground, tracks):
        return None
    births = _possible_births(tracks, search.lattice_ground)
    ground = ground.joined_with(births.ground)
    if not _leaves_most(ground, tracks):
        return None
    followed, strays = followed_people(tracks, np.delete(np.arange(len(tracks.members)), ground.members_of(tracks)))
    ground = ground.joined_with(tracks.pool.ground[tracks.members[followed.member[strays]]])
    if ground.is_empty:
        return explained_by(tracks, followed.people)
    return (
        searched_beside(followed.off(ground), tracks, births, ground, search) if _leaves_most(ground, tracks) else None
    )


def _leaves_most(ground: OpenGround, tracks: MapEstimate) -> bool:
    """Whether nothing is open, or less than half of the members stand on open ground."""
    return ground.is_empty or 2 * len(ground.members_of(tracks)) < len(tracks.members)


def _open_places(tracks: MapEstimate) -> Floats:
    """Places where the tracks alone leave something open, float64 (k, 2), metres.

    They are those of members who touch each other, or nearly, continue no track or are nearly rejected, and those of
    tracks that are nearly accepted.
    """
    ground = tracks.pool.ground[tracks.members]
    distance = distances(ground, ground)
    np.fill_diagonal(distance, np.inf)
    touches = distance.min(1, initial=np.inf) < tracks.evidence.parameters.minimum_distance + PREDICTION_DISTANCE
    is_open = touches | (tracks.track_index < 0) | (tracks.losses < DECISION_MARGIN)
    accepted = tracks.others[tracks.other_additions.gain > -DECISION_MARGIN]
    return np.concatenate([ground[is_open], tracks.pool.ground[accepted]])


def _possible_births(estimate: MapEstimate, lattice_ground: Floats) -> Candidates:
    """Candidates of the lattice that are nearly worth a further member."""
    peaks = _outside_core(lattice_candidates(estimate, lattice_ground), estimate)
    if not len(peaks):
        return peaks
    number = len(estimate.pool)
    together = estimate.with_more(peaks)
    gain = together.additions(np.arange(number, len(together.pool))).gain
    return peaks.at(np.flatnonzero(gain > -DECISION_MARGIN - _FITTING_GAIN))


def _outside_core(peaks: Candidates, estimate: MapEstimate) -> Candidates:
    """Candidates outside the hard cores of all members: edges of silhouettes leave some within them in most frames."""
    ground, core = estimate.pool.ground[estimate.members], estimate.evidence.parameters.hard_core
    distance = distances(peaks.ground, ground).min(1, initial=np.inf)
    return peaks.at(np.flatnonzero(distance >= core))
