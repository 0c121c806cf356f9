"""Occupancy of a frame: from the evidence of the views and its explanation to a volume of log-odds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logit

from stseg.arrays import Boxes, Bytes, Flags, Floats, Ints, Singles, ViewEvidence
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig, OccupancyConfig
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable
from stseg.geometry.cell_means import CellMeans
from stseg.geometry.nearest_person import nearest_person
from stseg.geometry.sampling import Sampling
from stseg.geometry.summed_area import UNSEEN, Levels
from stseg.model.box_likelihood import box_likelihood
from stseg.model.box_noise import FIRST, BoxNoise
from stseg.model.people import Explanation
from stseg.model.pillar_index import PillarIndex
from stseg.occupancy.box_planes import CellsByPerson, ViewBoxes, fill_fit, fill_levels
from stseg.occupancy.clutter import clutter, clutter_side, clutter_weights
from stseg.occupancy.fusion import ErrorRates, Sums, ViewTerms, add_terms, log_odds_terms
from stseg.occupancy.rate_calibration import RateCalibration, cells_per_person, fill_counts, inside_bodies
from stseg.occupancy.visible_cells import PixelAssignment, add_map, fill_occupied, fill_share

_MAP_STEP = 8
_NEAR_PRIOR = 0.0
"""Prior log-odds of a cell within reach of a person, nats."""
_UNOCCLUDED = 0.99
"""Least visible share of a body that counts as unoccluded."""


class Occupancy:
    """Fusion of one rig's views: tables are made once, frames are fused one by one."""

    def __init__(
        self,
        rig: Rig,
        kinds: Sequence[str],
        config: OccupancyConfig,
        detection: DetectionConfig,
        body: BodyConfig,
        rates: ErrorRateConfig | None = None,
    ) -> None:
        self.rig, self.config = rig, config
        self.sampling = Sampling.of(rig, config.sampling)
        self.views: Bytes = self.sampling.views()
        self.heights = np.asarray(body.heights)
        self.height_mean, self.height_spread = body.height_mean, body.height_spread
        self.prior = float(logit(config.occupied_share))
        self._means = CellMeans(self.sampling)
        self._cells = [self.sampling.seen_cells(view) for view in range(len(rig.cameras))]
        self._pillars = [self._pillars_of(view) if kind == "boxes" else None for view, kind in enumerate(kinds)]
        self._first_rates = [_first_rates(kind, detection) for kind in kinds]
        self._ground = rig.grid.ground
        self._rate_config = rates or ErrorRateConfig()
        self._certain = np.ones(rig.grid.shape[1:], np.float32)

    def new_calibration(self) -> RateCalibration:
        """Error-rate calibration of a new session, at the first guess."""
        return RateCalibration(self._first_rates, self.rig.frame_rate, self._rate_config)

    def fuse(
        self,
        seen: Sequence[ViewEvidence],
        explanation: Explanation,
        rates: Sequence[ErrorRates] | None = None,
        noise: BoxNoise = FIRST,
    ) -> Singles:
        """A frame's log-odds, float32 (plane, y, x), nats; nan where no view sees the cell.

        The prior pi is one half within reach of a person of the explanation, whose existence is already
        decided, and `occupied_share` elsewhere.

        Parameters
        ----------
        seen, explanation
            Evidence of each view, and the people that explain it.
        rates
            Error rates of each view; by default the first guess.
        noise
            Noise of boxes; by default the first guess.
        """
        near, sums = self._near(explanation), Sums.zero(self.rig.grid.shape)
        self._add_views(seen, explanation, near, rates or self.new_calibration().rates, noise, sums)
        return self._total(sums, near)

    def fuse_and_learn(
        self,
        calibration: RateCalibration,
        seen: Sequence[ViewEvidence],
        explanation: Explanation,
        noise: BoxNoise = FIRST,
    ) -> Singles:
        """`fuse` of a session's next frame, followed by the update of the session's error rates."""
        near, sums = self._near(explanation), Sums.zero(self.rig.grid.shape)
        views = self._add_views(seen, explanation, near, calibration.rates, noise, sums)
        if calibration.next_is_due():
            self._learn(calibration, views, sums, explanation, near)
        return self._total(sums, near)

    def _near(self, explanation: Explanation) -> Ints:
        return nearest_person(self._ground, explanation.people.ground, self.config.person_radius)

    def _add_views(
        self,
        seen: Sequence[ViewEvidence],
        explanation: Explanation,
        near: Ints,
        rates: Sequence[ErrorRates],
        noise: BoxNoise,
        sums: Sums,
    ) -> list[ViewTerms | None]:
        """Add the terms of all views to the sums; None for a blind view."""
        weights = clutter_weights(np.array([self._clutter(i, view) for i, view in enumerate(seen)]))
        added: list[ViewTerms | None] = []
        for i, (view, weight) in enumerate(zip(seen, weights.astype(np.float32), strict=True)):
            if view is None:
                added.append(None)
            elif isinstance(view, Boxes):
                added.append(self._add_boxes(i, view, explanation, near, rates[i], noise, weight, sums))
            else:
                added.append(self._add_map(i, view, explanation, near, rates[i], weight, sums))
        return added

    def _add_map(
        self,
        i: int,
        view: Singles,
        explanation: Explanation,
        near: Ints,
        rates: ErrorRates,
        weight: np.float32,
        sums: Sums,
    ) -> ViewTerms:
        shape, terms = self.rig.grid.shape, log_odds_terms(rates)
        levels, share = np.full(shape, UNSEEN, np.int16), np.empty(shape, np.float32)
        add_map(
            self._cells[i], self._means.sum_table(i, view), self._assignment(i, explanation), near,
            self.sampling.distance[i], terms, weight, levels, share, sums,
        )  # fmt: skip
        return ViewTerms(levels, terms, weight, share, self._certain)

    def _add_boxes(
        self,
        i: int,
        view: Boxes,
        explanation: Explanation,
        near: Ints,
        rates: ErrorRates,
        noise: BoxNoise,
        weight: np.float32,
        sums: Sums,
    ) -> ViewTerms:
        shown, share = self._assignment(i, explanation), np.empty(self.rig.grid.shape, np.float32)
        fill_share(self._cells[i], shown, near, self.sampling.distance[i], share)
        levels = self._levels_of_boxes(i, view, explanation, near, rates, noise)
        confidence = _confidence(near, shown.separate, explanation.people.visibility[i])
        added = ViewTerms(levels, log_odds_terms(rates), weight, share, confidence)
        add_terms(added, near, sums)
        return added

    def _total(self, sums: Sums, near: Ints) -> Singles:
        return sums.total(self.views, near, self.config.effective_observations, (self.prior, _NEAR_PRIOR))

    def _learn(
        self,
        calibration: RateCalibration,
        views: Sequence[ViewTerms | None],
        sums: Sums,
        explanation: Explanation,
        near: Ints,
    ) -> None:
        people, grid = explanation.people, self.rig.grid
        inside = inside_bodies(grid, near, people.ground, people.height)
        body, reached = cells_per_person(grid, self.height_mean, self.config.person_radius)
        errors, seen = np.zeros((2, len(views), 3))
        for i, (view, rates) in enumerate(zip(views, calibration.rates, strict=True)):
            if view is not None:
                trusted = people.evidence - people.view_evidence[i] >= calibration.config.minimum_evidence
                trusted &= people.visibility[i] >= _UNOCCLUDED
                fill_counts(
                    view, sums, near, inside, trusted, np.array(rates), self.config.effective_observations, self.prior,
                    errors[i], seen[i],
                )  # fmt: skip
        seen_cells = np.maximum([len(cells.place) for cells in self._cells], 1)
        units = np.column_stack([np.full(len(views), body), seen_cells, np.full(len(views), reached - body)])
        supported = np.append(people.evidence >= calibration.config.minimum_evidence, False)[near]
        counted = (self.views > 0) & supported
        filled = np.array([inside[counted].sum(), counted.sum()]) / reached
        calibration.learn(errors / units, seen / units, filled, calibration.interval)

    def _assignment(self, i: int, explanation: Explanation) -> PixelAssignment:
        people, assigned = explanation.people, explanation.box_assignment[i]
        separate = np.zeros(len(people) + 1, bool)
        separate[assigned[assigned >= 0]] = True
        camera, step, raster = self.rig.cameras[i], explanation.raster_step[i], explanation.pixel_assignment[i]
        width, height = camera.size
        distance = np.hypot(*(people.ground - camera.centre[:2]).T)
        occupied = np.empty((raster.shape[0] + 1, raster.shape[1] + 1), np.int32)
        fill_occupied(raster, occupied)
        return PixelAssignment(
            raster, occupied, step, np.arange(height) // step, np.arange(width) // step, distance, separate
        )

    def _pillars_of(self, i: int) -> tuple[Singles, PillarIndex]:
        """Boxes of the pillars of all heights at all cells, float32 (height * cell, 4), and their index."""
        camera, grid = self.rig.cameras[i], self.rig.grid
        bodies = BodyTable.of(camera, grid).boxes(grid.ground.reshape(-1, 2), self.heights)
        pillars = bodies.reshape(-1, 4).astype(np.float32)
        return pillars, PillarIndex.of(pillars, camera.size)

    def _levels_of_boxes(
        self, i: int, view: Boxes, explanation: Explanation, near: Ints, rates: ErrorRates, noise: BoxNoise
    ) -> Levels:
        """Likelihood per plane of each cell."""
        pillars = self._pillars[i]
        assert pillars is not None, "the view was to deliver boxes"
        people, grid, levels = explanation.people, self.rig.grid, np.empty(self.rig.grid.shape, np.int16)
        edges = np.concatenate([view.pixel[:, :2], view.pixel[:, :2] + view.pixel[:, 2:]], 1)
        width, height = map(float, self.rig.cameras[i].size)
        edges = edges.clip(0, [width - 1, height - 1] * 2)
        boxes = ViewBoxes(edges, *noise.of(view.score), explanation.box_assignment[i], width, height)
        fit = np.empty((len(self.heights), near.size), np.float32)
        fill_fit(
            pillars[1], pillars[0], self._height_prior(np.array([self.height_mean]))[0],
            self._height_prior(people.height), boxes, CellsByPerson.of(near, len(people)), fit,
        )  # fmt: skip
        footprint = self.sampling.footprint[i].reshape(len(levels), -1, 4)
        flat = levels.reshape(len(levels), -1)
        fill_levels(fit, self.heights, grid.heights, near.reshape(-1), footprint, rates, flat)
        return levels

    def _height_prior(self, expected: Floats) -> Floats:
        """Log-prior of `self.heights` around expected heights (n,), metres; float64 (n, height)."""
        return np.asarray(-0.5 * ((self.heights - expected[:, None]) / self.height_spread) ** 2)

    def _clutter(self, i: int, view: ViewEvidence) -> float:
        size = self.rig.cameras[i].size
        side = clutter_side(size, _MAP_STEP)
        if view is None:
            return float("nan")
        if isinstance(view, Boxes):
            return clutter(box_likelihood(view, size, _MAP_STEP), side // _MAP_STEP)
        return clutter(view, side)


def _first_rates(kind: str, detection: DetectionConfig) -> ErrorRates:
    """First guess: the same clutter near people as elsewhere."""
    if kind == "boxes":
        clutter_rate = (1 - detection.box_miss_rate) / float(np.exp(detection.box_log_ratio))
        return ErrorRates(detection.box_miss_rate, clutter_rate, clutter_rate)
    return ErrorRates(detection.pixel_miss_rate, detection.pixel_clutter_rate, detection.pixel_clutter_rate)


def _confidence(near: Ints, separate: Flags, visibility: Floats) -> Singles:
    """Confidence of a view with boxes, float32 (y, x): 1, but near a person without a box the person's visibility."""
    missing = np.where(separate, 1.0, np.append(visibility, 1.0))
    return np.asarray(missing[near], np.float32)
