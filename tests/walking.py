"""People who walk before simulated cameras, as endpoints of silhouettes: no pictures, no waiting."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.automatic.solution import CalibrationInput
from stseg.geometry import Rig
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig

TOE = 0.1
"""Metres by which lowest points are nearer than axes."""


@dataclass(frozen=True)
class Walking:
    """A rig, and what its views show of people who walk."""

    rig: Rig
    views: CalibrationInput


def walking(cameras: int = 3, people: int = 2, seconds: float = 40.0, seed: int = 1, noise: float = 0.3) -> Walking:
    """Walkers on smooth random ways, their endpoints in every camera with noise, pixels."""
    spec = SceneSpec("walking", people, (6.0, 6.0), seconds, 5.0, cameras, seed=seed, distortion=(-0.2, 0.03))
    rig, lots = build_rig(spec), np.random.default_rng(seed)
    ways = [_way(spec.frames, lots) for _ in range(people)]
    tall = 1.7 + 0.06 * np.linspace(-1, 1, people)
    endpoints = tuple(_ends(rig, view, ways, tall, noise, lots) for view in range(cameras))
    sizes = tuple(camera.size for camera in rig.cameras)
    return Walking(rig, CalibrationInput(endpoints, sizes, rig.frame_rate, 1.7, 2.0))


def delayed(scene: Walking, delays: list[int]) -> Walking:
    """The same where each view's stream began so many frames earlier."""
    endpoints = tuple(
        replace(one, frame=one.frame + late) for one, late in zip(scene.views.endpoints, delays, strict=True)
    )
    return replace(scene, views=replace(scene.views, endpoints=endpoints))


def changed(scene: Walking, view: int, endpoints: Endpoints) -> Walking:
    """The same where one view shows something else."""
    every = list(scene.views.endpoints)
    every[view] = endpoints
    return replace(scene, views=replace(scene.views, endpoints=tuple(every)))


def _way(frames: int, lots: np.random.Generator) -> Floats:
    """Places at every frame, about 1 m/s within 2.6 m of the middle, float64 (frame, 2)."""
    time = np.arange(frames) / 5.0
    turns, phase = lots.uniform(0.05, 0.09, (2, 2)), lots.uniform(0, 2 * np.pi, (2, 2))
    waves = np.sin(2 * np.pi * turns * time[:, None, None] + phase)
    return np.asarray(waves @ [1.7, 0.9])


def _ends(rig: Rig, view: int, ways: list[Floats], tall: Floats, noise: float, lots: np.random.Generator) -> Endpoints:
    camera = rig.cameras[view]
    rows = []
    for way, height in zip(ways, tall, strict=True):
        toward = camera.centre[:2] - way
        low = way + TOE * toward / np.linalg.norm(toward, axis=1, keepdims=True)
        foot, head = camera.project(low, 0.0)[0], camera.project(way, float(height))[0]
        seen = camera.inside(foot) & camera.inside(head)
        rows.append((np.flatnonzero(seen), foot[seen], head[seen]))
    frame, foot, head = (np.concatenate([row[k] for row in rows]) for k in range(3))
    order = np.argsort(frame, kind="stable")
    shake = noise * lots.normal(size=(2, len(order), 2))
    return Endpoints(frame[order].astype(np.int64), foot[order] + shake[0], head[order] + shake[1])
