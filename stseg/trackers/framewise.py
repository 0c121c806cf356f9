"""Base of trackers that commit every frame at once."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.sampling import Sampling
from stseg.records.tables import WINDOW
from stseg.trackers.nearest_cells import reached_cells
from stseg.trackers.protocol import Commit, FusedFrame
from stseg.trackers.rows import Event, event_rows, trajectory_rows, views_at


class FramewiseTracker:
    """Commits each frame from the places of its tracks.

    Parameters
    ----------
    rig, config
        The cameras and the grid; the constants of all stages.
    first
        The run's first frame.
    """

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        self.rig, self.config, self.frame = rig, config, first
        self.cell_views = Sampling.of(rig, "point").views()

    def finish(self) -> list[Commit]:
        """No frame is open."""
        return []

    def commit(
        self, fused: FusedFrame, ids: Ints, ground: Floats, covariance: Floats, height: Floats, width: Floats,
        score: Floats, events: list[Event],
    ) -> Commit:  # fmt: skip
        """Commit a frame.

        Parameters
        ----------
        ids : int64 (n,)
            Tracks.
        ground, covariance : float64 (n, 2), (n, 2, 2)
            Metres, square metres.
        height, width, score : float64 (n,)
            Metres, metres, nats.
        """
        grid = self.rig.grid
        label, extent = reached_cells(fused, ground, ids, grid, self.config.occupancy.person_radius)
        views = views_at(self.cell_views, ground, grid)
        rows = trajectory_rows(fused.frame, ids, ground, covariance, height, width, extent, score, views)
        return Commit([fused], label[None], rows, event_rows(events), np.zeros(0, WINDOW))
