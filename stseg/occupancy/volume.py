"""From what the views show and who explains it to the frame's volume of log-odds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Bytes, Ints, Singles
from stseg.config import GhostConfig, OccupancyConfig
from stseg.foreground import box_likelihood
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable
from stseg.geometry.near import near_person
from stseg.ghosts.explain import Explanation, ViewEvidence
from stseg.occupancy.clutter import clutter, clutter_weights
from stseg.occupancy.fusion import Rates, fill_log_odds, fill_terms
from stseg.occupancy.instances import fill_likelihood
from stseg.occupancy.sampling import Sampling

_MAP_STEP = 8
_NO_MAP = np.zeros((0, 0), np.float32)
_NO_PLANES = np.zeros((0, 0, 0), np.float32)


class Occupancy:
    """Fusion of one rig's views: tables are made once, frames are fused one by one."""

    def __init__(self, rig: Rig, kinds: Sequence[str], config: OccupancyConfig, ghosts: GhostConfig) -> None:
        self.rig, self.config = rig, config
        self.sampling = Sampling.of(rig)
        self.views: Bytes = self.sampling.views()
        self.heights = np.asarray(ghosts.heights)
        self.height_mean, self.height_spread = ghosts.height_mean, ghosts.height_spread
        flat = rig.grid.ground.reshape(-1, 2)
        shape = (len(self.heights), *rig.grid.shape[1:], 4)
        self.bodies = [
            BodyTable.of(camera, rig.grid).boxes(flat, self.heights).reshape(shape).astype(np.float32)
            if kind == "boxes"
            else np.zeros((0, 0, 0, 4), np.float32)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        box_clutter = (1 - ghosts.box_miss) / float(np.exp(ghosts.hit))
        self.rates = [
            Rates(ghosts.box_miss, box_clutter) if kind == "boxes" else Rates(ghosts.pixel_miss, ghosts.pixel_clutter)
            for kind in kinds
        ]
        self.clutter_side = [_clutter_side(camera.size) for camera in rig.cameras]

    def fuse(self, seen: Sequence[ViewEvidence], explanation: Explanation) -> Singles:
        """The frame's log-odds, float32 (plane, y, x), nats; nan where no view sees the cell."""
        shape = self.rig.grid.shape
        weighted, weights, count = np.zeros(shape), np.zeros(shape), np.zeros(shape, np.uint8)
        near = near_person(self.rig.grid.ground, explanation.people.ground, self.config.reach)
        share = clutter_weights(np.array([self._clutter(i, view) for i, view in enumerate(seen)]))
        for i, (camera, view) in enumerate(zip(self.rig.cameras, seen, strict=True)):
            if view is None:
                continue
            people = len(explanation.people)
            has_box = np.zeros(people + 1, bool)
            has_box[explanation.box_owner[i][explanation.box_owner[i] >= 0]] = True
            away = np.hypot(*(explanation.people.ground - camera.centre[:2]).T)
            likelihood, per_plane = self._likelihood(i, view, explanation, near)
            fill_terms(
                self.sampling.pixel[i], likelihood, per_plane, explanation.owner[i], explanation.raster_step[i], near,
                has_box, explanation.people.visible[i], self.sampling.distance[i], away, self.rates[i], share[i],
                weighted, weights, count,
            )  # fmt: skip
        log_odds = np.empty(shape, np.float32)
        prior = float(np.log(self.config.occupied / (1 - self.config.occupied)))
        fill_log_odds(weighted, weights, count, self.views, near, prior, log_odds)
        return log_odds

    def _likelihood(
        self, i: int, view: Boxes | Singles, explanation: Explanation, near: Ints
    ) -> tuple[Singles, Singles]:
        """The view's map, or its likelihood per plane; the other is empty."""
        if not isinstance(view, Boxes):
            return view, _NO_PLANES
        per_plane = np.zeros(self.rig.grid.shape, np.float32)
        edges = np.concatenate([view.pixel[:, :2], view.pixel[:, :2] + view.pixel[:, 2:]], 1)
        width, height = map(float, self.rig.cameras[i].size)
        edges = edges.clip(0, [width - 1, height - 1] * 2)
        belief = np.log(view.score.clip(0.05, 1.0))
        fill_likelihood(
            self.bodies[i], self.heights, self.height_spread, self.height_mean, explanation.people.height,
            self.rig.grid.heights, edges, belief, explanation.box_owner[i], near, width, height, per_plane,
        )  # fmt: skip
        return _NO_MAP, per_plane

    def _clutter(self, i: int, view: ViewEvidence) -> float:
        if view is None:
            return float("nan")
        if isinstance(view, Boxes):
            return clutter(box_likelihood(view, self.rig.cameras[i].size, _MAP_STEP), self.clutter_side[i] // _MAP_STEP)
        return clutter(view, self.clutter_side[i])


def _clutter_side(size: tuple[int, int]) -> int:
    """A quarter of the image: near people are taller than half of that, the cell that KS09 asks for."""
    return max(min(size) // 4, _MAP_STEP)
