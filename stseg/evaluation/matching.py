"""Assignment of people to tracks in one frame."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Floats, Ints

_PAIR = 1e3  # reward of a pair, metres: more than the distances of a whole frame
_CONTINUATION_REWARD = 1e6  # reward of a continued pair, metres: more than all pairs of a frame


def distances(person_ground: Floats, track_ground: Floats) -> Floats:
    """Metres between every person (n, 2) and every track (m, 2), float64 (n, m)."""
    distance_of_frames = person_ground[:, None] - track_ground[None]
    return np.hypot(distance_of_frames[..., 0], distance_of_frames[..., 1])


def similarity(distance: Floats, radius: float) -> Floats:
    """1 for the same place, falling to 0 at `radius` metres and beyond; the shape of `distance`."""
    return np.maximum(0.0, 1.0 - distance / radius)


def match(distance: Floats, gate: float, kept: Flags | None = None) -> tuple[Ints, Ints]:
    """Assign people to tracks.

    Maximises the number of continued pairs, then the number of pairs, then minimises the sum of distances.

    Parameters
    ----------
    distance : float64 (n, m)
        Metres between person and track.
    gate
        Metres; no pair is farther apart.
    kept : bool (n, m), optional
        Pairs that continue while they are within the gate, at most one a row and column.

    Returns
    -------
    int64 (k,), int64 (k,)
        Rows and columns of the pairs, rows ascending.
    """
    within_gate = distance <= gate
    gain = np.where(within_gate, _PAIR + gate - distance, 0.0)
    if kept is not None:
        gain += np.where(within_gate & kept, _CONTINUATION_REWARD, 0.0)
    rows, columns = linear_sum_assignment(-gain)
    paired = within_gate[rows, columns]
    return np.asarray(rows[paired], np.int64), np.asarray(columns[paired], np.int64)
