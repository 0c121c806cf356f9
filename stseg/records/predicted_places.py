"""Predicted places of tracks in the frames of a window."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.arrays import Flags, Floats, Ints


@dataclass(frozen=True)
class PredictedPlaces:
    """Predicted places of tracks in the frames of a window.

    Attributes
    ----------
    track : int64 (k,)
        Track numbers, 1 or more, rising.
    expected : bool (time, k)
        Whether the track has a prediction in the frame.
    ground, covariance : float64 (time, k, 2), (time, k, 2, 2)
        Metres, square metres.
    height : float64 (time, k)
        Of their heads, metres.
    """

    track: Ints
    expected: Flags
    ground: Floats
    covariance: Floats
    height: Floats
