"""Track states: a constant-velocity Kalman filter for each track, frame by frame.

The prediction is a prior of per-frame detection, which assigns its detections to tracks: detection and data association
are one decision, and each piece of evidence is used once (Huang and Wang 2012, section V.E, for the filter;
docs/how-it-works.md, Detection, for the prior). A person's height is constant, so it tells two people apart who have
just crossed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config, MotionConfig
from stseg.geometry.distances import distances
from stseg.records.people import People
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sizes import Sizes
from stseg.tracking.filter.motion_model import process_noise, transition

_SIZE_DRIFT = 0.002
"""Random walk of a person's apparent height and width, metres per square root of a second: shoes, stoop, lens."""
DETECTED_LOG_ODDS = 1.0
"""Greatest log-odds that a person detected in one frame is detected in the next, nats."""
_LEAST_EVIDENCE = -4.0
"""Evidence below which a rejected candidate starts no tentative track, nats."""
_REPETITION_DISCOUNT = 2.0
"""Discount of a rejected candidate's evidence: consecutive frames are not independent, nats."""
EXCLUSION_RADIUS = 0.5
"""Radius around existing tracks within which no track begins and no place is interpolated, metres."""
_UNMEASURED_SHARE = 0.6
"""Share of the population's variance from which on a frame has not measured a size."""
EXISTENCE_DECAY = 4.0
"""Decay rate of the existence log-odds while a track is undetected, nats per second."""


class Measurement(NamedTuple):
    """A scalar measurement and its variance, metres and square metres."""

    mean: float
    variance: float


class PlacePosterior(NamedTuple):
    """Posterior of a body's place, float64 (2,), (2, 2), metres, and the variance of a body about its track's place."""

    ground: Floats
    covariance: Floats
    noise: float


class TrackState(NamedTuple):
    """State of one track at its last detection.

    Attributes
    ----------
    track
        Number, from 1; 0 for a tentative track: a candidate that was rejected, but may be confirmed later.
    last_seen
        Frame of the last detection.
    state, covariance : float64 (4,), (4, 4)
        x, y, vx, vy in metres and metres per second.
    height, height_variance, width, width_variance
        Metres, square metres.
    odds
        Log-odds of existence, nats.
    """

    track: int
    last_seen: int
    state: Floats
    covariance: Floats
    height: float
    height_variance: float
    width: float
    width_variance: float
    odds: float

    def predicted(self, seconds: float, model: MotionConfig) -> TrackState:
        """The state some seconds after the last detection."""
        motion = transition(seconds)
        return self._replace(
            state=motion @ self.state,
            covariance=motion @ self.covariance @ motion.T + process_noise(seconds, model),
            height_variance=self.height_variance + _SIZE_DRIFT**2 * seconds,
            width_variance=self.width_variance + _SIZE_DRIFT**2 * seconds,
        )

    def corrected(self, frame: int, place: PlacePosterior, height: Measurement, width: Measurement) -> TrackState:
        """The predicted state after a detection.

        The body's place b strays from that of the track, N(b; x, q I), and the detector gives the posterior of b under
        the prior N(x, P + q I) of this prediction. Given b the measurement says nothing more, so mean and covariance of
        the state follow from those of b by its regression on b (Bar-Shalom, Li and Kirubarajan 2001, section 1.4.14).

        Parameters
        ----------
        frame
            Of the detection.
        place
            The posterior of the body's place.
        height, width
            Measurements, without this prediction as their prior.
        """
        prior = self.covariance[:2, :2] + place.noise * np.eye(2)
        gain = self.covariance[:, :2] @ np.linalg.inv(prior)
        surplus = prior - place.covariance
        return self.resized(height, width)._replace(
            last_seen=frame,
            state=self.state + gain @ (place.ground - self.state[:2]),
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
    """All current tracks: predicted for a frame, corrected by its detections, kept while undetected within patience.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        The constants of all stages: body, motion, detection and tracking.
    """

    def __init__(self, frame_rate: float, config: Config) -> None:
        self.frame_rate = frame_rate
        self.body, self.motion = config.body, config.motion
        self.config, self.birth_log_odds = config.tracking, config.detection.prior_log_odds
        self.tracks: list[TrackState] = []
        self.issued = 0
        self.begun = False
        self._expected: tuple[int, list[TrackState]] = (-1, [])
        """A frame, and the predictions of all tracks for it."""

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a later frame; None before the first update."""
        if not self.begun:
            return None
        predicted = self._predictions(frame)
        return PredictedTracks(
            np.array([t.state[:2] for t in predicted]).reshape(-1, 2),
            np.array([t.covariance[:2, :2] for t in predicted]).reshape(-1, 2, 2) + self._place_noise,
            Sizes(
                np.array([t.height for t in predicted]),
                np.array([t.height_variance for t in predicted]) + self.config.height_noise**2,
                np.array([t.width for t in predicted]),
                np.array([t.width_variance for t in predicted]) + self.config.width_noise**2,
            ),
            np.array([t.odds for t in predicted]),
        )

    def update(self, frame: int, people: People, ghosts: People) -> Ints:
        """The track of each detection of a frame that was explained with `predict` as its prior.

        Returns
        -------
        int64 (n,)
            Track numbers from 1; births get the next numbers.
        """
        self.begun = True
        heights, widths = self._measured(people)
        predicted, noise = self._predictions(frame), self.motion.position_noise**2
        names, detected = np.zeros(len(people), np.int64), []
        for j, index in enumerate(people.track_index.tolist()):
            if index >= 0:
                place = PlacePosterior(people.ground[j], people.covariance[j], noise)
                track, before = predicted[index].corrected(frame, place, heights[j], widths[j]), predicted[index].odds
            else:
                track, before = self._birth(frame, people, j).resized(heights[j], widths[j]), self.birth_log_odds
            if track.track == 0:
                self.issued += 1
            odds = min(float(before + people.evidence[j] - people.prior[j]), DETECTED_LOG_ODDS)
            detected.append(track._replace(track=track.track or self.issued, odds=odds))
            names[j] = detected[-1].track
        missed = self._undetected(frame, people)
        standing = [track.state[:2] for track in detected] + [predicted[k].state[:2] for k in missed]
        tentative = self._tentative(frame, ghosts, np.array(standing).reshape(-1, 2))
        self.tracks = [*detected, *(self.tracks[k] for k in missed), *tentative]
        self._expected = (-1, [])
        return names

    def _undetected(self, frame: int, people: People) -> list[int]:
        """Indices of confirmed tracks that a frame did not detect, for as long as patience lasts."""
        patience = round(self.config.patience * self.frame_rate)
        detected = set(people.track_index.tolist())
        missed = [k for k in range(len(self.tracks)) if k not in detected]
        return [k for k in missed if self.tracks[k].track and frame - self.tracks[k].last_seen <= patience]

    def _measured(self, people: People) -> tuple[list[Measurement], list[Measurement]]:
        """Heights and widths that a frame measured; a size that it left open has no weight."""
        sizes, prior, noise = people.sizes, self.body, self.config
        return (
            _measurements(sizes.height, sizes.height_variance, prior.height_spread, noise.height_noise),
            _measurements(sizes.width, sizes.width_variance, prior.width_spread, noise.width_noise),
        )

    @property
    def _place_noise(self) -> Floats:
        return np.eye(2) * self.motion.position_noise**2

    def _predictions(self, frame: int) -> list[TrackState]:
        """All tracks as predicted for a frame, in their order; made once a frame."""
        if self._expected[0] != frame:
            self._expected = frame, [self._predicted(track, frame) for track in self.tracks]
        return self._expected[1]

    def _predicted(self, track: TrackState, frame: int) -> TrackState:
        seconds = (frame - track.last_seen) / self.frame_rate
        undetected = seconds - 1 / self.frame_rate
        return track.predicted(seconds, self.motion)._replace(odds=track.odds - EXISTENCE_DECAY * undetected)

    def _tentative(self, frame: int, ghosts: People, standing: Floats) -> list[TrackState]:
        """Tentative tracks of rejected candidates: evidence adds up if the next frame shows them again.

        None begins near the places of other tracks, `standing` float64 (n, 2), metres.
        """
        excluded = distances(ghosts.ground, standing).min(1, initial=np.inf) < EXCLUSION_RADIUS
        return [
            self._birth(frame, ghosts, j)._replace(odds=float(ghosts.evidence[j]) - _REPETITION_DISCOUNT)
            for j in np.flatnonzero(~excluded & (ghosts.evidence > _LEAST_EVIDENCE)).tolist()
        ]

    def _birth(self, frame: int, people: People, j: int) -> TrackState:
        """The prior of a new track: near the place, sizes of the population, any velocity."""
        spread = np.diag([0.0, 0.0, self.motion.speed_spread**2, self.motion.speed_spread**2])
        spread[:2, :2] = people.covariance[j] + self._place_noise
        state = np.append(people.ground[j], [0.0, 0.0])
        prior = self.body
        sizes = (prior.height_mean, prior.height_spread**2, prior.width_mean, prior.width_spread**2)
        return TrackState(0, frame, state, spread, *sizes, 0.0)


def _measurements(mean: Floats, variance: Floats, spread: float, noise: float) -> list[Measurement]:
    """Measurements of one size, metres, from posteriors of a prior with the standard deviation `spread`."""
    used = np.where(variance < _UNMEASURED_SHARE * spread**2, noise**2, np.inf)
    return [Measurement(*one) for one in zip(mean.tolist(), used.tolist(), strict=True)]
