"""Frame by frame, without a cut: whom the pass of each frame found. What the cut is measured against."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from stseg.config import Config
from stseg.geometry import Rig
from stseg.model.predicted_tracks import PredictedTracks
from stseg.trackers.framewise import EachFrame
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.tracking.track_filter import TrackFilter


class FrameTracker(EachFrame):
    """Follows people without a cut."""

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.walkers = TrackFilter(rig.frame_rate, config)

    def expected(self, frame: int) -> PredictedTracks | None:
        """Whom the frames before lead to expect."""
        return self.walkers.expected(frame)

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """The next frame, decided."""
        del shown
        people, sizes = scene.people, scene.people.sizes
        known = self.walkers.issued
        ids = self.walkers.follow(scene.frame, people, scene.ghosts)
        births = [(scene.frame, "birth", int(i), 0, "nobody known was near") for i in np.sort(ids[ids > known])]
        where = people.ground, people.covariance
        return [self.commit(scene, ids, *where, sizes.height, sizes.width, people.evidence, births)]
