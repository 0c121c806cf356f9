"""Belief propagation between views, which updates tracks by colours (Du and Piater 2006, eqs 4 to 11)."""

from typing import ClassVar

import numpy as np

from stseg.arrays import Bytes, Floats, Ints
from stseg.baselines.colour_views import colour_views
from stseg.baselines.du_piater_2006.condensation import condense
from stseg.baselines.du_piater_2006.particles import Motion
from stseg.baselines.du_piater_2006.star import propagate
from stseg.baselines.du_piater_2006.target import Target, in_front, target_likelihoods
from stseg.baselines.du_piater_2006.view import StarView
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.distances import distances
from stseg.records.border import Border
from stseg.records.predicted_tracks import EXISTENCE_DECAY, PredictedTracks
from stseg.records.sizes import Sizes
from stseg.trackers.framewise import FramewiseTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event, TrackPlaces
from stseg.tracking.filter.assignment import assign
from stseg.tracking.filter.track_filter import DETECTED_LOG_ODDS

_METHODS = {"messages": propagate, "condensation": condense}
"""Propagation of stars from frame to frame."""
_LEAST_VISIBILITY = 0.5
"""Least probability at which a view counts as seeing a target."""
_HEIGHT_FRAMES = 50
"""Frames over which a height is averaged."""


class BeliefTracker(FramewiseTracker):
    """Tracks by colours, one star graph a target.

    An unassigned detection is a birth, whose colours are learned in views with full visibility. From then on colours
    update the target's place; assigned detections only confirm it and update its colours and height.
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
        predictions = [target.prediction(self.motion) for target in self.targets]
        noise, height_noise = self.config.motion.position_noise**2, self.config.tracking.height_noise**2
        spread = [
            target.star.ground.covariance + p.covariance for target, p in zip(self.targets, predictions, strict=True)
        ]
        missed = np.array([target.missed for target in self.targets]) * self.motion.seconds
        return PredictedTracks(
            np.array([p.mean for p in predictions]).reshape(-1, 2),
            np.array(spread).reshape(-1, 2, 2) + noise * np.eye(2),
            Sizes.of_heights(
                np.array([target.height for target in self.targets]),
                np.array([height_noise * (1 + 1 / target.found) for target in self.targets]),
                self.config.body,
            ),
            DETECTED_LOG_ODDS - EXISTENCE_DECAY * missed,
        )

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once."""
        self.begun = True
        images = [view and view.image for view in colour_views(observed, "belief", fused.frame)]
        self._follow(fused.frame, images)
        found = self._find(fused, images)
        events = self._end(fused.frame) + self._begin(fused, found, images)
        visible = [t for t in self.targets if t.missed == 0 or t.star.visibility.max(initial=0.0) >= _LEAST_VISIBILITY]
        return [self._commit(fused, visible, events)]

    def _follow(self, frame: int, images: list[Bytes | None]) -> None:
        likelihoods = target_likelihoods(self.targets, self.views, images, self.motion, self.config.belief)
        rngs = [self._rng(frame, target.track) for target in self.targets]
        follow = _METHODS[self.config.belief.method]
        stars = follow([target.star for target in self.targets], likelihoods, self.motion, self.config.belief, rngs)
        for target, star in zip(self.targets, stars, strict=True):
            target.star = star

    def _rng(self, frame: int, track: int) -> np.random.Generator:
        """Random numbers of one target in one frame, independent of the other targets."""
        return np.random.default_rng([self.config.belief.seed, track, frame])

    def _find(self, fused: FusedFrame, images: list[Bytes | None]) -> Ints:
        """Assign detections to targets; the target of each detection, int64 (n,), -1 for unassigned."""
        people = fused.people
        ground = np.array([target.star.ground.mean for target in self.targets]).reshape(-1, 2)
        rows, columns = assign(distances(people.ground, ground), self.config.belief.assignment_distance)
        target_of = np.full(len(people), -1, np.int64)
        target_of[rows] = columns
        for target in self.targets:
            target.missed += 1
        share = 1 - np.exp(-self.motion.seconds / self.config.belief.colour_memory)
        nearer = [in_front(people.ground, people.height, view) for view in self.views]
        for person, k in zip(rows.tolist(), columns.tolist(), strict=True):
            target = self.targets[k]
            target.found, target.missed = target.found + 1, 0
            target.height += (float(people.height[person]) - target.height) / min(target.found, _HEIGHT_FRAMES)
            target.learn(self.views, images, people.ground[person], [n[person] for n in nearer], share)
        return target_of

    def _end(self, frame: int) -> list[Event]:
        """Remove targets that left the area, and those undetected for longer than their age or patience."""
        events: list[Event] = []
        patience = round(self.config.belief.patience * self.rig.frame_rate)
        for target in list(self.targets):
            outside = self.border.away(target.star.ground.mean[None])[0] == 0.0
            if target.missed and outside:
                reason = "left the area"
            elif target.missed > min(patience, target.found):
                visible = target.star.visibility.max(initial=0.0) >= _LEAST_VISIBILITY
                colours = "seen" if visible else "not seen"
                reason = f"nobody was found there for {target.missed} frames; its colours were {colours}"
            else:
                continue
            self.targets.remove(target)
            events.append((frame, "death", target.track, 0, reason))
        return events

    def _begin(self, fused: FusedFrame, target_of: Ints, images: list[Bytes | None]) -> list[Event]:
        """Births: a target for each unassigned detection."""
        events: list[Event] = []
        people = fused.people
        nearer = [in_front(people.ground, people.height, view) for view in self.views]
        for k in np.flatnonzero(target_of < 0).tolist():
            self.issued += 1
            rng = self._rng(fused.frame, self.issued)
            height, count = float(people.height[k]), self.config.belief.particles
            target = Target.at(
                self.issued,
                people.ground[k],
                people.covariance[k],
                height,
                len(self.views),
                count,
                self.config.motion.speed_spread,
                rng,
            )
            target.learn(self.views, images, people.ground[k], [n[k] for n in nearer], 1.0)
            self.targets.append(target)
            events.append((fused.frame, "birth", target.track, 0, "a detection where nobody was followed"))
        return events

    def _commit(self, fused: FusedFrame, targets: list[Target], events: list[Event]) -> Commit:
        ids = np.array([target.track for target in targets], np.int64)
        ground = np.array([target.star.ground.mean for target in targets]).reshape(-1, 2)
        covariance: Floats = np.array([target.star.ground.covariance for target in targets]).reshape(-1, 2, 2)
        height, score = (np.array(column, float) for column in ([t.height for t in targets], self._scores(targets)))
        width = np.full(len(targets), self.config.body.width_mean)
        return self.commit(fused, TrackPlaces(ids, ground, covariance, height, width, score), events)

    @staticmethod
    def _scores(targets: list[Target]) -> list[float]:
        """Log-odds that some view sees each target, nats."""
        hidden = [float(np.prod(1 - target.star.visibility).clip(1e-9, 1 - 1e-9)) for target in targets]
        return [float(np.log(1 - share) - np.log(share)) for share in hidden]
