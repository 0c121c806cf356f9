"""Frames between key frames: known people who stand apart and move as expected are followed without a search.

In a key frame the whole ground is searched: births, merges, ghosts and sizes. The frames between need it only where
something may be decided otherwise. The best set of the predicted tracks alone is the answer if

- every member continues a track, and the score would lose at least `_SURE` nats without it,
- nobody else, of the other tracks or of the lattice by what the members leave unexplained, comes nearer than `_SURE`
  nats to being worth a member, a candidate of the lattice being worth up to `_COARSE` more than it shows,
- no two members are so near that they touch, their places being uncertain by `_EXPECTED`,
- and every member stands within `_EXPECTED` of its track's prediction.

Somebody whose track is predicted beyond the border is found by the lattice alone. So where the lattice shows somebody,
its candidates join the tracks, and the best set of both is the answer if all this is true of it.

Otherwise the frame is searched as a whole. The rule reads the frame's number, its evidence and its prediction alone, so
it does not depend on who works on the frame.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats
from stseg.config import DetectionConfig
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.result import explanation_by
from stseg.detection.search.map_estimate import MapEstimate
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation

_SURE = 3.0
"""Least difference of score between a decision and its opposite, nats: 20 to 1."""
_COARSE = 3.0
"""Most that a candidate gains where its place and size are fitted to its pixels, nats: those of spoiled silhouettes."""
_EXPECTED = 0.10
"""Greatest distance of a person from the prediction, metres: the resolution of places in one frame."""
_SETTLED = 0.02
"""Greatest step of a place that is not followed by another, metres: a quarter of the spacing of its patch."""
_STEPS = 3
"""Most steps of a place."""


def key_frame_interval(frame_rate: float, config: DetectionConfig) -> int:
    """Frames from one key frame to the next: those whose numbers it divides are key frames."""
    return max(int(config.key_frame_interval * frame_rate), 1)


def followed(tracked: MapEstimate, lattice_ground: Floats) -> Explanation | None:
    """The explanation of a frame by the best set of its predicted tracks; None where it is to be searched as a whole.

    Parameters
    ----------
    tracked
        That set, found among the predicted tracks alone.
    lattice_ground : float64 (y, x, 2)
        The birth lattice, metres.
    """
    if not (_stand_apart(tracked) and _is_decided(tracked)):
        return None
    if len(fresh := _shown_anew(tracked, lattice_ground)):
        tracked = tracked.searched_with(fresh, tracked.members)
        if not (_stand_apart(tracked) and _is_decided(tracked)) or len(_shown_anew(tracked, lattice_ground)):
            return None
    start = before = tracked.evidence.prior.expected(tracked.track_index)
    for _ in range(_STEPS):
        people = tracked.followed(start)
        if _farthest(before, people.pool) > _EXPECTED:
            return None
        if _farthest(start, people.pool) <= _SETTLED:
            return explanation_by(tracked, people)
        start = people.pool
    return None


def _farthest(before: Candidates, after: Candidates) -> float:
    """How far the candidate moved who moved most, metres."""
    return float(np.hypot(*(after.ground - before.ground).T).max(initial=0.0))


def _stand_apart(tracked: MapEstimate) -> bool:
    """Whether no two members touch, or nearly."""
    ground = tracked.pool.ground[tracked.members]
    apart = np.hypot(*(ground[:, None] - ground).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return bool((apart >= tracked.evidence.parameters.minimum_distance + _EXPECTED).all())


def _is_decided(tracked: MapEstimate) -> bool:
    """Whether all members continue tracks, and no track is nearly accepted or nearly rejected."""
    return bool(
        (tracked.track_index >= 0).all()
        and (tracked.losses >= _SURE).all()
        and (tracked.other_additions.gain <= -_SURE).all()
    )


def _shown_anew(tracked: MapEstimate, lattice_ground: Floats) -> Candidates:
    """Candidates of the lattice that are nearly worth a member beside the set."""
    fresh = _outside_core(lattice_candidates(tracked, lattice_ground), tracked)
    if not len(fresh):
        return fresh
    known = len(tracked.pool)
    together = tracked.with_more(fresh)
    gain = together.additions(np.arange(known, len(together.pool))).gain
    return fresh.at(np.flatnonzero(gain > -_SURE - _COARSE))


def _outside_core(fresh: Candidates, tracked: MapEstimate) -> Candidates:
    """Candidates outside the hard cores of all members: rims of people leave some within them in most frames."""
    ground, core = tracked.pool.ground[tracked.members], tracked.evidence.parameters.hard_core
    away = np.hypot(*(fresh.ground[:, None] - ground).transpose(2, 0, 1)).min(1, initial=np.inf)
    return fresh.at(np.flatnonzero(away >= core))
