"""One view of the detector: outlines of the lattice's pillars, and the observation of a frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stseg.arrays import AlignedBoxes, Boxes, Flags, Floats, Ints, Shorts, Singles
from stseg.bodies.box_fit import PRIOR_NOISE, BoxNoise, ViewBoxes, fill_inside
from stseg.bodies.covered_feet import are_feet_covered
from stseg.bodies.outlines import Pillars, Spans, outlines, sums_inside
from stseg.bodies.pillar_index import PillarIndex
from stseg.bodies.pillars import WIDTH, BodyTable
from stseg.config import BodyConfig, DetectionConfig
from stseg.geometry import Camera, Grid
from stseg.kernels.accelerate import kernel, wide_kernel

BODY_WEIGHT, BACKGROUND_WEIGHT = 5.0, -10.0
"""Weights of a person's own pixels and of background inside their pillar (HW12 eq. 27)."""
_BODY_ROWS = 30
"""Rows of a body on a raster: enough for its outline, few enough for speed."""
_LEAST_INSIDE = 0.02
"""Share of a body's box in the image below which the view does not see it."""


@dataclass(frozen=True)
class ViewObservation:
    """Observation of one view in one frame: boxes clipped to the image, or a raster of log-odds; the other is empty."""

    edges: Floats
    """float64 (box, 4): left, top, right, bottom, pixels."""
    score: Floats
    """float64 (box,): 0..1."""
    tolerance: Floats
    """float64 (box, 5): see `stseg.bodies.box_fit`."""
    belief: Floats
    """float64 (box,): see `stseg.bodies.box_fit`."""
    raster: Singles
    """float32 (v, u): log-odds of foreground, nats."""
    right: Floats | float = 0.0
    """float64 (box,), or one for all: how far boxes were moved to the right (`AlignedBoxes`), pixels."""

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """The lowest and the highest log-odds, nats."""
        return float(self.raster.min(initial=np.inf)), float(self.raster.max(initial=-np.inf))

    @cached_property
    def label_values(self) -> Singles:
        """Log-likelihood of each pixel inside a pillar beside outside, if open to the person: float32 (v, u), nats."""
        values = np.empty_like(self.raster)
        _fill_label_values(self.raster, values)
        return values


ViewObservations = Sequence[ViewObservation | None]
"""One a view, None where it is blind."""


class TriedPillars(NamedTuple):
    """Pillars that are tried for each person."""

    ground: Floats
    """float64 (person, pillar, 2): metres."""
    height: Floats
    width: Floats
    area_ratio: Floats
    """float64 (person, pillar) each: metres, metres, and `View.area_ratio`."""


class View:
    """Pillars of a ground lattice in one camera."""

    def __init__(
        self,
        camera: Camera,
        grid: Grid,
        lattice_ground: Floats,
        config: DetectionConfig,
        body: BodyConfig,
        breadth: float = 1.0,
    ) -> None:
        self.camera, self.grid = camera, grid
        self.config, self.body = config, body
        self.centre = camera.centre[:2]
        self.table = BodyTable.of(camera, grid, breadth=breadth)
        self.bodies = self.table.boxes(lattice_ground, np.asarray(body.heights))
        self.step = _raster_step(self.bodies, camera.size)
        width, height = camera.size
        self.shape = (-(-height // self.step), -(-width // self.step))

    def distance(self, ground: Floats) -> Floats:
        """Distance of ground points (n, 2) from the camera along the ground, metres, float64 (n,)."""
        return np.asarray(np.hypot(*(ground - self.centre).T))

    def outlines(self, ground: Floats, heights: Floats, widths: Floats) -> tuple[Ints, Spans, Floats]:
        """Outlines of pillars on this view's raster, sizes in metres; see `stseg.bodies.outlines`.

        Areas are fair ones.
        """
        first, spans, area = self.whole_outlines(ground, heights, widths)
        return first, spans, area / self.area_ratio(ground, heights, widths)

    def whole_outlines(self, ground: Floats, heights: Floats, widths: Floats) -> tuple[Ints, Spans, Floats]:
        """The same with the outlines' own areas."""
        return outlines(self.table, ground, heights, self.step, self.shape, widths / WIDTH)

    def area_ratio(self, ground: Floats, heights: Floats, widths: Floats) -> Floats:
        """Areas of outlines beside the fair ones that they are averaged over; the same in all views of a rig.

        Independent observations are as many as the greater of two ratios to a body of mean size there, that of the
        areas and its root: errors of a segmentation fill areas, and lie along outlines. So a pillar that covers more of
        a body never counts as less, a wide body outweighs a slim one within it, and a child is no third of an adult. At
        the border of the ground it is the areas alone: people who stand outside are no candidates, and smaller bodies
        inside would stand for them.
        """
        share = heights * widths / (self.body.height_mean * self.body.width_mean)
        inside = np.minimum(self.grid.edge_distance(ground) / self.config.border_width, 1.0)
        return np.asarray(np.maximum(share, share ** (1.0 - 0.5 * inside)))

    def tried(self, ground: Floats, heights: Floats, widths: Floats) -> TriedPillars:
        """Pillars that are tried for each person; the same for all views of a rig."""
        return TriedPillars(ground, heights, widths, self.area_ratio(ground, heights, widths))


class BoxView(View):
    """A view that delivers boxes."""

    def __init__(
        self, camera: Camera, grid: Grid, lattice_ground: Floats, config: DetectionConfig, body: BodyConfig
    ) -> None:
        super().__init__(camera, grid, lattice_ground, config, body, body.breadth)
        width, height = map(float, camera.size)
        inside = np.zeros(self.bodies.shape[:2])
        for row, bodies in zip(inside, self.bodies, strict=True):
            fill_inside(bodies, width, height, row)
        self.index = PillarIndex.of(self.bodies, camera.size)
        self.found = np.where(inside > _LEAST_INSIDE, self.found_share(inside), 0.0).reshape(-1)

    def found_share(self, visible: Floats) -> Floats:
        """Detection rate of a body by its visible share, relative to that of a whole one."""
        share = visible / self.config.full_visibility
        return np.asarray(share.clip(self.config.hidden_detection_rate, 1.0))

    def observe(self, evidence: Boxes | Singles | None, noise: BoxNoise = PRIOR_NOISE) -> ViewObservation:
        """The frame's boxes."""
        boxes = evidence if isinstance(evidence, Boxes) else Boxes(np.zeros((0, 4)), np.zeros(0))
        width, height = self.camera.size
        corner, extent = boxes.pixel[:, :2], boxes.pixel[:, 2:]
        edges = np.concatenate([corner, corner + extent], 1).clip(0, [width - 1, height - 1] * 2)
        right = boxes.right if isinstance(boxes, AlignedBoxes) else 0.0
        tolerance, belief = noise.of(boxes.score, are_feet_covered(edges))
        return ViewObservation(edges, boxes.score, tolerance, belief, np.zeros((0, 0), np.float32), right)

    def boxes(self, observation: ViewObservation) -> ViewBoxes:
        """The frame's boxes, as kernels read them."""
        width, height = map(float, self.camera.size)
        return ViewBoxes(observation.edges, observation.tolerance, observation.belief, width, height)

    def foreground(self, observation: ViewObservation) -> Flags:
        """Raster pixels inside any box, bool (v, u)."""
        inside = np.zeros(self.shape, bool)
        for left, top, right, bottom in np.floor(observation.edges / self.step).astype(int).tolist():
            inside[top : bottom + 1, left : right + 1] = True
        return inside


class PixelView(View):
    """A view that delivers a likelihood map."""

    def observe(self, evidence: Boxes | Singles | None, noise: BoxNoise = PRIOR_NOISE) -> ViewObservation:
        """The frame's log-odds on the raster; all zero where the view is blind."""
        del noise
        raster = np.empty(self.shape, np.float32)
        if isinstance(evidence, np.ndarray):
            miss, clutter = self.config.pixel_miss_rate, self.config.pixel_clutter_rate
            _fill_log_odds(evidence, self.step, np.float32(miss), np.float32(clutter), raster)
        else:
            raster[:] = 0.0
        return ViewObservation(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 5)), np.zeros(0), raster)

    def foreground(self, observation: ViewObservation) -> Flags:
        """Raster pixels that are foreground rather than not, bool (v, u)."""
        return np.asarray(observation.raster > 0)

    def open_sums(self, values: Singles, owner: Shorts, number: Ints, pillars: TriedPillars) -> tuple[Floats, Floats]:
        """Weighted sums of the pixels open to each person inside their pillars, and the pillars' fair areas.

        Both float64 (person, pillar); see `stseg.bodies.outlines.sums_inside`.
        """
        drawn = Pillars(pillars.ground, pillars.height, pillars.width / WIDTH)
        sums, area = sums_inside(self.table, drawn, self.step, values, owner, number)
        return sums * self.config.effective_observations, area / pillars.area_ratio


DetectorView = BoxView | PixelView
"""A view of the detector, by what its camera delivers."""


@wide_kernel
def _fill_log_odds(likelihood: Singles, step: int, miss: np.float32, clutter: np.float32, raster: Singles) -> None:
    """Fill raster (v, u) with log((1 - m) L + m (1 - L)) - log(b L + (1 - b)(1 - L)); most L are the same.

    L is the mean over a square of `step` pixels of the likelihood; those at the border may be smaller.
    """
    one, last, value = np.float32(1), np.float32(-1), np.float32(0)
    down, mean = np.empty(likelihood.shape[1], np.float32), np.empty(raster.shape[1], np.float32)
    for v in range(raster.shape[0]):
        if step > 1:
            _fill_means(likelihood[v * step : (v + 1) * step], step, down, mean)
        shares = mean if step > 1 else likelihood[v]
        for u in range(raster.shape[1]):
            if shares[u] != last:
                last = shares[u]
                body = (one - miss) * last + miss * (one - last)
                empty = clutter * last + (one - clutter) * (one - last)
                value = np.float32(np.log(body / empty))
            raster[v, u] = value


@wide_kernel
def _fill_means(rows: Singles, step: int, down: Singles, mean: Singles) -> None:
    """Fill mean (u,) with the means over squares of rows (v, u'), and down (u',) with the sums of its columns."""
    width, whole = rows.shape[1], rows.shape[1] // step
    for column in range(width):
        down[column] = rows[0, column]
    for row in range(1, len(rows)):
        for column in range(width):
            down[column] += rows[row, column]
    if step == 2:
        _fill_pairs(down, np.float32(2 * len(rows)), mean[:whole])
    else:
        for u in range(whole):
            total = down[u * step]
            for shift in range(1, step):
                total += down[u * step + shift]
            mean[u] = total / np.float32(len(rows) * step)
    if whole < len(mean):
        total = np.float32(0)
        for column in range(whole * step, width):
            total += down[column]
        mean[whole] = total / np.float32(len(rows) * (width - whole * step))


@wide_kernel
def _fill_pairs(values: Singles, number: np.float32, mean: Singles) -> None:
    """Fill mean (u,) with the sums of pairs of values (2 u,) over a number: vector code, as a loop of sums is not."""
    for u in range(len(mean)):
        mean[u] = (values[2 * u] + values[2 * u + 1]) / number


@kernel
def _fill_label_values(raster: Singles, values: Singles) -> None:
    """Fill values (v, u); see `ViewObservation.label_values`. Most log-odds are the same."""
    one, last, value = np.float32(1), np.float32(np.nan), np.float32(0)
    for v in range(raster.shape[0]):
        for u in range(raster.shape[1]):
            if raster[v, u] != last:
                last = raster[v, u]
                probability = one / (one + np.exp(-last))
                value = np.float32(2 * BODY_WEIGHT) * probability + np.float32(BACKGROUND_WEIGHT) * (one - probability)
            values[v, u] = value


def _raster_step(bodies: Floats, size: tuple[int, int]) -> int:
    """Image pixels to a raster pixel, so that a body in the image is some thirty rows tall."""
    middle = bodies[len(bodies) // 2]
    width, height = size
    within = (middle[:, 2] > 0) & (middle[:, 0] < width) & (middle[:, 3] > 0) & (middle[:, 1] < height)
    if not within.any():
        return max(1, height // 120)
    return max(1, int(np.median(middle[within, 3] - middle[within, 1]) / _BODY_ROWS))
