"""Evidence of all views for the candidates of a frame, and candidates from a lattice's score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.bodies.box_fit import fill_inside, fill_match
from stseg.bodies.views import BoxView, PixelView, View, ViewObservations
from stseg.detection.evidence.occlusion import occluders_of
from stseg.detection.evidence.overlap import overlaps_of
from stseg.detection.problem import BoxEvidence, PixelEvidence, no_rows
from stseg.records.candidates import Candidates

CANDIDATE_LIMIT = 250
"""Most candidates that one round adds."""
_NEIGHBOURHOOD = np.indices((3, 3)).reshape(2, 9)
"""Rows and columns of a place and its neighbours, from the first of them on."""
_MINIMUM_SCORE = 0.0
"""Score above which a peak of the lattice is a candidate, nats."""


def peaks(score: Floats, lattice_ground: Floats, heights: Floats, widths: Floats) -> Candidates:
    """Local maxima of a lattice score (height, y, x) over the ground (y, x, 2), best first."""
    best = score.max(0)
    rows, columns = np.nonzero(best > _MINIMUM_SCORE)  # few places, so these alone are compared with their neighbours
    framed = np.full((best.shape[0] + 2, best.shape[1] + 2), -np.inf)
    framed[1:-1, 1:-1] = best
    around = framed[rows[:, None] + _NEIGHBOURHOOD[0], columns[:, None] + _NEIGHBOURHOOD[1]]
    highest = best[rows, columns] == around.max(1, initial=-np.inf)
    rows, columns = rows[highest], columns[highest]
    order = np.argsort(-best[rows, columns], kind="stable")[:CANDIDATE_LIMIT]
    rows, columns = rows[order], columns[order]
    chosen = score[:, rows, columns].argmax(0)
    return Candidates(lattice_ground[rows, columns], heights[chosen], widths[chosen])


@dataclass(frozen=True)
class ProjectedBodies:
    """Candidates in the views that deliver boxes."""

    edges: Floats
    """float64 (view, candidate, 4): left, top, right, bottom, pixels, not clipped to the image; nan where the view
    cannot see the place."""
    distance: Floats
    """float64 (view, candidate): distance from the camera on the ground, metres."""

    @classmethod
    def of(cls, views: Sequence[View], pool: Candidates) -> ProjectedBodies:
        """The candidates of a pool."""
        chosen = [view for view in views if isinstance(view, BoxView)]
        edges, distance = np.empty((len(chosen), len(pool), 4)), np.empty((len(chosen), len(pool)))
        for k, view in enumerate(chosen):
            edges[k], distance[k] = view.table.boxes_of(pool.ground, pool.height), view.distance(pool.ground)
        return cls(edges, distance)

    def joined_with(self, other: ProjectedBodies) -> ProjectedBodies:
        """These candidates, then the others."""
        return ProjectedBodies(
            np.concatenate([self.edges, other.edges], 1), np.concatenate([self.distance, other.distance], 1)
        )


def box_evidence(
    views: Sequence[View], observations: ViewObservations, bodies: ProjectedBodies, base: BoxEvidence | None = None
) -> BoxEvidence:
    """Evidence of all views that deliver boxes; a blind one (None) has the candidates outside its image.

    `base` is that of the first candidates, where it was found before: the others alone are compared with the boxes.
    """
    chosen = [
        (view, observation) for view, observation in zip(views, observations, strict=True) if isinstance(view, BoxView)
    ]
    if not chosen:
        match, inside = np.zeros((0, bodies.edges.shape[1], 0)), np.zeros((0, bodies.edges.shape[1]))
        return BoxEvidence(match, np.zeros(0, np.int64), no_rows(), inside)
    sizes = np.array([view.camera.size for view, _ in chosen], float)
    boxes = np.array([len(observation.edges) if observation else 0 for _, observation in chosen], np.int64)
    candidates, first = bodies.edges.shape[1], 0 if base is None else base.inside.shape[1]
    match = np.full((len(chosen), candidates, boxes.max(initial=0)), -np.inf)
    inside = np.zeros((len(chosen), candidates))
    if base is not None:
        match[:, :first], inside[:, :first] = base.match, base.inside
    for k, (view, observation) in enumerate(chosen):
        if observation is not None:
            edges, of_view = bodies.edges[k, first:], view.boxes(observation)
            fill_match(edges, of_view, match[k, first:])
            fill_inside(edges, of_view.width, of_view.height, inside[k, first:])
    is_blind = np.array([observation is None for _, observation in chosen], bool)
    before = base.occluders if base else no_rows()
    occluders = occluders_of(bodies.edges, bodies.distance, sizes, is_blind, before, first)
    return BoxEvidence(match, boxes, occluders, inside)


def stacked_rasters(views: Sequence[View], of_views: Sequence[Singles | None]) -> Singles:
    """Rasters of all views that deliver pixels, float32 (view, v, u); zero where a view is blind, unset beyond each."""
    chosen = [(view, raster) for view, raster in zip(views, of_views, strict=True) if isinstance(view, PixelView)]
    shapes = np.array([view.shape for view, _ in chosen], int).reshape(-1, 2)
    rasters = np.empty((len(chosen), *shapes.max(0, initial=0)), np.float32)
    for raster, (view, source) in zip(rasters, chosen, strict=True):
        raster[: view.shape[0], : view.shape[1]] = 0.0 if source is None else source
    return rasters


def pixel_evidence(
    views: Sequence[View], rasters: Singles, scales: Singles, pool: Candidates, base: PixelEvidence | None = None
) -> PixelEvidence:
    """Evidence of all views that deliver pixels, by `stacked_rasters` of their log-odds and scales.

    `base` is that of the first candidates, where it was found before: the others alone are drawn.
    """
    chosen = [view for view in views if isinstance(view, PixelView)]
    number = 0 if base is None else base.first.shape[1]
    more, shape = pool.after(number), (len(chosen), len(pool))
    drawn = [view.whole_outlines(more.ground, more.height, more.width) for view in chosen]
    tall = max((outline.shape[1] for _, outline, _ in drawn), default=0)
    tall = tall if base is None else max(tall, base.spans.shape[2])
    first, area, distance = np.empty(shape, np.int64), np.empty(shape), np.empty(shape)
    spans = np.zeros((*shape, tall, 2), np.int16)
    if base is not None:
        first[:, :number], area[:, :number], distance[:, :number] = base.first, base.area, base.distance
        spans[:, :number, : base.spans.shape[2]] = base.spans
    for k, (view, (row, outline, whole)) in enumerate(zip(chosen, drawn, strict=True)):
        first[k, number:], area[k, number:], distance[k, number:] = row, whole, view.distance(more.ground)
        spans[k, number:, : outline.shape[1]] = outline
    if chosen:
        area[:, number:] /= chosen[0].area_ratio(more.ground, more.height, more.width)
    overlapping = overlaps_of(first, spans, no_rows() if base is None else base.overlapping, number)
    return PixelEvidence(rasters, scales, first, spans, area, distance, overlapping)
