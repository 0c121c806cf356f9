"""Boxes of people who walk among cameras, drawn from points on cylinders, with nothing of the package's body tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes import looking

from stseg.arrays import Floats
from stseg.geometry import Camera, Grid, Rig

SIZE = (640, 480)
_ROUND = np.linspace(0, 2 * np.pi, 13)[:-1]
_BODY = np.array([(z, r) for z, r in ((0.0, 0.13), (0.3, 0.15), (0.5, 0.21), (0.8, 0.23), (0.9, 0.12), (1.0, 0.08))])


def ring(views: int = 4) -> Rig:
    """Cameras around five by five metres, at 5 frames a second."""
    turns = [2 * np.pi * k / views + 0.3 for k in range(views)]
    cameras = [
        looking(f"cam{k + 1}", (5.5 * np.cos(turn), 5.5 * np.sin(turn), 2.4 + 0.2 * k), (0.1, 0, 0.9), SIZE, 420.0)
        for k, turn in enumerate(turns)
    ]
    return Rig("ring", 5.0, Grid((-2.5, 2.5), (-2.5, 2.5)), tuple(cameras))


def walkers(frames: int, people: int = 3, seed: int = 1) -> Floats:
    """Places and heights, float64 (frame, person, 3): each walks an ellipse of its own, about a metre a second."""
    lots = np.random.default_rng(seed)
    reach = lots.uniform(0.9, 2.0, (people, 2))
    phase, height = lots.uniform(0, 2 * np.pi, people), lots.normal(1.7, 0.06, people)
    speed = np.where(np.arange(people) % 2, -1, 1) / reach.mean(axis=1)
    angle = phase + speed * np.arange(frames)[:, None] / 5.0
    place = np.stack([reach[:, 0] * np.cos(angle), reach[:, 1] * np.sin(angle)], -1)
    return np.concatenate([place, np.broadcast_to(height[:, None], (frames, people, 1))], -1)


def shown(rig: Rig, bodies: Floats, noise: float = 1.5, seed: int = 2) -> dict[int, list[Floats]]:
    """Boxes of every view in every frame, clipped to the image, left, top, right, bottom."""
    lots = np.random.default_rng(seed)
    return {
        frame: [_boxes(camera, people, noise, lots) for camera in rig.cameras] for frame, people in enumerate(bodies)
    }


def _boxes(camera: Camera, people: Floats, noise: float, lots: np.random.Generator) -> Floats:
    boxes = []
    for x, y, tall in people:
        around = np.stack([np.cos(_ROUND), np.sin(_ROUND)], -1)
        points = np.array([x, y]) + _BODY[:, 1, None, None] * around
        pixel, ahead = camera.project(points, np.broadcast_to((_BODY[:, 0] * tall)[:, None], points.shape[:2]))
        flat = pixel.reshape(-1, 2)
        box = np.concatenate([flat.min(axis=0), flat.max(axis=0)]) + lots.normal(0, noise, 4)
        box = np.clip(box, -0.5, np.tile(np.array(SIZE) - 0.5, 2))
        if ahead.all() and (box[2:] - box[:2] > 8).all():
            boxes.append(box)
    return np.array(boxes, float).reshape(-1, 4)


def moved(rig: Rig, view: int, kind: str, amount: float) -> Rig:
    """The rig with one camera's calibration spoilt: x, y, z in metres, yaw in degrees about the middle, u in pixels."""
    camera = rig.cameras[view]
    before, after = np.eye(4), np.eye(3)
    if kind in "xyz":
        before["xyz".index(kind), 3] = amount
    elif kind == "yaw":
        turn = np.radians(amount)
        before[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    else:
        after[0, 2] = amount
    spoilt = Camera.from_projection(camera.name, camera.size, after @ camera.projection @ before, camera.lens)
    return replace(rig, cameras=tuple(spoilt if k == view else one for k, one in enumerate(rig.cameras)))


def exchanged(rig: Rig, first: int, second: int) -> Rig:
    """The rig with the calibrations of two cameras exchanged, their names kept."""
    cameras = list(rig.cameras)
    a, b = cameras[first], cameras[second]
    cameras[first] = Camera(a.name, a.size, b.ground, b.vertical, b.lens)
    cameras[second] = Camera(b.name, b.size, a.ground, a.vertical, a.lens)
    return replace(rig, cameras=tuple(cameras))
