"""Frame by frame, without a cut: whom the pass of each frame found. What the cut is measured against."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.near import near_person
from stseg.ghosts.expected import Expected
from stseg.identity.walkers import Walkers
from stseg.occupancy.sampling import Sampling
from stseg.trackers.protocol import Commit, Scene
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

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        del first
        self.rig, self.config = rig, config
        self.views = Sampling.of(rig, "point").views()
        self.walkers = Walkers(rig.frame_rate, config.ghosts, config.identity)

    def expected(self, frame: int) -> Expected | None:
        """Whom the frames before lead to expect."""
        return self.walkers.expected(frame)

    def add(self, scene: Scene) -> list[Commit]:
        """The next frame, decided."""
        people = scene.people
        known = self.walkers.issued
        ids = self.walkers.follow(scene.frame, people, scene.ghosts)
        label, extent = self._label(scene, ids)
        births = [(scene.frame, "birth", int(i), 0, "nobody known was near") for i in np.sort(ids[ids > known])]
        rows = trajectory_rows(
            scene.frame, ids, people.ground, people.covariance, people.sizes.height, people.sizes.width, extent,
            people.evidence, views_at(self.views, people.ground, self.rig.grid),
        )  # fmt: skip
        return [Commit([scene], label[None], rows, event_rows(births), np.zeros(0, WINDOW))]

    def finish(self) -> list[Commit]:
        """Nothing is open."""
        return []

    def _label(self, scene: Scene, ids: Ints) -> tuple[Labels, Floats]:
        """Occupied cells within each person's reach, int32 (plane, y, x), and their ground area, float64 (n,)."""
        grid = self.rig.grid
        near = near_person(grid.ground, scene.people.ground, self.config.occupancy.reach)
        occupied = (scene.log_odds > 0) & (near >= 0)
        label = np.where(occupied, np.append(ids, 0)[near], 0).astype(np.int32)
        cells = np.bincount(near[occupied.any(0)], minlength=len(ids))[: len(ids)]
        return label, np.asarray(cells * grid.cell**2, float)
