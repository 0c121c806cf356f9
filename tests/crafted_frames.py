"""Crafted frames: the evidence of some candidates as arrays, for the score of a set and its search."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import reference_core as reference

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.overlap import overlaps_of
from stseg.detection.problem import BoxEvidence, DetectionProblem, PixelEvidence, RaggedArray, ScoreParameters, no_rows
from stseg.detection.score.moves import score_of
from stseg.detection.score.neighbours import neighbours_of
from stseg.detection.search.best_set import ENUMERATION_LIMIT, GAIN_LIMIT, find_best_set
from stseg.kernels.accelerate import COMPILED

MAP_TYPE: type[np.float32] = np.float32 if COMPILED else np.float64  # type: ignore[assignment]
"""Type of maps: plain Python would sum float32 in float32, compiled code sums it in float64."""

PARAMETERS = ScoreParameters(-3.0, 0.3, 0.25, 0.42, 3.0, 0.2, 0.9, 0.02, 2.0)


@dataclass(frozen=True)
class CraftedFrame:
    """The evidence of some candidates."""

    boxes: BoxEvidence
    pixels: PixelEvidence
    size_prior: Floats
    ground: Floats
    birth_cost: Floats
    track_gain: Floats
    breadth: Floats

    def problem(self) -> DetectionProblem:
        """The frame as the kernels read it."""
        pixels, neighbours = self.pixels, neighbours_of(self.ground, self.breadth, PARAMETERS)
        return DetectionProblem(
            self.boxes, pixels._replace(overlapping=overlaps_of(pixels.first, pixels.spans, no_rows(), 0)),
            self.size_prior, self.birth_cost, self.track_gain, self.ground, self.breadth, neighbours,
            PARAMETERS, np.full((len(pixels.raster), pixels.raster[0].size), -1, np.int16),
        )  # fmt: skip

    def score(self, members: Sequence[int] | Ints) -> float:
        return score_of(np.array(members, np.int64), self.problem())

    def best_set(
        self, start: Sequence[int] = (), sweeps: int = 4, enumeration_limit: int = ENUMERATION_LIMIT
    ) -> list[int]:
        """The set that the search ends with."""
        members = np.zeros(len(self.size_prior) + 1, np.int64)
        members[: len(start)] = start
        count, _ = find_best_set(members, len(start), self.problem(), enumeration_limit, sweeps, GAIN_LIMIT)
        return sorted(members[:count].tolist())


def occluders_of_cover(cover: Floats) -> RaggedArray:
    """Candidates who cover a part of each, from cover (view, candidate, candidate)."""
    rows = cover.reshape(-1, cover.shape[2])
    number, item = np.nonzero(rows)
    return RaggedArray(np.searchsorted(number, np.arange(len(rows) + 1)), item.copy(), 1 - rows[number, item])


def random_frame(seed: int, candidates: int, tracks: int = 0) -> CraftedFrame:
    """Two views with boxes, two with pixels; candidates that share boxes, hide each other and crowd."""
    rng = np.random.default_rng(seed)
    views, most, rows, columns = 2, 4, 8, 10
    match = -rng.exponential(2.0, (views, candidates, most))
    match[rng.random(match.shape) < 0.5] = -np.inf
    cover = rng.uniform(0, 1, (views, candidates, candidates)) * (rng.random((views, candidates, candidates)) < 0.3)
    cover[:, np.arange(candidates), np.arange(candidates)] = 0
    inside = rng.uniform(0.3, 1, (views, candidates))
    boxes = BoxEvidence(match, np.array([most, 2]), occluders_of_cover(cover), inside)
    start = rng.integers(0, columns - 2, (views, candidates, 4))
    stop = np.minimum(start + rng.integers(0, 6, start.shape), columns)
    first = rng.integers(-1, rows - 1, (views, candidates))
    area = (stop - start).sum(-1) + rng.integers(1, 5, (views, candidates)).astype(float)
    raster = rng.normal(0.3, 1.5, (views, rows, columns)).astype(MAP_TYPE)
    spans, distance = np.stack([start, stop], -1).astype(np.int16), rng.uniform(1, 5, (views, candidates))
    pixels = PixelEvidence(raster, np.zeros_like(raster), first, spans, area, distance, no_rows())
    size_prior, ground = rng.normal(0, 0.5, candidates), rng.uniform(0, 1.2, (candidates, 2))
    birth_cost = rng.uniform(0, 5, candidates) * (tracks > 0)
    track_gain = rng.normal(-3, 4, (candidates, tracks))
    breadth = np.maximum(rng.normal(1.0, 0.4, candidates), 1.0)
    return CraftedFrame(boxes, pixels, size_prior, ground, birth_cost, track_gain, breadth)


def scaled(frame: CraftedFrame) -> CraftedFrame:
    """The same, half the pixels explained by bodies of some scale."""
    rng = np.random.default_rng(len(frame.size_prior))
    scale = rng.uniform(-20, 20, frame.pixels.raster.shape).clip(0).astype(MAP_TYPE)
    return replace(frame, pixels=frame.pixels._replace(scale=scale))


def in_rooms(frame: CraftedFrame, size: int) -> CraftedFrame:
    """The same candidates, so many to a room: the evidence of rooms lies on rasters side by side."""
    room = np.arange(len(frame.size_prior)) // size
    rooms, rows = int(room.max()) + 1, frame.pixels.raster.shape[1]
    raster, scale = (np.tile(values, (1, rooms, 1)) for values in (frame.pixels.raster, frame.pixels.scale))
    tall = frame.pixels.spans.shape[2]
    first = np.where(frame.pixels.first < 0, -1, np.minimum(frame.pixels.first, rows - tall) + room * rows)
    pixels = frame.pixels._replace(raster=raster, scale=scale, first=first)
    most = frame.boxes.match.shape[2]
    match = np.full((*frame.boxes.match.shape[:2], most * rooms), -np.inf)
    for i, k in enumerate(room.tolist()):
        match[:, i, k * most : (k + 1) * most] = frame.boxes.match[:, i]
    cover = (1 - reference.left_by_all(frame.boxes)) * (room[:, None] == room)
    occluders, number = occluders_of_cover(cover), np.full(len(match), most * rooms)
    boxes = frame.boxes._replace(match=match, occluders=occluders, boxes=number)
    track_gain = np.full((len(room), rooms * frame.track_gain.shape[1]), -50.0)
    for track, gains in enumerate(frame.track_gain.T):
        track_gain[np.arange(len(room)), track * rooms + room] = gains
    ground = frame.ground + 10.0 * room[:, None]
    return replace(frame, boxes=boxes, pixels=pixels, ground=ground, track_gain=track_gain)
