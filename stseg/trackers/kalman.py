"""A Kalman filter for each person over the people of each frame that survived ghost removal (HW12 section V.E).

Frame by frame: every filter is carried to the frame, people found within its gate are assigned to it one to one, those
assigned correct it, those left over begin tracks. HW12's temporal check, that short tracks are nobody, is the run's
last step (`identity.whole.own_tracks`).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config
from stseg.geometry import Rig
from stseg.model.predicted_tracks import PredictedTracks
from stseg.model.sizes import Sizes
from stseg.trackers.framewise import EachFrame
from stseg.trackers.motion import Filters, begun, carried, corrected, surprise
from stseg.trackers.protocol import FORGETTING, STAYING, Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event
from stseg.tracking.assignment import assign


class KalmanTracker(EachFrame):
    """Follows people at constant velocity."""

    final: ClassVar[bool] = True

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.filters = begun(np.zeros((0, 2)), np.zeros((0, 2, 2)), config.motion.speed_spread)
        self.sizes = Sizes.of_population(0, config.body)
        self.issued, self.begun = 0, False
        self.ids: Ints = np.zeros(0, np.int64)
        self.seen: Ints = np.zeros(0, np.int64)

    def expected(self, frame: int) -> PredictedTracks | None:
        """Everybody who is followed, carried to the frame; None before the first."""
        if not self.begun:
            return None
        seconds, noise = (frame - self.frame) / self.rig.frame_rate, self.config.motion.position_noise**2 * np.eye(2)
        filters = carried(self.filters, seconds, self.config.motion.velocity_noise)
        unseen = (frame - 1 - self.seen) / self.rig.frame_rate
        return PredictedTracks(
            filters.state[:, :2],
            filters.covariance[:, :2, :2] + noise,
            self.sizes.with_noise(self.config.tracking),
            STAYING - FORGETTING * unseen,
        )

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """The next frame, decided."""
        del shown
        deaths = self._end(scene.frame)
        ground, model = scene.people.ground, self.config.motion
        noise = scene.people.covariance + np.eye(2) * model.position_noise**2
        filters = carried(self.filters, (scene.frame - self.frame) / self.rig.frame_rate, model.velocity_noise)
        sizes = self._measured(scene.people.sizes)
        tracks, found = self._assigned(filters, ground, noise, sizes)
        fresh = np.setdiff1d(np.arange(len(ground)), found)
        filters = corrected(filters, tracks, ground[found], noise[found])
        self.filters = filters.joined_with(begun(ground[fresh], noise[fresh], model.speed_spread))
        self.sizes.put(tracks, sizes.at(found).with_prior(self.sizes.at(tracks)))
        anybody = Sizes.of_population(len(fresh), self.config.body)
        self.sizes = self.sizes.joined_with(sizes.at(fresh).with_prior(anybody))
        newcomers = self.issued + 1 + np.arange(len(fresh))
        self.frame, self.issued, self.begun = scene.frame, self.issued + len(fresh), True
        person = np.full(len(self.ids), -1)
        person[tracks] = found
        self.ids, person = np.append(self.ids, newcomers), np.append(person, fresh)
        self.seen = np.where(person >= 0, scene.frame, np.append(self.seen, np.zeros_like(fresh)))
        births = [(scene.frame, "birth", int(i), 0, "a person in nobody's gate") for i in newcomers]
        return [self._commit(scene, person, births + deaths)]

    def _measured(self, sizes: Sizes) -> Sizes:
        """What a frame adds to what was known of people's sizes."""
        anybody = Sizes.of_population(len(sizes.height), self.config.body)
        return sizes.as_measurements(anybody).with_noise(self.config.tracking)

    def _assigned(self, filters: Filters, ground: Floats, noise: Floats, sizes: Sizes) -> tuple[Ints, Ints]:
        """Filters and people of a frame that are one person's, both int64: the likeliest pairs within the gates."""
        squares, cost = surprise(filters, ground, noise)
        variance = self.sizes.height_variance[:, None] + sizes.height_variance
        cost = cost + (self.sizes.height[:, None] - sizes.height) ** 2 / variance + np.log(variance)
        inside = squares <= -2.0 * np.log1p(
            -self.config.kalman.gate_probability
        )  # of chi square with two degrees of freedom
        return assign(np.where(inside, cost - cost.max(initial=0.0), 1.0), 1.0)

    def _end(self, frame: int) -> list[Event]:
        """Forget who was not found for too long."""
        patience = self.config.kalman.patience
        lost = frame - self.seen > patience * self.rig.frame_rate
        told = [(frame, "death", int(i), 0, f"not found for {patience:g} s") for i in self.ids[lost]]
        self.filters, self.ids, self.seen = self.filters.kept(~lost), self.ids[~lost], self.seen[~lost]
        self.sizes = self.sizes.at(np.flatnonzero(~lost))
        return told

    def _commit(self, scene: FusedFrame, person: Ints, events: list[Event]) -> Commit:
        """Those found in the frame: where the filters believe them, beside where the frame saw them."""
        people = scene.people
        found, which = np.flatnonzero(person >= 0), person[person >= 0]
        ids, ground = self.ids[found], self.filters.state[found, :2]
        commit = self.commit(
            scene, ids, ground, self.filters.covariance[found, :2, :2], people.height[which], people.width[which],
            people.evidence[which], events,
        )  # fmt: skip
        commit.trajectory["raw_x"], commit.trajectory["raw_y"] = people.ground[which].T
        return commit
