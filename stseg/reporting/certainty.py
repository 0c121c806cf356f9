"""Certainty of tracks: probability of their points, and stretches in which it is low."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Rows

DOUBTFUL = 0.9
"""Probability below which a point is doubtful."""


class DoubtfulStretch(NamedTuple):
    """Consecutive points of a track that are doubtful.

    Attributes
    ----------
    track
        Its id.
    first, last
        Frames, both included.
    certainty
        Mean probability of its points, 0..1.
    """

    track: int
    first: int
    last: int
    certainty: float


def mean_certainty(trajectory: Rows, tracks: Rows) -> Floats:
    """Mean probability of the points of each of `tracks`, float64 (n,), 0..1; nan for a track without points."""
    ids, place = np.unique(trajectory["id"], return_inverse=True)
    sums, counts = np.bincount(place, _probability(trajectory), len(ids)), np.bincount(place, minlength=len(ids))
    means = dict(zip(ids.tolist(), (sums / np.maximum(counts, 1)).tolist(), strict=True))
    return np.array([means.get(int(track), np.nan) for track in tracks["id"]])


def doubtful_stretches(trajectory: Rows) -> list[DoubtfulStretch]:
    """Stretches of doubtful points, by track and frame."""
    rows = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    probability = _probability(rows)
    doubtful = np.flatnonzero(probability < DOUBTFUL)
    breaks = (np.diff(rows["id"][doubtful]) != 0) | (np.diff(rows["frame"][doubtful]) > 1)
    pieces = np.split(doubtful, np.flatnonzero(breaks) + 1) if len(doubtful) else []
    return [
        DoubtfulStretch(
            int(rows["id"][piece[0]]),
            int(rows["frame"][piece[0]]),
            int(rows["frame"][piece[-1]]),
            float(probability[piece].mean()),
        )
        for piece in pieces
    ]


def _probability(rows: Rows) -> Floats:
    """Probability of a person at each point; scores are log-odds."""
    return np.asarray(expit(rows["score"].astype(float)))
