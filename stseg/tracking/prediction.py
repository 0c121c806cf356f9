"""Where everybody is expected in each frame of a window: what the labels of its cells are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import MotionConfig, TrackingConfig
from stseg.model.predicted_places import PredictedPlaces
from stseg.tracking.tracklets import Tracklet

_DRIFT = 0.5
"""How fast the place of somebody out of sight becomes uncertain, metres per second (standard deviation)."""
_STEPS = 4
"""Sightings before the last that tell a walker's velocity."""


@dataclass(frozen=True)
class DetectionHistory:
    """Who was seen where; rows in any order, a chain at most once a frame.

    Attributes
    ----------
    frame, chain : int64 (n,)
        Frame of the recording, and whom.
    ground, covariance, height : float64 (n, 2), (n, 2, 2), (n,)
        Metres, square metres.
    """

    frame: Ints
    chain: Ints
    ground: Floats
    covariance: Floats
    height: Floats

    def at(self, rows: Ints) -> DetectionHistory:
        """Some of them."""
        return DetectionHistory(
            self.frame[rows], self.chain[rows], self.ground[rows], self.covariance[rows], self.height[rows]
        )


def earlier_detections(tails: Iterable[Tracklet], before: int, height: float, model: MotionConfig) -> DetectionHistory:
    """The committed ends of tracks, up to a frame, as sightings of bodies of a mean height, metres."""
    seen = [
        (frame, tail.chain, *ground)
        for tail in tails
        for frame, ground in zip(tail.frames, tail.ground, strict=True)
        if frame < before
    ]
    rows = np.array(seen, float).reshape(-1, 4)
    covariance = np.tile(np.eye(2) * model.position_noise**2, (len(rows), 1, 1))
    frame, chain = rows[:, :2].T.astype(np.int64)
    return DetectionHistory(frame, chain, rows[:, 2:], covariance, np.full(len(rows), height))


def together(parts: Iterable[DetectionHistory]) -> DetectionHistory:
    """All sightings of several."""
    columns = zip(*((p.frame, p.chain, p.ground, p.covariance, p.height) for p in parts), strict=True)
    return DetectionHistory(*(np.concatenate(column) for column in columns))


def predicted_places(
    seen: DetectionHistory, first: int, stop: int, frame_rate: float, config: TrackingConfig
) -> PredictedPlaces:
    """Where each chain is expected in frames first .. stop - 1.

    Where it was seen there; between two sightings on a straight line; after the last at constant velocity, for as long
    as a walker can be foreseen. Away from a sighting the place grows uncertain.
    """
    chains = np.unique(seen.chain)
    size = (stop - first, len(chains))
    places = PredictedPlaces(
        chains, np.zeros(size, bool), np.zeros((*size, 2)), np.zeros((*size, 2, 2)), np.zeros(size)
    )
    frames = np.arange(first, stop)
    for k, chain in enumerate(chains):
        rows = np.flatnonzero(seen.chain == chain)
        own = seen.at(rows[np.argsort(seen.frame[rows], kind="stable")])
        after = own.frame.searchsorted(frames)
        before = np.searchsorted(own.frame, frames, side="right") - 1
        earlier, later = before.clip(0), after.clip(0, len(own.frame) - 1)
        away = np.minimum(np.abs(frames - own.frame[earlier]), np.abs(own.frame[later] - frames))
        nearest = np.where(frames - own.frame[earlier] <= np.abs(own.frame[later] - frames), earlier, later)
        ahead = frames - own.frame[-1]
        places.expected[:, k] = (before >= 0) & (ahead <= config.prediction_horizon * frame_rate)
        places.ground[:, k] = own.ground[-1] + ahead[:, None] * _velocity(own)
        inside = ahead <= 0
        places.ground[inside, k] = np.column_stack([np.interp(frames[inside], own.frame, g) for g in own.ground.T])
        spread = (_DRIFT * away / frame_rate) ** 2
        places.covariance[:, k] = own.covariance[nearest] + spread[:, None, None] * np.eye(2)
        places.height[:, k] = own.height[nearest]
    return places


def _velocity(own: DetectionHistory) -> Floats:
    """Metres per frame over the last sightings, float64 (2,)."""
    frame, ground = own.frame[-1 - _STEPS :], own.ground[-1 - _STEPS :]
    return np.zeros(2) if len(frame) < 2 else np.asarray((ground[-1] - ground[0]) / (frame[-1] - frame[0]))
