"""Trackers that commit every frame at once, without a cut."""

from typing import ClassVar

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.config import Config
from stseg.geometry import Grid, Rig
from stseg.geometry.nearest_person import nearest_person
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sparse_labels import SparseLabels
from stseg.records.tables import WINDOW
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event, TrackPlaces, event_rows, trajectory_rows
from stseg.tracking.filter.track_filter import TrackFilter


class FramewiseTracker:
    """Base of trackers that commit each frame from the places of its tracks; see `TrackingMethod`."""

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        self.rig, self.config, self.frame = rig, config, first

    def finish(self) -> list[Commit]:
        """No frame is open."""
        return []

    def commit(self, fused: FusedFrame, tracks: TrackPlaces, events: list[Event]) -> Commit:
        """Commit a frame with its tracks and events."""
        grid, reach = self.rig.grid, self.config.occupancy.person_radius
        label, extent = _reached_cells(fused, tracks.ground, tracks.ids, grid, reach)
        rows = trajectory_rows(fused.frame, tracks, extent)
        return Commit([fused], [SparseLabels.whole(label)], rows, event_rows(events), np.zeros(0, WINDOW))


class FrameTracker(FramewiseTracker):
    """Detections of each frame with their filter tracks: the baseline of the cut."""

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.filter = TrackFilter(rig.frame_rate, config)

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a frame; None for the first."""
        return self.filter.predict(frame)

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once."""
        people, issued = fused.people, self.filter.issued
        ids = self.filter.update(fused.frame, people, fused.ghosts, observed.evidence)
        births = [(fused.frame, "birth", int(i), 0, "nobody known was near") for i in np.sort(ids[ids > issued])]
        sizes = people.sizes.measured(self.config.body)
        tracks = TrackPlaces(ids, people.ground, people.covariance, *sizes, people.evidence)
        return [self.commit(fused, tracks, births)]


def _reached_cells(fused: FusedFrame, ground: Floats, ids: Ints, grid: Grid, reach: float) -> tuple[Labels, Floats]:
    """Label the occupied cells of a frame with the nearest track within reach, metres.

    Returns the track ids of the cells, int32 (plane, y, x), 0 for background, and the ground area of each track,
    float64 (n,), square metres. `ground` float64 (n, 2) are places of the tracks, metres, `ids` int64 (n,) their
    numbers.
    """
    nearest = nearest_person(grid.ground, ground, reach)
    occupied = (fused.log_odds > 0) & (nearest >= 0)
    label = np.where(occupied, np.append(ids, 0)[nearest], 0).astype(np.int32)
    cells = np.bincount(nearest[occupied.any(0)], minlength=len(ids))[: len(ids)]
    return label, np.asarray(cells * grid.cell**2, float)
