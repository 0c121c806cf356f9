"""From what the views show and who explains it to the frame's volume of log-odds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logit

from stseg.arrays import Boxes, Bytes, Flags, Floats, Ints, Singles, ViewEvidence
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig, OccupancyConfig
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable
from stseg.geometry.cell_means import CellMeans
from stseg.geometry.nearest_person import nearest_person
from stseg.geometry.sampling import Sampling
from stseg.geometry.summed_area import TOP, UNSEEN, Levels
from stseg.model.box_fit import TOLERANCE
from stseg.model.box_likelihood import box_likelihood
from stseg.model.people import Explanation
from stseg.occupancy.box_planes import fill_match_of_planes, plane_likelihood
from stseg.occupancy.clutter import clutter, clutter_side, clutter_weights
from stseg.occupancy.fusion import Accumulator, ErrorRates, log_odds_terms
from stseg.occupancy.rate_calibration import RateCalibration, cells_per_person, fill_counts, inside_bodies
from stseg.occupancy.unexplained import PixelAssignment, fill_share, leave_unexplained

_MAP_STEP = 8
_BESIDE = 0.0
"""Log-odds of a cell within reach of a person before any view is asked, nats."""
_WHOLE = 0.99
"""Share of what a view shows of an unhidden body from which on it counts as unhidden."""


class _Said(NamedTuple):
    """What one view gave to a frame's sums; see `stseg.occupancy.fusion.add_terms`."""

    levels: Levels
    terms: Singles
    weight: float
    share: Singles
    faith: Singles


class Occupancy:
    """Fusion of one rig's views: tables are made once, frames are fused one by one."""

    def __init__(
        self,
        rig: Rig,
        kinds: Sequence[str],
        config: OccupancyConfig,
        detection: DetectionConfig,
        body: BodyConfig,
        level: ErrorRateConfig | None = None,
    ) -> None:
        self.rig, self.config = rig, config
        self.sampling = Sampling.of(rig, config.sampling)
        self.views: Bytes = self.sampling.views()
        self.means = CellMeans(self.sampling)
        self.heights = np.asarray(body.heights)
        self.height_mean, self.height_spread = body.height_mean, body.height_spread
        flat = rig.grid.ground.reshape(-1, 2)
        shape = (len(self.heights), *rig.grid.shape[1:], 4)
        self.bodies = [
            BodyTable.of(camera, rig.grid).boxes(flat, self.heights).reshape(shape).astype(np.float32)
            if kind == "boxes"
            else np.zeros((0, 0, 0, 4), np.float32)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        self._first = [_first_rates(kind, detection) for kind in kinds]
        self._level_config = level or ErrorRateConfig()
        self.prior = float(logit(config.occupied_share))

    def new_calibration(self) -> RateCalibration:
        """Error-rate calibration of a session that begins: the first guess."""
        return RateCalibration(self._first, self.rig.frame_rate, self._level_config)

    def fuse(
        self, seen: Sequence[ViewEvidence], explanation: Explanation, rates: Sequence[ErrorRates] | None = None
    ) -> Singles:
        """A frame's log-odds, float32 (plane, y, x), nats; nan where no view sees the cell.

        pi is one half within reach of a person whom the pass of the frame found, where only the cells are left to
        decide, and `occupied` elsewhere.

        Parameters
        ----------
        seen, explanation
            Evidence of each view, and the people that explain it.
        rates
            Error rates of each view; by default the first guess.
        """
        rates = rates or self.new_calibration().rates
        near = nearest_person(self.rig.grid.ground, explanation.people.ground, self.config.person_radius)
        return self._total(self._tally(self._said(seen, explanation, near, rates), near), near)

    def fuse_and_learn(
        self, calibration: RateCalibration, seen: Sequence[ViewEvidence], explanation: Explanation
    ) -> Singles:
        """The same of a session's next frame, with which the session's error-rate calibration is then updated."""
        near = nearest_person(self.rig.grid.ground, explanation.people.ground, self.config.person_radius)
        said = self._said(seen, explanation, near, calibration.rates)
        tally = self._tally(said, near)
        total = self._total(tally, near)
        self._learn(calibration, said, tally, explanation, near)
        return total

    def _said(
        self, seen: Sequence[ViewEvidence], explanation: Explanation, near: Ints, all_rates: Sequence[ErrorRates]
    ) -> list[_Said | None]:
        weights = clutter_weights(np.array([self._clutter(i, view) for i, view in enumerate(seen)]))
        said: list[_Said | None] = []
        for i, (view, weight, rates) in enumerate(zip(seen, weights, all_rates, strict=True)):
            if view is None:
                said.append(None)
                continue
            owners = self._owners(i, explanation)
            share, shared = self._share(i, owners, near)
            if isinstance(view, Boxes):
                levels = self._levels_of_boxes(i, view, explanation, near, rates)
                faith = _faith(near, owners.own, explanation.people.visibility[i], share.shape)
            else:
                levels = self._levels_of_map(i, view, owners, near, share, shared).copy()
                faith = np.ones_like(share)
            said.append(_Said(levels, log_odds_terms(rates), weight, share, faith))
        return said

    def _tally(self, said: Sequence[_Said | None], near: Ints) -> Accumulator:
        tally = Accumulator(self.rig.grid.shape)
        for view in said:
            if view is not None:
                tally.add(*view, near)
        return tally

    def _total(self, tally: Accumulator, near: Ints) -> Singles:
        return tally.total(self.views, near, self.config.effective_observations, (self.prior, _BESIDE))

    def _learn(
        self,
        calibration: RateCalibration,
        said: Sequence[_Said | None],
        tally: Accumulator,
        explanation: Explanation,
        near: Ints,
    ) -> None:
        people, grid = explanation.people, self.rig.grid
        inside = inside_bodies(grid, near, people.ground, people.height)
        body, reached = cells_per_person(grid, self.height_mean, self.config.person_radius)
        errors, seen = np.zeros((2, len(said), 3))
        for i, (view, rates) in enumerate(zip(said, calibration.rates, strict=True)):
            if view is not None:
                trusted = people.evidence - people.view_evidence[i] >= calibration.config.minimum_evidence
                trusted &= people.visibility[i] >= _WHOLE
                fill_counts(
                    *view, tally.weighted, tally.weights, tally.count, near, inside, trusted,
                    np.array(rates), self.config.effective_observations, self.prior, errors[i], seen[i],
                )  # fmt: skip
        everywhere = np.maximum((self.sampling.footprint[..., 2] > 0).sum((1, 2, 3)), 1)
        units = np.column_stack([np.full(len(said), body), everywhere, np.full(len(said), reached - body)])
        sure = np.append(people.evidence >= calibration.config.minimum_evidence, False)[near]
        counted = (self.views > 0) & sure
        filled = np.array([inside[counted].sum(), counted.sum()]) / reached
        calibration.learn(errors / units, seen / units, filled)

    def _owners(self, i: int, explanation: Explanation) -> PixelAssignment:
        people, served = explanation.people, explanation.box_assignment[i]
        own = np.zeros(len(people) + 1, bool)
        own[served[served >= 0]] = True
        camera, step = self.rig.cameras[i], explanation.raster_step[i]
        width, height = camera.size
        away = np.hypot(*(people.ground - camera.centre[:2]).T)
        return PixelAssignment(
            explanation.pixel_assignment[i], step, np.arange(height) // step, np.arange(width) // step, away, own
        )

    def _share(self, i: int, owners: PixelAssignment, near: Ints) -> tuple[Singles, Flags]:
        """How much of each cell the view sees past nearer people, and whether its footprint shows anybody else."""
        share, shared = np.empty(self.rig.grid.shape, np.float32), np.empty(self.rig.grid.shape, bool)
        fill_share(self.sampling.footprint[i], *owners, near, self.sampling.distance[i], share, shared)
        return share, shared

    def _levels_of_map(
        self, i: int, view: Singles, owners: PixelAssignment, near: Ints, share: Singles, shared: Flags
    ) -> Levels:
        """Mean likelihood that the explanation leaves each cell."""
        table = self.means.sum_table(i, view)
        levels = self.means.levels_from(i, table)
        leave_unexplained(
            self.sampling.footprint[i], table.sums, table.left, table.top, owners.raster, owners.step, owners.row,
            owners.column, near, share, shared, levels,
        )  # fmt: skip
        return levels

    def _levels_of_boxes(self, i: int, view: Boxes, explanation: Explanation, near: Ints, rates: ErrorRates) -> Levels:
        """Likelihood per plane of each cell."""
        match = np.zeros(self.rig.grid.shape, np.float32)
        edges = np.concatenate([view.pixel[:, :2], view.pixel[:, :2] + view.pixel[:, 2:]], 1)
        width, height = map(float, self.rig.cameras[i].size)
        edges = edges.clip(0, [width - 1, height - 1] * 2)
        belief = np.log(view.score.clip(0.05, 1.0))
        fill_match_of_planes(
            self.bodies[i], self.heights, self.height_spread, self.height_mean, explanation.people.height,
            self.rig.grid.heights, edges, TOLERANCE, belief, explanation.box_assignment[i], near, width, height, match,
        )  # fmt: skip
        levels = np.rint(plane_likelihood(match, near, rates) * TOP).astype(np.int16)
        levels[self.sampling.footprint[i, ..., 2] == 0] = UNSEEN
        return levels

    def _clutter(self, i: int, view: ViewEvidence) -> float:
        size = self.rig.cameras[i].size
        side = clutter_side(size, _MAP_STEP)
        if view is None:
            return float("nan")
        if isinstance(view, Boxes):
            return clutter(box_likelihood(view, size, _MAP_STEP), side // _MAP_STEP)
        return clutter(view, side)


def _first_rates(kind: str, detection: DetectionConfig) -> ErrorRates:
    """Before anything is learned, people's surroundings count as any other place."""
    if kind == "boxes":
        clutter = (1 - detection.box_miss_rate) / float(np.exp(detection.box_log_ratio))
        return ErrorRates(detection.box_miss_rate, clutter, clutter)
    return ErrorRates(detection.pixel_miss_rate, detection.pixel_clutter_rate, detection.pixel_clutter_rate)


def _faith(near: Ints, own: Flags, visible: Floats, shape: tuple[int, ...]) -> Singles:
    """How much a missing box says: as much as the view can see of the person near the cell, float32 (plane, y, x)."""
    missing = np.where(own, 1.0, np.append(visible, 1.0))
    return np.ascontiguousarray(np.broadcast_to(missing[near], shape), np.float32)
