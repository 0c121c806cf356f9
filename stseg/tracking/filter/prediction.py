"""Predicted places of tracks in the frames of a window, from detections before, within and after a gap."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import MotionConfig, TrackingConfig
from stseg.records.predicted_tracks import PredictedPlaces
from stseg.tracking.windows.tracklets import Tracklet

DRIFT_SPEED = 0.5
"""Growth of a place's standard deviation away from the nearest detection, metres per second."""
_VELOCITY_STEPS = 4
"""Detections before the last from which the velocity is estimated."""


@dataclass(frozen=True)
class DetectionHistory:
    """Detections with their filter tracks; rows in any order, a track at most once a frame."""

    frame: Ints
    """int64 (n,): frame of the recording."""
    track: Ints
    """int64 (n,): filter track."""
    ground: Floats
    """float64 (n, 2): metres."""
    covariance: Floats
    """float64 (n, 2, 2): square metres."""
    height: Floats
    """float64 (n,): metres."""

    def at(self, rows: Ints) -> DetectionHistory:
        """The given rows."""
        return DetectionHistory(
            self.frame[rows], self.track[rows], self.ground[rows], self.covariance[rows], self.height[rows]
        )


def earlier_detections(tails: Iterable[Tracklet], before: int, height: float, model: MotionConfig) -> DetectionHistory:
    """The committed ends of tracks before a frame, as detections of bodies of mean height, metres."""
    history = [
        (frame, tail.filter_track, *ground)
        for tail in tails
        for frame, ground in zip(tail.frames, tail.ground, strict=True)
        if frame < before
    ]
    rows = np.array(history, float).reshape(-1, 4)
    covariance = np.tile(np.eye(2) * model.position_noise**2, (len(rows), 1, 1))
    frame, track = rows[:, :2].T.astype(np.int64)
    return DetectionHistory(frame, track, rows[:, 2:], covariance, np.full(len(rows), height))


def together(parts: Iterable[DetectionHistory]) -> DetectionHistory:
    """The detections of several histories."""
    columns = zip(*((p.frame, p.track, p.ground, p.covariance, p.height) for p in parts), strict=True)
    return DetectionHistory(*(np.concatenate(column) for column in columns))


def predicted_places(
    history: DetectionHistory, first: int, stop: int, frame_rate: float, config: TrackingConfig
) -> PredictedPlaces:
    """Predicted place of each filter track in frames first .. stop - 1.

    At a detection its place; between two on a straight line; after the last at constant velocity, for at most
    `tracking.prediction_horizon`. The covariance grows with the time to the nearest detection.
    """
    tracks = np.unique(history.track)
    size = (stop - first, len(tracks))
    places = PredictedPlaces(
        tracks, np.zeros(size, bool), np.zeros((*size, 2)), np.zeros((*size, 2, 2)), np.zeros(size)
    )
    frames = np.arange(first, stop)
    for k, track in enumerate(tracks):
        rows = np.flatnonzero(history.track == track)
        detections = history.at(rows[np.argsort(history.frame[rows], kind="stable")])
        after = detections.frame.searchsorted(frames)
        before = np.searchsorted(detections.frame, frames, side="right") - 1
        earlier, later = before.clip(0), after.clip(0, len(detections.frame) - 1)
        away = np.minimum(np.abs(frames - detections.frame[earlier]), np.abs(detections.frame[later] - frames))
        nearest = np.where(
            frames - detections.frame[earlier] <= np.abs(detections.frame[later] - frames), earlier, later
        )
        ahead = frames - detections.frame[-1]
        places.expected[:, k] = (before >= 0) & (ahead <= config.prediction_horizon * frame_rate)
        places.ground[:, k] = detections.ground[-1] + ahead[:, None] * _velocity(detections)
        inside = ahead <= 0
        places.ground[inside, k] = np.column_stack(
            [np.interp(frames[inside], detections.frame, g) for g in detections.ground.T]
        )
        spread = (DRIFT_SPEED * away / frame_rate) ** 2
        places.covariance[:, k] = detections.covariance[nearest] + spread[:, None, None] * np.eye(2)
        places.height[:, k] = detections.height[nearest]
    return places


def _velocity(detections: DetectionHistory) -> Floats:
    """Velocity over the last detections, metres per frame, float64 (2,)."""
    frame, ground = detections.frame[-1 - _VELOCITY_STEPS :], detections.ground[-1 - _VELOCITY_STEPS :]
    return np.zeros(2) if len(frame) < 2 else np.asarray((ground[-1] - ground[0]) / (frame[-1] - frame[0]))
