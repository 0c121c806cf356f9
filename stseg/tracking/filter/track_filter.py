"""Track states: a constant-velocity Kalman filter for each track, frame by frame.

The prediction is a prior of per-frame detection, which assigns its detections to tracks: detection and data association
are one decision, and each piece of evidence is used once (Huang and Wang 2012, section V.E, for the filter;
docs/how-it-works.md, Detection, for the prior). A person's height is constant, so it tells two people apart who have
just crossed.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from stseg.arrays import Floats, Ints, ViewEvidence
from stseg.config import Config
from stseg.records.people import People
from stseg.records.predicted_tracks import EXISTENCE_DECAY, PLACE_RESOLUTION, PredictedTracks
from stseg.records.sizes import Sizes, is_rare_height
from stseg.tracking.filter.tentative_tracks import SURE_VIEWS, tentative_log_odds
from stseg.tracking.filter.track_state import BodyPlace, Measurement, PlacePosterior, TrackState

DETECTED_LOG_ODDS = 1.0
"""Greatest log-odds that a person detected in one frame is detected in the next, nats; of a new track."""
_STANDING_LOG_ODDS, _STANDING_TIME = 1.0, 10.0
"""Growth of these while a track stands, nats, and its duration, seconds: ghosts last for less, and people stay. With
fewer than `SURE_VIEWS` there is none: a ghost of two views lasts as long as the people who cast it."""
_NUMBERS_OF_BRANCH = 10_000
"""Numbers that are left for tracks that begin beside a branch, which lasts for seconds."""


class TrackFilter:
    """All current tracks: predicted for a frame, corrected by its detections, kept while undetected within patience."""

    def __init__(self, frame_rate: float, config: Config) -> None:
        self.frame_rate = frame_rate
        self.body, self.motion = config.body, config.motion
        self.config, self.birth_log_odds = config.tracking, config.detection.prior_log_odds
        self.body_place = BodyPlace.of(config.motion.position_noise)
        self.tracks: list[TrackState] = []
        self.issued = 0
        self.begun = False
        self._expected: tuple[int, list[TrackState]] = (-1, [])
        """A frame, and the predictions of all tracks for it."""

    def branch(self) -> TrackFilter:
        """The same tracks, to be continued otherwise; those that begin there have other numbers."""
        other = copy(self)
        other.tracks, other.issued = [*self.tracks], self.issued + _NUMBERS_OF_BRANCH
        return other

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a later frame; None before the first update."""
        if not self.begun:
            return None
        predicted = self._predictions(frame)
        return PredictedTracks(
            self._grounds(predicted),
            self._covariances(predicted),
            Sizes(
                np.array([t.height for t in predicted]),
                np.array([t.height_variance for t in predicted]) + self.config.height_noise**2,
                np.array([t.width for t in predicted]),
                np.array([t.width_variance for t in predicted]) + self.config.width_noise**2,
            ),
            np.array([t.log_odds for t in predicted]),
            np.maximum(PLACE_RESOLUTION**2, np.sqrt(np.linalg.det(self._covariances(self.tracks)))),
        )

    def update(self, frame: int, people: People, ghosts: People, evidence: Sequence[ViewEvidence] = ()) -> Ints:
        """The track of each detection of a frame that was explained with `predict` as its prior.

        The evidence of the views decides which ghosts are looked for again (`stseg.tracking.filter.tentative_tracks`).

        Returns
        -------
        int64 (n,)
            Track numbers from 1; births get the next numbers.
        """
        self.begun = True
        heights, widths = self._measured(people)
        predicted = self._predictions(frame)
        names, detected = np.zeros(len(people), np.int64), list[TrackState]()
        for j, index in enumerate(people.track_index.tolist()):
            if index >= 0:
                place = PlacePosterior(people.ground[j], people.covariance[j], self.body_place)
                track = predicted[index].corrected(frame, place, heights[j], widths[j])
                before = predicted[index].log_odds
            else:
                track, before = self._birth(frame, people, j).resized(heights[j], widths[j]), self.birth_log_odds
            if track.track == 0:
                self.issued += 1
            greatest = self._greatest_log_odds(track, frame, len(people.view_evidence))
            log_odds = min(float(before + people.evidence[j] - people.prior[j]), greatest)
            detected.append(track._replace(track=track.track or self.issued, log_odds=log_odds))
            names[j] = detected[-1].track
        missed = self._undetected(frame, people)
        standing = self._grounds([*detected, *(predicted[k] for k in missed)])
        looked_for = tentative_log_odds(ghosts, standing, evidence, self.body).items()
        tentative = [self._birth(frame, ghosts, j)._replace(log_odds=log_odds) for j, log_odds in looked_for]
        self.tracks = [*detected, *(self.tracks[k] for k in missed), *tentative]
        self._expected = (-1, [])
        return names

    def _greatest_log_odds(self, track: TrackState, frame: int, views: int) -> float:
        """Greatest log-odds of a track that a frame of so many views detected, nats."""
        seconds = (frame - track.first_seen) / self.frame_rate if views >= SURE_VIEWS else 0.0
        return DETECTED_LOG_ODDS + _STANDING_LOG_ODDS * min(seconds / _STANDING_TIME, 1.0)

    def _undetected(self, frame: int, people: People) -> list[int]:
        """Indices of confirmed tracks that a frame did not detect, for as long as patience lasts."""
        patience = round(self.config.patience * self.frame_rate)
        detected = set(people.track_index.tolist())
        missed = [k for k in range(len(self.tracks)) if k not in detected]
        return [k for k in missed if self.tracks[k].track and frame - self.tracks[k].last_seen <= patience]

    def _measured(self, people: People) -> tuple[list[Measurement], list[Measurement]]:
        """Heights and widths that a frame measured; a size that it left open has no weight."""
        height, width = people.sizes.measured(self.body)
        return _measurements(height, self.config.height_noise), _measurements(width, self.config.width_noise)

    def _grounds(self, tracks: list[TrackState]) -> Floats:
        """Where bodies of tracks are expected, float64 (n, 2), metres."""
        return np.array([self.body_place.ground(track.state) for track in tracks]).reshape(-1, 2)

    def _covariances(self, tracks: list[TrackState]) -> Floats:
        """Covariances of the places of their bodies, float64 (n, 2, 2), square metres."""
        return np.array([self.body_place.covariance(track.covariance) for track in tracks]).reshape(-1, 2, 2)

    def _predictions(self, frame: int) -> list[TrackState]:
        """All tracks as predicted for a frame, in their order; made once a frame."""
        if self._expected[0] != frame:
            self._expected = frame, [self._predicted(track, frame) for track in self.tracks]
        return self._expected[1]

    def _predicted(self, track: TrackState, frame: int) -> TrackState:
        seconds = (frame - track.last_seen) / self.frame_rate
        undetected = seconds - 1 / self.frame_rate
        return track.predicted(seconds, self.motion)._replace(log_odds=track.log_odds - EXISTENCE_DECAY * undetected)

    def _birth(self, frame: int, people: People, j: int) -> TrackState:
        """The prior of a new track: near the place, any velocity, sizes of the population or a rare height as it is."""
        # The body stands there: the place of the track is that less the stray, of which nothing is known.
        spread = np.diag([0.0, 0.0, self.motion.speed_spread**2, self.motion.speed_spread**2, 1.0, 1.0])
        stray = self.body_place.matrix[:, 4:]
        spread[:2, :2] = people.covariance[j] + self.body_place.white * np.eye(2) + stray @ stray.T
        spread[:2, 4:] = spread[4:, :2] = -stray
        state, prior = np.append(people.ground[j], np.zeros(4)), self.body
        height, width = prior.height_mean, prior.width_mean
        if is_rare_height(people.height[j], prior):
            height, width = float(people.height[j]), float(people.width[j])
        sizes = (height, prior.height_spread**2, width, prior.width_spread**2)
        return TrackState(0, frame, frame, state, spread, *sizes, 0.0)


def _measurements(size: Floats, noise: float) -> list[Measurement]:
    """Measurements of one size (n,), metres, with the standard deviation `noise`; nan says nothing."""
    measured = np.isfinite(size)
    known, variance = np.where(measured, size, 0.0), np.where(measured, noise**2, np.inf)
    return [Measurement(*one) for one in zip(known.tolist(), variance.tolist(), strict=True)]
