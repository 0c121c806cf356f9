"""Windows to measure the cut on: synthetic ones, and those that the pipeline cuts in real recordings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from result_sets import SETS
from workbench import Bench

from stseg.arrays import Floats, Singles
from stseg.commands.main import main as stseg
from stseg.graphcut.cut import Cut, minimum_cut
from stseg.graphcut.grid_energy import QUANTUM, GridEnergy
from stseg.graphcut.solvers import Solver
from stseg.graphcut.sparse import sparse_cut
from stseg.segmentation.cell_motion import successor_cells
from stseg.segmentation.cut_energy import neighbourhood

SHAPE = (15, 10, 100, 100)
_CELL, _RISE, _FRAME = 0.1, 0.2, 1 / 15  # metres, metres, seconds
_FLOOR = -6.0  # least mean log-likelihood, nats


def synthetic(seed: int, level: float, total: float, neighbours: int = 8, shape: tuple[int, ...] = SHAPE) -> GridEnergy:
    """A window of people seen as soft silhouettes by a ring of cameras, so that ghosts and rays are as geometry has it.

    Parameters
    ----------
    level
        Mean log-likelihood of the views from which a cell counts as occupied, nats: u = mean - level.
    total
        Sum of a cell's capacities, nats.
    """
    rng = np.random.default_rng(seed)
    people, cameras = int(rng.integers(5, 16)), int(rng.integers(4, 9))
    paths, heights = _walk(rng, people, shape), rng.uniform(1.55, 1.85, people)
    radius = rng.uniform(0.21, 0.29, people)
    angle = np.linspace(0, 2 * np.pi, cameras, endpoint=False) + rng.uniform(-0.3, 0.3, cameras)
    away = rng.uniform(6.5, 9.5, cameras)
    middle = np.array(shape[:1:-1]) * _CELL / 2
    places = middle + away[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    volume = np.zeros(shape, np.float32)
    for place, height in zip(places, rng.uniform(2.4, 4.0, cameras), strict=True):
        missed = rng.random((shape[0], people)) < 0.05
        for t, ground in enumerate(paths):
            seen = _silhouettes(ground[~missed[t]], heights[~missed[t]], radius[~missed[t]], place, height, shape)
            noise = rng.random(seen.shape, dtype=np.float32)
            volume[t] += np.log(np.exp(_FLOOR) + seen * (1 - 0.15 * noise) + 0.1 * noise**2).clip(_FLOOR, 0)
    offsets = neighbourhood(neighbours)
    weight = np.exp(-(offsets**2).sum(1) / 2)
    capacity = np.rint(weight * total / (2 * weight.sum()) / QUANTUM).astype(np.int32).clip(1)
    still = np.zeros((shape[0] - 1, *shape[2:], 2), np.int64)
    unary = np.rint((volume / cameras - level) / QUANTUM).astype(np.int32)
    return GridEnergy(unary, offsets, capacity, successor_cells(still))


def _walk(rng: np.random.Generator, people: int, shape: tuple[int, ...]) -> Floats:
    """Places of people frame by frame, metres, float64 (time, person, 2): a straight walk, kept inside."""
    far = np.array(shape[:1:-1]) * _CELL - 0.3
    start, heading = rng.uniform(0.5, far - 0.2, (people, 2)), rng.uniform(0, 2 * np.pi, people)
    step = rng.uniform(0.5, 1.5, people)[:, None] * _FRAME * np.stack([np.cos(heading), np.sin(heading)], 1)
    return np.asarray(np.clip(start + np.arange(shape[0])[:, None, None] * step, 0.3, far))


def _silhouettes(
    ground: Floats, heights: Floats, radius: Floats, place: Floats, camera_height: float, shape: tuple[int, ...]
) -> Singles:
    """Likelihood that one camera sees at each cell of a frame: the best of all bodies along its ray."""
    y, x = (np.arange(n, dtype=np.float32) * _CELL + _CELL / 2 for n in shape[2:])
    east, north = x - np.float32(place[0]), y[:, None] - np.float32(place[1])
    distance = np.hypot(east, north)
    seen = np.zeros(shape[1:], np.float32)
    planes = (np.arange(shape[1], dtype=np.float32) * _RISE)[:, None, None]
    for (to_x, to_y), tall, wide in zip((ground - place).astype(np.float32), heights, radius, strict=True):
        along = (to_x * east + to_y * north) / distance
        beside = abs(to_x * north - to_y * east) / distance
        ray = camera_height + (planes - camera_height) * (along / distance)
        body = _soft(beside - np.where(ray > tall - 0.35, 0.55, 1.0) * wide) * _soft(ray - tall) * _soft(-0.05 - ray)
        np.maximum(seen, np.where(along > 0.1, body, 0), out=seen)
    return seen


def _soft(outside: Floats) -> Floats:
    """1 inside, 0 outside, over a few centimetres."""
    return np.asarray(1 / (1 + np.exp(np.clip(outside / 0.03, -30, 30))))


def real(name: str, frames: str, data: Path) -> Iterator[GridEnergy]:
    """The windows that a run over these frames of a set of docs/development/measurements.md cuts."""
    windows: list[GridEnergy] = []

    def kept(energy: GridEnergy) -> Cut:
        windows.append(energy)
        return minimum_cut(energy)

    solver = Solver(kept, sparse_cut)
    with TemporaryDirectory() as folder, patch.dict("stseg.graphcut.solvers.SOLVERS", stseg=solver):
        bench = Bench(data.resolve(), Path(folder))
        for command in SETS[name].prepare:
            bench.do(command)
        run = [str(bench.path(SETS[name].rig)), "-o", f"{folder}/run.h5", "--frames", frames]
        stseg(["run", *run])
    yield from windows
