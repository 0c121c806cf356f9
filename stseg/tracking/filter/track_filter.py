"""Track states: a constant-velocity Kalman filter for each track, frame by frame.

The prediction is a prior of per-frame detection, which assigns its detections to tracks: detection and data association
are one decision, and each piece of evidence is used once (Huang and Wang 2012, section V.E, for the filter;
docs/how-it-works.md, Detection, for the prior). A person's height is constant, so it tells two people apart who have
just crossed.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from stseg.arrays import Boxes, Floats, Ints, ViewEvidence
from stseg.config import Config, MotionConfig
from stseg.geometry.distances import distances
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.records.people import People
from stseg.records.predicted_tracks import EXISTENCE_DECAY, PredictedTracks
from stseg.records.sizes import Sizes
from stseg.tracking.filter.motion_model import augmented_noise, augmented_transition

_SIZE_DRIFT = 0.002
"""Random walk of a person's apparent height and width, metres per square root of a second: shoes, stoop, lens."""
DETECTED_LOG_ODDS = 1.0
"""Greatest log-odds that a person detected in one frame is detected in the next, nats; of a new track."""
_STANDING_LOG_ODDS, _STANDING_TIME = 1.0, 10.0
"""Growth of these while a track stands, nats, and its duration, seconds: ghosts last for less, and people stay. With
fewer than `_SURE_VIEWS` there is none: a ghost of two views lasts as long as the people who cast it."""
_LEAST_ODDS = -6.0
"""Log-odds below which a rejected candidate starts no tentative track, nats."""
_REPEATED_EVIDENCE = 2.0
"""Part of a rejected candidate's evidence that the next frame repeats, nats: in rigs with boxes, where a detector's
errors last, and by fewer than `_SURE_VIEWS`, where ghosts last in which two silhouettes meet."""
_SURE_VIEWS = 3
"""Views of pixels with evidence for a candidate from which it adds up in full: three lines seldom meet by chance."""
_NUMBERS_OF_BRANCH = 10_000
"""Numbers that are left for tracks that begin beside a branch, which lasts for seconds."""
EXCLUSION_RADIUS = 0.5
"""Radius around other tracks within which no place is interpolated, and no tentative track begins whose evidence the
next frame repeats, metres."""
_SURE_RADIUS = 0.35
"""Radius within which no tentative track begins whose evidence adds up in full, metres: crowds nearly touch."""


class Measurement(NamedTuple):
    """A scalar measurement and its variance, metres and square metres."""

    mean: float
    variance: float


class PlacePosterior(NamedTuple):
    """Posterior of a body's place, float64 (2,), (2, 2), metres, and the prior that is in it."""

    ground: Floats
    covariance: Floats
    prior: BodyPlace


class BodyPlace(NamedTuple):
    """A body's place by a track's state: `matrix` float64 (2, 6) times the state, and white noise, square metres.

    Where detectors put a body strays from the track, and most of that lasts: pose, gait and the views that see it.
    """

    matrix: Floats
    white: float

    @classmethod
    def of(cls, noise: float) -> BodyPlace:
        """The place of bodies that stray by a standard deviation, metres."""
        lasting = noise * np.sqrt(PLACE_ERROR.lasting) * np.eye(2)
        matrix = np.concatenate([np.eye(2), np.zeros((2, 2)), lasting], axis=1)
        return cls(matrix, float(PLACE_ERROR.white) * noise**2)

    def ground(self, state: Floats) -> Floats:
        """The place by a state, float64 (2,), metres."""
        return np.asarray(self.matrix @ state)

    def covariance(self, covariance: Floats) -> Floats:
        """Its covariance by that of a state, float64 (2, 2), square metres."""
        return np.asarray(self.matrix @ covariance @ self.matrix.T + self.white * np.eye(2))


class TrackState(NamedTuple):
    """State of one track at its last detection."""

    track: int
    """Number, from 1; 0 for a tentative track: a candidate that was rejected, but may be confirmed later."""
    first_seen: int
    last_seen: int
    """Frames of the first and the last detection."""
    state: Floats
    covariance: Floats
    """float64 (6,) and (6, 6): x, y, vx, vy in metres and metres per second, and the lasting part of the body's
    stray, in its own standard deviations (`stseg.tracking.filter.motion_model`)."""
    height: float
    height_variance: float
    width: float
    width_variance: float
    """Body height and width, metres, and their variances, square metres."""
    odds: float
    """Log-odds of existence, nats."""

    def predicted(self, seconds: float, model: MotionConfig) -> TrackState:
        """The state some seconds after the last detection."""
        motion = augmented_transition(seconds)
        return self._replace(
            state=motion @ self.state,
            covariance=motion @ self.covariance @ motion.T + augmented_noise(seconds, model),
            height_variance=self.height_variance + _SIZE_DRIFT**2 * seconds,
            width_variance=self.width_variance + _SIZE_DRIFT**2 * seconds,
        )

    def corrected(self, frame: int, place: PlacePosterior, height: Measurement, width: Measurement) -> TrackState:
        """The predicted state after a detection.

        The body's place is b = H s + noise of the state s, and the detector gives the posterior of b under the prior of
        this prediction. Given b the measurement says nothing more, so mean and covariance of the state follow from
        those of b by its regression on b (Bar-Shalom, Li and Kirubarajan 2001, section 1.4.14).

        Parameters
        ----------
        frame
            Of the detection.
        place
            The posterior of the body's place.
        height, width
            Measurements, without this prediction as their prior.
        """
        prior = place.prior.covariance(self.covariance)
        gain = self.covariance @ place.prior.matrix.T @ np.linalg.inv(prior)
        surplus = prior - place.covariance
        return self.resized(height, width)._replace(
            last_seen=frame,
            state=self.state + gain @ (place.ground - place.prior.ground(self.state)),
            covariance=self.covariance - gain @ surplus @ gain.T,
        )

    def resized(self, height: Measurement, width: Measurement) -> TrackState:
        """The state after measurements of its sizes."""
        tall = self.height_variance / (self.height_variance + height.variance)
        wide = self.width_variance / (self.width_variance + width.variance)
        return self._replace(
            height=self.height + tall * (height.mean - self.height),
            height_variance=self.height_variance * (1 - tall),
            width=self.width + wide * (width.mean - self.width),
            width_variance=self.width_variance * (1 - wide),
        )


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
            np.array([self.body_place.covariance(t.covariance) for t in predicted]).reshape(-1, 2, 2),
            Sizes(
                np.array([t.height for t in predicted]),
                np.array([t.height_variance for t in predicted]) + self.config.height_noise**2,
                np.array([t.width for t in predicted]),
                np.array([t.width_variance for t in predicted]) + self.config.width_noise**2,
            ),
            np.array([t.odds for t in predicted]),
        )

    def update(self, frame: int, people: People, ghosts: People, repeated: float = 0.0) -> Ints:
        """The track of each detection of a frame that was explained with `predict` as its prior.

        `repeated` is the part of the ghosts' evidence that the next frame repeats (`repeated_evidence`), nats.

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
                track, before = predicted[index].corrected(frame, place, heights[j], widths[j]), predicted[index].odds
            else:
                track, before = self._birth(frame, people, j).resized(heights[j], widths[j]), self.birth_log_odds
            if track.track == 0:
                self.issued += 1
            greatest = self._greatest_odds(track, frame, len(people.view_evidence))
            odds = min(float(before + people.evidence[j] - people.prior[j]), greatest)
            detected.append(track._replace(track=track.track or self.issued, odds=odds))
            names[j] = detected[-1].track
        missed = self._undetected(frame, people)
        standing = self._grounds([*detected, *(predicted[k] for k in missed)])
        tentative = self._tentative(frame, ghosts, repeated, standing)
        self.tracks = [*detected, *(self.tracks[k] for k in missed), *tentative]
        self._expected = (-1, [])
        return names

    def _greatest_odds(self, track: TrackState, frame: int, views: int) -> float:
        """Greatest log-odds of a track that a frame of so many views detected, nats."""
        seconds = (frame - track.first_seen) / self.frame_rate if views >= _SURE_VIEWS else 0.0
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

    def _predictions(self, frame: int) -> list[TrackState]:
        """All tracks as predicted for a frame, in their order; made once a frame."""
        if self._expected[0] != frame:
            self._expected = frame, [self._predicted(track, frame) for track in self.tracks]
        return self._expected[1]

    def _predicted(self, track: TrackState, frame: int) -> TrackState:
        seconds = (frame - track.last_seen) / self.frame_rate
        undetected = seconds - 1 / self.frame_rate
        return track.predicted(seconds, self.motion)._replace(odds=track.odds - EXISTENCE_DECAY * undetected)

    def _tentative(self, frame: int, ghosts: People, repeated: float, standing: Floats) -> list[TrackState]:
        """Tentative tracks of rejected candidates: evidence adds up if the next frame shows them again.

        None begins near the places of other tracks, `standing` float64 (n, 2), metres.
        """
        by_few = (ghosts.view_evidence != 0).sum(0) < _SURE_VIEWS
        discount = np.where(by_few, _REPEATED_EVIDENCE, repeated)
        odds, radius = ghosts.evidence - discount, np.where(discount > 0, EXCLUSION_RADIUS, _SURE_RADIUS)
        excluded = distances(ghosts.ground, standing).min(1, initial=np.inf) < radius
        return [
            self._birth(frame, ghosts, j)._replace(odds=float(odds[j]))
            for j in np.flatnonzero(~excluded & (odds > _LEAST_ODDS)).tolist()
        ]

    def _birth(self, frame: int, people: People, j: int) -> TrackState:
        """The prior of a new track: near the place, sizes of the population, any velocity."""
        # The body stands there: the place of the track is that less the stray, of which nothing is known.
        spread = np.diag([0.0, 0.0, self.motion.speed_spread**2, self.motion.speed_spread**2, 1.0, 1.0])
        stray = self.body_place.matrix[:, 4:]
        spread[:2, :2] = people.covariance[j] + self.body_place.white * np.eye(2) + stray @ stray.T
        spread[:2, 4:] = spread[4:, :2] = -stray
        state, prior = np.append(people.ground[j], np.zeros(4)), self.body
        sizes = (prior.height_mean, prior.height_spread**2, prior.width_mean, prior.width_spread**2)
        return TrackState(0, frame, frame, state, spread, *sizes, 0.0)


def repeated_evidence(evidence: Sequence[ViewEvidence]) -> float:
    """Part of a rejected candidate's evidence that the next frame repeats where `_SURE_VIEWS` bear it, nats."""
    return _REPEATED_EVIDENCE if any(isinstance(view, Boxes) for view in evidence) else 0.0


def _measurements(size: Floats, noise: float) -> list[Measurement]:
    """Measurements of one size (n,), metres, with the standard deviation `noise`; nan says nothing."""
    measured = np.isfinite(size)
    known, variance = np.where(measured, size, 0.0), np.where(measured, noise**2, np.inf)
    return [Measurement(*one) for one in zip(known.tolist(), variance.tolist(), strict=True)]
