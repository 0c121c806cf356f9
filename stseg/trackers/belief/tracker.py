"""Belief propagation between views: detections start and end tracks, colours move them (Du and Piater 2006)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from stseg.arrays import Bytes, Floats, Ints
from stseg.config import Config
from stseg.geometry import Rig
from stseg.model.border import Border
from stseg.model.predicted_tracks import PredictedTracks
from stseg.model.sizes import Sizes
from stseg.trackers.belief.condensation import condense
from stseg.trackers.belief.particles import Motion
from stseg.trackers.belief.star import propagate
from stseg.trackers.belief.target import Target, in_front, looks
from stseg.trackers.belief.view import StarView
from stseg.trackers.colour_views import colour_views
from stseg.trackers.framewise import FramewiseTracker
from stseg.trackers.protocol import FORGETTING, STAYING, Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event
from stseg.tracking.assignment import assign, distances

_WAYS = {"messages": propagate, "condensation": condense}
"""Propagation of stars from frame to frame."""
_SEEN = 0.5
"""Probability from which a view is taken to see a target."""
_MANY = 50
"""Frames over which a height is averaged."""


class BeliefTracker(FramewiseTracker):
    """Tracks by colours, one star graph a target.

    An unassigned detection is a birth, whose colours are learned in views with full visibility. From then on colours
    move the target; assigned detections only confirm it and update its colours.
    """

    final: ClassVar[bool] = True

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.motion = Motion(1 / rig.frame_rate, config.belief.position_noise, config.motion.velocity_noise)
        self.views = [StarView.of(camera, rig.grid) for camera in rig.cameras]
        self.border = Border.of(rig)
        self.targets: list[Target] = []
        self.issued = 0
        self.begun = False

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all targets for a frame; None for the first."""
        del frame
        if not self.begun:
            return None
        foretold = [target.foretold(self.motion) for target in self.targets]
        noise, height_noise = self.config.motion.position_noise**2, self.config.tracking.height_noise**2
        spread = [
            target.star.ground.covariance + p.covariance for target, p in zip(self.targets, foretold, strict=True)
        ]
        missed = np.array([target.missed for target in self.targets]) * self.motion.seconds
        return PredictedTracks(
            np.array([p.mean for p in foretold]).reshape(-1, 2),
            np.array(spread).reshape(-1, 2, 2) + noise * np.eye(2),
            Sizes.of_heights(
                np.array([target.height for target in self.targets]),
                np.array([height_noise * (1 + 1 / target.found) for target in self.targets]),
                self.config.body,
            ),
            STAYING - FORGETTING * missed,
        )

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once."""
        self.begun = True
        images = [view and view.image for view in colour_views(shown, "belief", scene.frame)]
        self._follow(scene.frame, images)
        found = self._find(scene, images)
        events = self._end(scene.frame) + self._begin(scene, found, images)
        seen = [t for t in self.targets if t.missed == 0 or t.star.sight.max(initial=0.0) >= _SEEN]
        return [self._commit(scene, seen, events)]

    def _follow(self, frame: int, images: list[Bytes | None]) -> None:
        seen = looks(self.targets, self.views, images, self.motion, self.config.belief)
        lots = [self._lots(frame, target.track) for target in self.targets]
        follow = _WAYS[self.config.belief.method]
        stars = follow([target.star for target in self.targets], seen, self.motion, self.config.belief, lots)
        for target, star in zip(self.targets, stars, strict=True):
            target.star = star

    def _lots(self, frame: int, track: int) -> np.random.Generator:
        """Random numbers of one target in one frame, independent of the other targets."""
        return np.random.default_rng([self.config.belief.seed, track, frame])

    def _find(self, scene: FusedFrame, images: list[Bytes | None]) -> Ints:
        """Confirm targets by detections; the target of each detection, int64 (n,), -1 for unassigned."""
        people = scene.people
        ground = np.array([target.star.ground.mean for target in self.targets]).reshape(-1, 2)
        rows, columns = assign(distances(people.ground, ground), self.config.belief.assignment_distance)
        whose = np.full(len(people), -1, np.int64)
        whose[rows] = columns
        for target in self.targets:
            target.missed += 1
        share = 1 - np.exp(-self.motion.seconds / self.config.belief.colour_memory)
        nearer = [in_front(people.ground, people.height, view) for view in self.views]
        for person, k in zip(rows.tolist(), columns.tolist(), strict=True):
            target = self.targets[k]
            target.found, target.missed = target.found + 1, 0
            target.height += (float(people.height[person]) - target.height) / min(target.found, _MANY)
            target.learn(self.views, images, people.ground[person], [n[person] for n in nearer], share)
        return whose

    def _end(self, frame: int) -> list[Event]:
        """Remove targets that left the area, and those unconfirmed for longer than their age or patience."""
        events: list[Event] = []
        patience = round(self.config.belief.patience * self.rig.frame_rate)
        for target in list(self.targets):
            outside = self.border.away(target.star.ground.mean[None])[0] == 0.0
            if target.missed and outside:
                reason = "left the area"
            elif target.missed > min(patience, target.found):
                seen = target.star.sight.max(initial=0.0) >= _SEEN
                reason = (
                    f"nobody was found there for {target.missed} frames; its colours were{'' if seen else ' not'} seen"
                )
            else:
                continue
            self.targets.remove(target)
            events.append((frame, "death", target.track, 0, reason))
        return events

    def _begin(self, scene: FusedFrame, whose: Ints, images: list[Bytes | None]) -> list[Event]:
        """Births: a target for each unassigned detection."""
        events: list[Event] = []
        people = scene.people
        nearer = [in_front(people.ground, people.height, view) for view in self.views]
        for k in np.flatnonzero(whose < 0).tolist():
            self.issued += 1
            lots = self._lots(scene.frame, self.issued)
            height, count = float(people.height[k]), self.config.belief.particles
            target = Target.at(
                self.issued,
                people.ground[k],
                people.covariance[k],
                height,
                len(self.views),
                count,
                self.config.motion.speed_spread,
                lots,
            )
            target.learn(self.views, images, people.ground[k], [n[k] for n in nearer], 1.0)
            self.targets.append(target)
            events.append((scene.frame, "birth", target.track, 0, "a detection where nobody was followed"))
        return events

    def _commit(self, scene: FusedFrame, seen: list[Target], events: list[Event]) -> Commit:
        ids = np.array([target.track for target in seen], np.int64)
        ground = np.array([target.star.ground.mean for target in seen]).reshape(-1, 2)
        covariance: Floats = np.array([target.star.ground.covariance for target in seen]).reshape(-1, 2, 2)
        height, score = (np.array(column, float) for column in ([t.height for t in seen], self._scores(seen)))
        width = np.full(len(seen), self.config.body.width_mean)
        return self.commit(scene, ids, ground, covariance, height, width, score, events)

    @staticmethod
    def _scores(seen: list[Target]) -> list[float]:
        """Log-odds that some view sees each target, nats."""
        hidden = [float(np.prod(1 - target.star.sight).clip(1e-9, 1 - 1e-9)) for target in seen]
        return [float(np.log(1 - share) - np.log(share)) for share in hidden]
