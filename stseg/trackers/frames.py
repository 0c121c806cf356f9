"""Per-frame detections with their filter tracks, without a cut: the baseline of the cut."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from stseg.config import Config
from stseg.geometry import Rig
from stseg.records.predicted_tracks import PredictedTracks
from stseg.trackers.framewise import FramewiseTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.tracking.filter.track_filter import TrackFilter


class FrameTracker(FramewiseTracker):
    """Commits the detections of each frame."""

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.filter = TrackFilter(rig.frame_rate, config)

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a frame; None for the first."""
        return self.filter.predict(frame)

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once."""
        del observed
        people, sizes = fused.people, fused.people.sizes
        known = self.filter.issued
        ids = self.filter.update(fused.frame, people, fused.ghosts)
        births = [(fused.frame, "birth", int(i), 0, "nobody known was near") for i in np.sort(ids[ids > known])]
        where = people.ground, people.covariance
        return [self.commit(fused, ids, *where, sizes.height, sizes.width, people.evidence, births)]
