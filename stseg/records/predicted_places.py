"""Predicted places of tracks in the frames of a window."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.arrays import Flags, Floats, Ints


@dataclass(frozen=True)
class PredictedPlaces:
    """Predicted places of tracks in the frames of a window."""

    track: Ints
    """int64 (k,): track numbers, 1 or more, rising."""
    expected: Flags
    """bool (time, k): whether the track has a prediction in the frame."""
    ground: Floats
    """float64 (time, k, 2): metres."""
    covariance: Floats
    """float64 (time, k, 2, 2): square metres."""
    height: Floats
    """float64 (time, k): of their heads, metres."""
