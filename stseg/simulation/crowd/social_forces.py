"""Crowd simulation by social forces: pedestrians walk to goals, stand, meet, avoid each other, enter and leave.

Each is driven towards a goal and repelled by neighbours (Helbing and Molnar, Social force model for pedestrian
dynamics, Phys. Rev. E 51, 1995, eqs 2 to 4, 10); a hard constraint keeps bodies apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import overload

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.simulation.crowd.errands import Arrivals, Errand, Planner, Regulars
from stseg.simulation.scene import SceneSpec, Topic, random_stream

TRUTH = np.dtype([("frame", "<i8"), ("id", "<i8"), ("x", "<f8"), ("y", "<f8"), ("height", "<f8")])
"""One row per person inside the area and frame; metres."""

_TIME_STEP = 0.05  # seconds, at most
_WARM_UP = 5.0  # seconds before the first frame, to forget the start
_REACTION = 0.4  # seconds to reach the preferred velocity
_PUSH, _PUSH_RANGE, _WIDTH = 2.2, 0.25, 0.55  # m/s^2, m, m: force between two, how fast it falls, where it starts to
_BEHIND = 0.3  # share of the force of pedestrians behind
_SWERVE = 0.35  # share of it to the right, so that two head on can pass
_CLOSEST = 0.45  # metres between two bodies' axes
_STRIDE, _STRIDE_RISE = 0.35, 0.41  # of the body's height, for two steps: at rest, and what full swing adds


@dataclass(frozen=True, slots=True)
class CrowdFrame:
    """All pedestrians of a frame, also those just outside the area."""

    frame: int
    """Frame number."""
    id: Ints
    """int64 (n,): from 1; each id enters once, unless the scene's people come back."""
    ground: Floats
    """float64 (n, 2): body axes, metres."""
    heading: Floats
    phase: Floats
    """float64 (n,) each: direction of the chest, and phase of the gait cycle, radians."""
    swing: Floats
    """float64 (n,): amplitude of the limbs, 0 at rest, 1 at full pace."""
    height: Floats
    build: Floats
    """float64 (n,) each: metres, and relative width of the body."""

    def truth(self, area: tuple[float, float]) -> Rows:
        """TRUTH rows of the pedestrians inside the area, sorted by id."""
        inside = (np.abs(self.ground) <= np.array(area) / 2).all(axis=1)
        rows = np.zeros(int(inside.sum()), TRUTH)
        rows["frame"], rows["id"], rows["height"] = self.frame, self.id[inside], self.height[inside]
        rows["x"], rows["y"] = self.ground[inside].T
        return np.sort(rows, order="id")


@dataclass(slots=True)
class Pedestrian:
    """State of one pedestrian."""

    id: int
    ground: Floats
    errand: Errand
    pace: float
    height: float
    build: float
    velocity: Floats
    heading: float
    phase: float
    swing: float = 0.0


def walk_freely(spec: SceneSpec) -> Iterator[CrowdFrame]:
    """Simulate the crowd of a scene, frame by frame."""
    planner = Planner(spec.area, spec.stay, random_stream(spec.seed, Topic.CROWD))
    arrivals = Regulars(spec) if spec.absence else Arrivals(spec)
    pedestrians: list[Pedestrian] = []
    steps = int(np.ceil(1 / spec.frame_rate / _TIME_STEP))
    step = 1 / spec.frame_rate / steps
    for frame in range(-int(np.ceil(_WARM_UP * spec.frame_rate)), spec.frames):
        for _ in range(steps):
            while number := arrivals.next(sum(one.errand.counts(one.ground) for one in pedestrians)):
                others = np.array([pedestrian.ground for pedestrian in pedestrians]).reshape(-1, 2)
                pedestrians.append(_new_pedestrian(spec, planner, number, others))
            planner.revise([(pedestrian.ground, pedestrian.errand) for pedestrian in pedestrians], step)
            _advance(pedestrians, np.array(spec.area) / 2, step)
            pedestrians = [pedestrian for pedestrian in pedestrians if not pedestrian.errand.is_over(pedestrian.ground)]
            arrivals.advance(step, (pedestrian.id for pedestrian in pedestrians))
        if frame >= 0:
            yield _crowd(frame, pedestrians)


def _new_pedestrian(spec: SceneSpec, planner: Planner, number: int, others: Floats) -> Pedestrian:
    rng = random_stream(spec.seed, Topic.PERSON, number)
    crowded_start = number <= spec.people and not spec.absence
    ground = planner.place_inside(others) if crowded_start else planner.door(others)
    return Pedestrian(
        number,
        ground,
        planner.errand(enters=not crowded_start),
        pace=rng.uniform(*spec.speed),
        height=rng.uniform(spec.heights[0], spec.heights[-1])
        if spec.heights
        else float(np.clip(rng.normal(1.70, 0.10), 1.45, 1.98)),
        build=float(np.clip(rng.normal(1.0, 0.09), 0.8, 1.25)),
        velocity=np.zeros(2),
        heading=rng.uniform(-np.pi, np.pi),
        phase=rng.uniform(0, 2 * np.pi),
    )


def _advance(pedestrians: list[Pedestrian], half: Floats, step: float) -> None:
    """Advance all pedestrians by one time step; `half` is half the area's sides."""
    if not pedestrians:
        return
    ground = np.stack([pedestrian.ground for pedestrian in pedestrians])
    velocity = np.stack([pedestrian.velocity for pedestrian in pedestrians])
    desired = np.stack([_desired_velocity(pedestrian) for pedestrian in pedestrians])
    velocity = velocity + step * ((desired - velocity) / _REACTION + _repulsion(ground, velocity))
    speed = np.linalg.norm(velocity, axis=1)
    most = np.array([1.2 * pedestrian.pace if not pedestrian.errand.waits else 0.35 for pedestrian in pedestrians])
    velocity *= np.minimum(1.0, most / np.maximum(speed, 1e-9))[:, None]
    stays = np.array([pedestrian.errand.stays_inside for pedestrian in pedestrians])
    moved = _separated(ground + step * velocity, stays, half - 0.05)
    for pedestrian, place, walked in zip(pedestrians, moved, (moved - ground) / step, strict=True):
        _update_gait(pedestrian, walked, step)
        pedestrian.ground, pedestrian.velocity = place, walked


def _desired_velocity(pedestrian: Pedestrian) -> Floats:
    displacement = pedestrian.errand.goal - pedestrian.ground
    distance = float(np.hypot(*displacement))
    # Pedestrians slow down within half a metre of the goal.
    return np.asarray(displacement / max(distance, 1e-9) * pedestrian.pace * min(1.0, distance / 0.5))


def _repulsion(ground: Floats, velocity: Floats) -> Floats:
    """Repulsive accelerations between pedestrians, float64 (n, 2)."""
    away = ground[:, None] - ground[None]
    distance = np.linalg.norm(away, axis=2)
    away /= np.maximum(distance, 1e-9)[..., None]
    toward = velocity / np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)[:, None]
    ahead = -(away * toward[:, None]).sum(axis=2)
    strength = _PUSH * np.exp((_WIDTH - distance) / _PUSH_RANGE) * (_BEHIND + (1 - _BEHIND) * (1 + ahead) / 2)
    np.fill_diagonal(strength, 0.0)
    strength[distance > 2.5] = 0.0
    right = np.stack([-away[..., 1], away[..., 0]], -1)
    return np.asarray((strength[..., None] * (away + _SWERVE * right)).sum(axis=1))


def _separated(ground: Floats, stays: Flags, half: Floats) -> Floats:
    """Positions after the constraints: bodies apart, and pedestrians that stay inside the area."""
    ground = ground.copy()
    first, second = np.triu_indices(len(ground), 1)
    for _ in range(8):
        ground[stays] = np.clip(ground[stays], -half, half)
        away = ground[first] - ground[second]
        distance = np.linalg.norm(away, axis=1)
        close = distance < _CLOSEST
        if not close.any():
            break
        away = away[close] * (0.5 * (_CLOSEST / np.maximum(distance[close], 1e-6) - 1))[:, None]
        np.add.at(ground, first[close], away)
        np.subtract.at(ground, second[close], away)
    ground[stays] = np.clip(ground[stays], -half, half)
    return ground


def _update_gait(pedestrian: Pedestrian, velocity: Floats, step: float) -> None:
    """Update heading, limb amplitude and gait phase from a velocity."""
    speed = float(np.hypot(*velocity))
    moves = float(np.arctan2(velocity[1], velocity[0]))
    facing = pedestrian.errand.facing(pedestrian.ground) if speed < 0.25 else moves
    if facing is not None:
        turn = (facing - pedestrian.heading + np.pi) % (2 * np.pi) - np.pi
        pedestrian.heading += turn * min(1.0, step / 0.25)
    pedestrian.swing += (min(1.0, speed) - pedestrian.swing) * min(1.0, step / 0.3)
    pedestrian.phase += 2 * np.pi * speed * step / stride(pedestrian.height, pedestrian.swing)


@overload
def stride(height: float, swing: float) -> float: ...
@overload
def stride(height: Floats, swing: Floats) -> Floats: ...
def stride(height: float | Floats, swing: float | Floats) -> float | Floats:
    """Length of two steps, metres, for a body height and a limb amplitude."""
    return height * (_STRIDE + _STRIDE_RISE * swing)


def _crowd(frame: int, pedestrians: list[Pedestrian]) -> CrowdFrame:
    def column(name: str) -> Floats:
        return np.array([getattr(pedestrian, name) for pedestrian in pedestrians], float)

    ground = np.array([pedestrian.ground for pedestrian in pedestrians]).reshape(-1, 2)
    ids = np.array([pedestrian.id for pedestrian in pedestrians], np.int64)
    names = ("heading", "phase", "swing", "height", "build")
    return CrowdFrame(frame, ids, ground, *(column(name) for name in names))
