"""People who walk before cameras, without pictures: as tracks, boxes, and endpoints of silhouettes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from checks import numbers
from hypothesis import strategies as st
from scenes import looking

from stseg import Camera, Config, Grid, Rig
from stseg.arrays import Floats, Ints, Rows
from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.automatic.solution import CalibrationInput
from stseg.records.border import Border
from stseg.records.tables import TRAJECTORY
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig
from stseg.trajectories.smoother import smooth_places

RATE = 8.0
CONFIG = Config()
Path = Callable[[float], tuple[float, float]]
"""Where somebody is at a time in seconds, metres."""


def open_area(side: float = 6.0) -> Border:
    """People come and go at the edges of a square around the origin."""
    grid = Grid((-side, side), (-side, side), cell=0.25, planes=2)
    return Border(side - np.maximum(np.abs(grid.ground_x), np.abs(grid.ground_y)[:, None]), grid)


BORDER = open_area()


def rows_of(people: Mapping[int, tuple[Path, float, range]], noise: float = 0.02) -> Rows:
    """TRAJECTORY rows of people who walk paths, so tall, in these frames; sorted by frame, then id."""
    rng = np.random.default_rng(3)
    told = sorted((t, track, path(t / RATE), tall) for track, (path, tall, frames) in people.items() for t in frames)
    rows = np.zeros(len(told), TRAJECTORY)
    rows["xx"] = rows["yy"] = 0.02**2
    for row, (frame, track, place, tall) in zip(rows, told, strict=True):
        row["frame"], row["id"], row["height"] = frame, track, tall + rng.normal(0, CONFIG.tracking.height_noise)
        row["x"], row["y"] = np.array(place) + rng.normal(0, noise, 2)
    return rows


def committed(rows: Rows) -> Rows:
    """Rows as a tracker commits them: places of the frame alone."""
    found = rows.copy()
    found["raw_x"], found["raw_y"] = rows["x"], rows["y"]
    found["xx"] = found["yy"] = 0.02
    found["extent"] = 0.5
    return found


def smoothed(frame: Ints, ground: Floats, noise: Floats, rate: float, track: Ints) -> tuple[Floats, Floats]:
    """Smoothed places (n, 2) and covariances (n, 2, 2) of measured ones, each of a frame and a track."""
    rows = np.zeros(len(frame), TRAJECTORY)
    rows["frame"], rows["id"], (rows["raw_x"], rows["raw_y"]) = frame, track, ground.T
    rows["xx"], rows["xy"], rows["yy"] = noise.reshape(-1, 4)[:, [0, 1, 3]].T
    smooth_places(rows, rate, CONFIG.motion)
    covariance = np.stack([rows["xx"], rows["xy"], rows["xy"], rows["yy"]], 1).reshape(-1, 2, 2)
    return np.column_stack([rows["x"], rows["y"]]), covariance


def visit(side: float) -> Path:
    """Someone comes from one side to the middle, stands there from 9 s to 11 s, nearest at 10 s, and goes back."""
    return lambda t: (side * (0.1 + 0.02 * abs(t - 10) + 0.5 * max(abs(t - 10) - 1, 0)), 0.0)


def swapped(rows: Rows, frame: int) -> Rows:
    """Tracks 1 and 2 change places from a frame on."""
    other = rows.copy()
    late = rows["frame"] >= frame
    other["id"][late] = 3 - rows["id"][late]
    return other


def gone(seconds: float, tall: float = 1.7, path: Path = lambda t: (-3 + 0.7 * t, 0.5)) -> Rows:
    """Track 1 is lost at 3 s; track 2 begins some seconds later, further along the path."""
    begin = 24 + round(seconds * RATE)
    return rows_of({1: (path, 1.7, range(24)), 2: (path, tall, range(begin, begin + 24))})


def straight(x: float, y: float, vx: float, vy: float) -> Path:
    """Constant velocity, metres per second."""
    return lambda t: (x + vx * t, y + vy * t)


@st.composite
def runs(draw: st.DrawFn, most: int) -> Rows:
    """A few people in a small place, each seen from time to time; ids that say nothing."""
    people: dict[int, tuple[Path, float, range]] = {}
    for track in draw(st.lists(st.integers(1, 9), unique=True, max_size=most)):
        x, y, vx, vy = (draw(numbers(-w, w)) for w in (2, 2, 0.5, 0.5))
        first, length = draw(st.integers(0, 25)), draw(st.integers(1, 20))
        tall = draw(st.sampled_from((1.6, 1.7, 1.8)))
        people[track] = straight(x, y, vx, vy), tall, range(first, first + length)
    rows = rows_of(people)
    unseen = draw(st.sets(st.integers(0, len(rows) - 1), max_size=2)) if len(rows) else set[int]()
    return np.delete(rows, sorted(unseen))


SIZE = (640, 480)
_ROUND = np.linspace(0, 2 * np.pi, 13)[:-1]
_BODY = np.array([(z, r) for z, r in ((0.0, 0.13), (0.3, 0.15), (0.5, 0.21), (0.8, 0.23), (0.9, 0.12), (1.0, 0.08))])


def ring(views: int = 4, step: float = 0.2) -> Rig:
    """Cameras around five by five metres, each so much higher than the last, at 5 frames a second."""
    turns = [2 * np.pi * k / views + 0.3 for k in range(views)]
    cameras = [
        looking(f"cam{k + 1}", (5.5 * np.cos(turn), 5.5 * np.sin(turn), 2.4 + step * k), (0.1, 0, 0.9), SIZE, 420.0)
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
    endpoints = tuple(replace(one, frame=one.frame + k) for one, k in zip(scene.views.endpoints, delays, strict=True))
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
