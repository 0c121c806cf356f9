"""Who is whom in one frame."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Floats, Ints

_PAIR = 1e3  # metres that a pair is worth: more than the distances of a whole frame
_KEPT = 1e6  # metres that a kept pair is worth: more than all pairs of a frame


def distances(person_ground: Floats, track_ground: Floats) -> Floats:
    """Metres between every person (n, 2) and every track (m, 2), float64 (n, m)."""
    apart = person_ground[:, None] - track_ground[None]
    return np.hypot(apart[..., 0], apart[..., 1])


def similarity(distance: Floats, radius: float) -> Floats:
    """1 for the same place, falling to 0 at `radius` metres and beyond; the shape of `distance`."""
    return np.maximum(0.0, 1.0 - distance / radius)


def match(distance: Floats, gate: float, kept: Flags | None = None) -> tuple[Ints, Ints]:
    """Pair people with tracks.

    As many kept pairs as can be, then as many pairs as can be, then the least sum of distances.

    Parameters
    ----------
    distance : float64 (n, m)
        Metres between person and track.
    gate
        Metres; no pair is farther apart.
    kept : bool (n, m), optional
        Pairs to be kept while they are within the gate. No row and no column holds two.

    Returns
    -------
    int64 (k,), int64 (k,)
        Rows and columns of the pairs, rows ascending.
    """
    near = distance <= gate
    gain = np.where(near, _PAIR + gate - distance, 0.0)
    if kept is not None:
        gain += np.where(near & kept, _KEPT, 0.0)
    rows, columns = linear_sum_assignment(-gain)
    paired = near[rows, columns]
    return np.asarray(rows[paired], np.int64), np.asarray(columns[paired], np.int64)
