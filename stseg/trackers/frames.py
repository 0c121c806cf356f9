"""Frame by frame, without a cut: whom the pass of each frame found. What the cut is measured against."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from stseg.config import Config
from stseg.geometry import Rig
from stseg.ghosts.expected import Expected
from stseg.identity.walkers import Walkers
from stseg.occupancy.sampling import Sampling
from stseg.trackers.cells import reached_cells
from stseg.trackers.protocol import Commit, Scene, Shown
from stseg.trackers.rows import event_rows, trajectory_rows, views_at
from stseg.tracks import WINDOW


class FrameTracker:
    """Follows people without a cut; every frame is decided as it comes.

    Parameters
    ----------
    rig, config
        The scene, and the constants of all stages.
    first
        The run's first frame; it does not matter here.
    """

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        del first
        self.rig, self.config = rig, config
        self.views = Sampling.of(rig, "point").views()
        self.walkers = Walkers(rig.frame_rate, config.ghosts, config.identity)

    def expected(self, frame: int) -> Expected | None:
        """Whom the frames before lead to expect."""
        return self.walkers.expected(frame)

    def add(self, scene: Scene, shown: Shown) -> list[Commit]:
        """The next frame, decided."""
        del shown
        people = scene.people
        known = self.walkers.issued
        ids = self.walkers.follow(scene.frame, people, scene.ghosts)
        label, extent = reached_cells(scene, people.ground, ids, self.rig.grid, self.config.occupancy.reach)
        births = [(scene.frame, "birth", int(i), 0, "nobody known was near") for i in np.sort(ids[ids > known])]
        rows = trajectory_rows(
            scene.frame, ids, people.ground, people.covariance, people.sizes.height, people.sizes.width, extent,
            people.evidence, views_at(self.views, people.ground, self.rig.grid),
        )  # fmt: skip
        return [Commit([scene], label[None], rows, event_rows(births), np.zeros(0, WINDOW))]

    def finish(self) -> list[Commit]:
        """Nothing is open."""
        return []
