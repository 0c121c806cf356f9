"""A Kalman filter for each track over the detections that survive ghost removal (Huang and Wang 2012, section V.E).

Frame by frame: filters are predicted, detections within their gates are assigned one to one and correct them, and
unassigned detections are births. The paper's temporal check, which removes short tracks, is the run's last step
(`stseg.trajectories.final_tracks.committed_tracks`).
"""

from typing import ClassVar

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.baselines.huang_wang_2012.kalman_filters import (
    Filters,
    corrected_filters,
    initial,
    innovations,
    predicted_filters,
)
from stseg.config import Config
from stseg.geometry import Rig
from stseg.records.predicted_tracks import EXISTENCE_DECAY, PredictedTracks
from stseg.records.sizes import Sizes
from stseg.trackers.framewise import FramewiseTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event, TrackPlaces
from stseg.tracking.filter.assignment import assign
from stseg.tracking.filter.track_filter import DETECTED_LOG_ODDS


class KalmanTracker(FramewiseTracker):
    """One constant-velocity Kalman filter a track."""

    final: ClassVar[bool] = True

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.filters = initial(np.zeros((0, 2)), np.zeros((0, 2, 2)), config.motion.speed_spread)
        self.sizes = Sizes.of_population(0, config.body)
        self.issued, self.begun = 0, False
        self.ids: Ints = np.zeros(0, np.int64)
        self.last_seen: Ints = np.zeros(0, np.int64)

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a frame; None for the first."""
        if not self.begun:
            return None
        seconds, noise = (frame - self.frame) / self.rig.frame_rate, self.config.motion.position_noise**2 * np.eye(2)
        filters = predicted_filters(self.filters, seconds, self.config.motion)
        unseen = (frame - 1 - self.last_seen) / self.rig.frame_rate
        return PredictedTracks(
            filters.state[:, :2],
            filters.covariance[:, :2, :2] + noise,
            self._with_noise(self.sizes),
            DETECTED_LOG_ODDS - EXISTENCE_DECAY * unseen,
        )

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once."""
        del observed
        deaths = self._end(fused.frame)
        ground, model = fused.people.ground, self.config.motion
        noise = fused.people.covariance + np.eye(2) * model.position_noise**2
        filters = predicted_filters(self.filters, (fused.frame - self.frame) / self.rig.frame_rate, model)
        sizes = self._measured(fused.people.sizes)
        tracks, found = self._assigned(filters, ground, noise, sizes)
        unassigned = np.setdiff1d(np.arange(len(ground)), found)
        filters = corrected_filters(filters, tracks, ground[found], noise[found])
        self.filters = filters.joined_with(initial(ground[unassigned], noise[unassigned], model.speed_spread))
        self.sizes.put(tracks, sizes.at(found).with_prior(self.sizes.at(tracks)))
        population = Sizes.of_population(len(unassigned), self.config.body)
        self.sizes = self.sizes.joined_with(sizes.at(unassigned).with_prior(population))
        births = self.issued + 1 + np.arange(len(unassigned))
        self.frame, self.issued, self.begun = fused.frame, self.issued + len(unassigned), True
        person = np.full(len(self.ids), -1)
        person[tracks] = found
        self.ids, person = np.append(self.ids, births), np.append(person, unassigned)
        self.last_seen = np.where(person >= 0, fused.frame, np.append(self.last_seen, np.zeros_like(unassigned)))
        born = [(fused.frame, "birth", int(i), 0, "a person in nobody's gate") for i in births]
        return [self._commit(fused, person, born + deaths)]

    def _measured(self, sizes: Sizes) -> Sizes:
        """Sizes as measurements: the population prior taken out, the frame's noise added."""
        population = Sizes.of_population(len(sizes.height), self.config.body)
        return self._with_noise(sizes.as_measurements(population))

    def _with_noise(self, sizes: Sizes) -> Sizes:
        """Sizes, with one frame's measurement noise added."""
        noise = self.config.tracking
        height, width = sizes.height_variance + noise.height_noise**2, sizes.width_variance + noise.width_noise**2
        return Sizes(sizes.height, height, sizes.width, width)

    def _assigned(self, filters: Filters, ground: Floats, noise: Floats, sizes: Sizes) -> tuple[Ints, Ints]:
        """Pairs of filters and detections, both int64: the most likely assignment within the gates."""
        squares, cost = innovations(filters, ground, noise)
        variance = self.sizes.height_variance[:, None] + sizes.height_variance
        cost = cost + (self.sizes.height[:, None] - sizes.height) ** 2 / variance + np.log(variance)
        gate = -2.0 * np.log1p(-self.config.kalman.gate_probability)  # of chi square with two degrees of freedom
        inside = squares <= gate
        return assign(np.where(inside, cost - cost.max(initial=0.0), 1.0), 1.0)

    def _end(self, frame: int) -> list[Event]:
        """Remove tracks that were undetected for longer than patience."""
        patience = self.config.kalman.patience
        lost = frame - self.last_seen > patience * self.rig.frame_rate
        deaths = [(frame, "death", int(i), 0, f"not found for {patience:g} s") for i in self.ids[lost]]
        self.filters, self.ids, self.last_seen = self.filters.kept(~lost), self.ids[~lost], self.last_seen[~lost]
        self.sizes = self.sizes.at(np.flatnonzero(~lost))
        return deaths

    def _commit(self, fused: FusedFrame, person: Ints, events: list[Event]) -> Commit:
        """Commit the detected tracks: filtered places in x, y, detected places in raw_x, raw_y."""
        people = fused.people
        found, which = np.flatnonzero(person >= 0), person[person >= 0]
        ids, ground = self.ids[found], self.filters.state[found, :2]
        covariance, score = self.filters.covariance[found, :2, :2], people.evidence[which]
        tracks = TrackPlaces(ids, ground, covariance, people.height[which], people.width[which], score)
        commit = self.commit(fused, tracks, events)
        commit.trajectory["raw_x"], commit.trajectory["raw_y"] = people.ground[which].T
        return commit
