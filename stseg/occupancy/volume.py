"""Occupancy of a frame: from the evidence of the views and its explanation to a volume of log-odds."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stseg.arrays import Boxes, Bytes, Flags, Floats, Ints, Singles, ViewEvidence
from stseg.bodies.box_fit import PRIOR_NOISE, BoxNoise, ViewBoxes
from stseg.bodies.box_likelihood import box_likelihood
from stseg.bodies.covered_feet import are_feet_covered
from stseg.bodies.pillar_index import PillarIndex
from stseg.bodies.pillars import BodyTable, inside_bodies
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig, OccupancyConfig
from stseg.geometry import Rig
from stseg.geometry.nearest_person import nearest_person
from stseg.geometry.sampling import Sampling
from stseg.geometry.summed_area import UNSEEN, Levels, SumTable
from stseg.occupancy.box_planes import CellFit, Vicinity, fill_fit, fill_levels, level_of_match
from stseg.occupancy.clutter import clutter, clutter_side, clutter_weights
from stseg.occupancy.error_rate_estimate import ErrorRateEstimate, cells_per_person, fill_counts
from stseg.occupancy.fusion import ErrorRates, FrameTerms, Sums, log_odds_terms
from stseg.occupancy.revision import NEAR_PRIOR, cell_prior_log_odds
from stseg.occupancy.shown_cells import CellTables, ShownCells, mark_map
from stseg.occupancy.visible_cells import PixelAssignment, fill_empty, fill_map, fill_share, mark_people
from stseg.records.people import Explanation
from stseg.records.sparse_volume import SparseVolume

_MAP_STEP = 8
_UNOCCLUDED = 0.99
"""Least share of a whole body's detection rate at which it counts as unoccluded."""


class _PreparedView(NamedTuple):
    """A view in a frame: its people, blocks that show them or foreground, and the sums of its map.

    Or the fit of its boxes, with the blocks of the ground near people or above which a box might show something.
    """

    assignment: PixelAssignment
    marked: Flags
    table: SumTable | None
    fit: tuple[CellFit, Flags] | None


class _Fused(NamedTuple):
    """The cells of a frame, the person near each ground cell in block order, the views' terms, and their sums."""

    cells: ShownCells
    near_person: Ints
    terms: FrameTerms
    sums: Sums


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
        sampling = Sampling.of(rig, config.sampling)
        self.views: Bytes = sampling.views()
        self.heights = np.asarray(body.heights)
        self.height_mean, self.height_spread, self._breadth = body.height_mean, body.height_spread, body.breadth
        self.prior = cell_prior_log_odds(config)
        self._sums = [SumTable.over(region) for region in sampling.regions()]
        self._tables = CellTables(sampling.footprint)
        order = self._tables.ground
        self._ground = rig.grid.ground.reshape(-1, 2).take(order, 0)
        self._distance = sampling.distance.reshape(len(kinds), -1).take(order, 1)
        self._pillars = [self._pillars_of(view) if kind == "boxes" else None for view, kind in enumerate(kinds)]
        self._memory = np.empty(0, np.int16), np.empty(0, np.float32), np.empty(0, np.float32)
        self._first_rates = [_first_rates(kind, detection) for kind in kinds]
        self._rate_config = rates or ErrorRateConfig()

    def new_error_rates(self) -> ErrorRateEstimate:
        """Error rates of a new session, at the first guess."""
        return ErrorRateEstimate(self._first_rates, self.rig.frame_rate, self._rate_config)

    def fuse(
        self,
        evidence: Sequence[ViewEvidence],
        explanation: Explanation,
        rates: Sequence[ErrorRates] | None = None,
        noise: BoxNoise = PRIOR_NOISE,
    ) -> SparseVolume:
        """A frame's log-odds, nats; nan where no view sees the cell.

        The prior pi is one half within reach of a person of the explanation, since existence is already
        decided there, and `occupied_share` elsewhere. The explanation is that of the evidence of all views; error
        rates and the noise of boxes are the first guess if they are not given.
        """
        return self._volume(self._fused(evidence, explanation, rates or self.new_error_rates().rates, noise))

    def fuse_and_learn(
        self,
        estimate: ErrorRateEstimate,
        evidence: Sequence[ViewEvidence],
        explanation: Explanation,
        noise: BoxNoise = PRIOR_NOISE,
    ) -> SparseVolume:
        """`fuse` of a session's next frame, followed by the update of the session's error rates."""
        fused = self._fused(evidence, explanation, estimate.rates, noise)
        if estimate.next_is_due():
            self._learn(estimate, fused, explanation)
        return self._volume(fused)

    def _fused(
        self, evidence: Sequence[ViewEvidence], explanation: Explanation, rates: Sequence[ErrorRates], noise: BoxNoise
    ) -> _Fused:
        near_person = nearest_person(self._ground, explanation.people.ground, self.config.person_radius)
        vicinity = Vicinity.of(near_person, len(explanation.people))
        views = [
            None if view is None else self._prepared(i, view, explanation, vicinity, noise)
            for i, view in enumerate(evidence)
        ]
        columns = [view.fit[1] for view in views if view is not None and view.fit is not None]
        columns = columns or [self._columns(near_person >= 0)]
        marked = [view.marked for view in views if view is not None]
        above = np.tile(np.logical_or.reduce(columns), self.rig.grid.planes)
        cells = self._tables.cells_at(np.logical_or.reduce([above, *marked]), near_person)
        weights = clutter_weights(np.array([self._clutter(i, view) for i, view in enumerate(evidence)]))
        terms = self._terms(views, cells, explanation, rates, weights.astype(np.float32))
        memory = self._memory_of(len(views), len(cells.near_person))[2]
        return _Fused(cells, near_person, terms, Sums.of(terms, memory))

    def _prepared(
        self, i: int, view: Boxes | Singles, explanation: Explanation, vicinity: Vicinity, noise: BoxNoise
    ) -> _PreparedView:
        assignment, marked = self._assignment(i, explanation), self._tables.nothing_marked()
        mark_people(self._tables.reach[i], assignment, marked)
        if isinstance(view, Boxes):
            fit = self._fit(i, view, explanation, vicinity, noise)
            columns = self._columns(fit.found | (vicinity.near_person >= 0))
            return _PreparedView(assignment, marked, None, (fit, columns))
        table = self._sums[i].filled(view)
        mark_map(self._tables.reach[i], table, marked)
        return _PreparedView(assignment, marked, table, None)

    def _columns(self, places: Flags) -> Flags:
        """The blocks of the ground that have one of the places (place,), bool (block of one plane,)."""
        return np.logical_or.reduceat(places, self._tables.ground_start)

    def _terms(
        self,
        views: Sequence[_PreparedView | None],
        cells: ShownCells,
        explanation: Explanation,
        rates: Sequence[ErrorRates],
        weights: Singles,
    ) -> FrameTerms:
        """Terms of the views at the cells that are fused one by one, and at the representatives of the others."""
        levels, share = self._memory_of(len(views), len(cells.near_person))[:2]
        confidence = np.ones((len(views), len(explanation.people)), np.float32)
        for i, view in enumerate(views):
            if view is None:
                levels[i] = UNSEEN
                continue
            if view.fit is not None:
                confidence[i] = np.where(view.assignment.separate[:-1], 1.0, explanation.people.found_share[i])
            self._fill_view(i, view, cells, rates[i], levels[i], share[i])
        terms = np.stack([log_odds_terms(one) for one in rates])
        return FrameTerms(levels, share, cells.near_person, terms, weights, confidence)

    def _fill_view(
        self, i: int, view: _PreparedView, cells: ShownCells, rates: ErrorRates, levels: Levels, share: Singles
    ) -> None:
        """Fill levels and share (n + k,) of a view."""
        tables, assignment, distance = self._tables, view.assignment, self._distance[i]
        footprint, unseen = tables.footprint[i], tables.unseen[i]
        if view.table is not None:
            fill_empty(cells, unseen, view.table.lowest, levels, share)
            at, few = (tables.place, footprint), tables.few[i]
            fill_map(cells, view.marked, *at, view.table, assignment, distance, few, levels, share)
        elif view.fit is not None:
            fill_empty(cells, unseen, int(level_of_match(0.0, rates.miss, rates.clutter)), levels, share)
            fill_share(cells, view.marked, tables.place, footprint, assignment, distance, share)
            planes, (fit, columns) = self.rig.grid.heights, view.fit
            fill_levels(fit, self.heights, planes, cells, columns, tables.place, rates, levels)

    def _memory_of(self, views: int, cells: int) -> tuple[Levels, Singles, Singles]:
        """Levels and shares (view, n + k) and sums (3, n + k), valid until the next frame: large new memory is slow."""
        size, shape = views * cells, (views, cells)
        if len(self._memory[0]) < size:
            self._memory = np.empty(size, np.int16), np.empty(size, np.float32), np.empty(3 * cells, np.float32)
        levels, share, sums = self._memory
        return levels[:size].reshape(shape), share[:size].reshape(shape), sums[: 3 * cells].reshape(3, cells)

    def _volume(self, fused: _Fused) -> SparseVolume:
        number = len(fused.cells.in_volume)
        total = fused.sums.total(fused.cells.near_person, self.config.effective_observations, (self.prior, NEAR_PRIOR))
        empty = np.append(total[number:], np.float32(np.nan))
        return SparseVolume(self._tables.set_of_cell, empty, fused.cells.in_volume, total[:number])

    def _learn(self, estimate: ErrorRateEstimate, fused: _Fused, explanation: Explanation) -> None:
        people, grid, cells, config = explanation.people, self.rig.grid, fused.cells, estimate.config
        near_cells = np.flatnonzero(cells.near_person >= 0)
        near_person = np.empty(grid.shape[1:], np.int64)
        near_person.reshape(-1)[self._tables.ground] = fused.near_person
        filled = inside_bodies(grid, near_person, people.ground, people.height)
        inside = np.zeros(len(cells.near_person), bool)
        inside[near_cells] = filled.reshape(-1)[cells.in_volume[near_cells]]
        body, reached = cells_per_person(grid, self.height_mean, self.config.person_radius)
        counts, rates = np.empty((2, len(fused.terms.weight), 3)), np.array(estimate.rates)
        trusted = (people.evidence - people.view_evidence >= config.minimum_evidence) & (
            people.found_share >= _UNOCCLUDED
        )
        priors = self.config.effective_observations, self.prior
        fill_counts(fused.terms, fused.sums, inside, *cells.counted(), trusted, rates, *priors, *counts[::-1])
        visible = np.maximum(self._tables.sets.size @ self._tables.sets.seen_by, 1)
        units = np.column_stack([np.full(len(rates), body), visible, np.full(len(rates), reached - body)])
        supported = inside[near_cells][(people.evidence >= config.minimum_evidence)[cells.near_person[near_cells]]]
        filled_cells = np.array([len(supported), supported.sum()]) / reached
        measured = np.divide(counts, units, out=np.zeros_like(counts), where=units > 0)  # a large cell holds no body
        estimate.learn(measured, filled_cells, estimate.interval)

    def _assignment(self, i: int, explanation: Explanation) -> PixelAssignment:
        people, assigned = explanation.people, explanation.box_assignment[i]
        separate = np.zeros(len(people) + 1, bool)
        separate[assigned[assigned >= 0]] = True
        camera, step, raster = self.rig.cameras[i], explanation.raster_step[i], explanation.pixel_assignment[i]
        width, height = camera.size
        distance = np.append(np.inf, np.hypot(*(people.ground - camera.centre[:2]).T))
        occupied = np.zeros((raster.shape[0] + 1, raster.shape[1] + 1), np.int32)
        return PixelAssignment(
            raster, occupied, step, _raster_lines(height, step), _raster_lines(width, step), distance, separate
        )

    def _pillars_of(self, i: int) -> tuple[Singles, PillarIndex]:
        """Boxes of the pillars of all heights at all cells, float32 (height * cell, 4), and their index."""
        camera, grid = self.rig.cameras[i], self.rig.grid
        bodies = BodyTable.of(camera, grid, breadth=self._breadth).boxes(self._ground, self.heights)
        pillars = bodies.reshape(-1, 4).astype(np.float32)
        return pillars, PillarIndex.of(pillars, camera.size)

    def _fit(self, i: int, view: Boxes, explanation: Explanation, vicinity: Vicinity, noise: BoxNoise) -> CellFit:
        """Fit of the boxes of a view to bodies at the ground cells."""
        pillars = self._pillars[i]
        assert pillars is not None, "the view was to deliver boxes"
        people, owner = explanation.people, explanation.box_assignment[i]
        if len(owner) != len(view):
            raise ValueError(f"{len(view)} boxes, of which an explanation assigns {len(owner)}")
        edges = np.concatenate([view.pixel[:, :2], view.pixel[:, :2] + view.pixel[:, 2:]], 1)
        width, height = map(float, self.rig.cameras[i].size)
        edges = edges.clip(0, [width - 1, height - 1] * 2)
        boxes = ViewBoxes(edges, *noise.of(view.score, are_feet_covered(edges)), width, height)
        priors = self._log_height_around(np.array([self.height_mean]))[0], self._log_height_around(people.height)
        fit = CellFit.unfilled(len(self.heights), vicinity.near_person.size)
        fill_fit(pillars[1], pillars[0], *priors, boxes, owner, vicinity, fit)
        return fit

    def _log_height_around(self, expected: Floats) -> Floats:
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


@lru_cache(maxsize=64)
def _raster_lines(lines: int, step: int) -> Ints:
    """Raster row or column of each row or column of an image; not to be written to."""
    return np.arange(lines) // step
