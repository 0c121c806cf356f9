"""A crowd: people who walk to places, stand, meet, make way for each other, come and go.

Each is driven towards the next place and pushed away by who comes near (Helbing and Molnar, Social force model for
pedestrian dynamics, Phys. Rev. E 51, 1995, eqs 2 to 4, 10), and nobody is ever closer than two bodies are wide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import overload

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.simulation.errands import Errand, Planner
from stseg.simulation.random_streams import Topic, chance
from stseg.simulation.scene import SceneSpec

TRUTH = np.dtype([("frame", "<i8"), ("id", "<i8"), ("x", "<f8"), ("y", "<f8"), ("height", "<f8")])
"""One row per person inside the area and frame; metres."""

_STEP = 0.05  # seconds, at most
_WARM_UP = 5.0  # seconds before the first frame, to forget the start
_REACTION = 0.4  # seconds to reach the preferred velocity
_PUSH, _REACH, _WIDTH = 2.2, 0.25, 0.55  # m/s^2, m, m: force between two, how fast it falls, where it starts to
_BEHIND = 0.3  # share of the force of those whom one does not see
_SWERVE = 0.35  # share of it to the right, so that two who meet head on pass
_CLOSEST = 0.45  # metres between two bodies' axes
_STRIDE, _STRIDE_RISE = 0.35, 0.41  # of the body's height, for two steps: at rest, and what full swing adds


@dataclass(frozen=True, slots=True)
class Crowd:
    """Everyone in the scene at one time, also those just outside the area.

    Attributes
    ----------
    frame
        The frame.
    id : int64 (n,)
        From 1; nobody comes back.
    ground : float64 (n, 2)
        Body axes, metres.
    heading, phase : float64 (n,)
        Where the chest points, and the place in the gait's cycle, radians.
    swing : float64 (n,)
        How far the limbs swing, 0 for one who stands, 1 at full pace.
    height, build : float64 (n,)
        Metres, and relative width of the body.
    """

    frame: int
    id: Ints
    ground: Floats
    heading: Floats
    phase: Floats
    swing: Floats
    height: Floats
    build: Floats

    def truth(self, area: tuple[float, float]) -> Rows:
        """TRUTH rows of those inside the area, sorted by id."""
        inside = (np.abs(self.ground) <= np.array(area) / 2).all(axis=1)
        rows = np.zeros(int(inside.sum()), TRUTH)
        rows["frame"], rows["id"], rows["height"] = self.frame, self.id[inside], self.height[inside]
        rows["x"], rows["y"] = self.ground[inside].T
        return np.sort(rows, order="id")


@dataclass(slots=True)
class Pedestrian:
    """One person on the way."""

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


def walk(spec: SceneSpec) -> Iterator[Crowd]:
    """The crowd at every frame of a scene, one after the other."""
    planner = Planner(spec.area, spec.stay, chance(spec.seed, Topic.CROWD))
    walkers: list[Pedestrian] = []
    steps = int(np.ceil(1 / spec.frame_rate / _STEP))
    step = 1 / spec.frame_rate / steps
    met = 0
    for frame in range(-int(np.ceil(_WARM_UP * spec.frame_rate)), spec.frames):
        for _ in range(steps):
            while sum(walker.errand.counts(walker.ground) for walker in walkers) < spec.people:
                met += 1
                walkers.append(_newcomer(spec, planner, met, np.array([w.ground for w in walkers]).reshape(-1, 2)))
            planner.revise([(walker.ground, walker.errand) for walker in walkers], step)
            _advance(walkers, np.array(spec.area) / 2, step)
            walkers = [walker for walker in walkers if not walker.errand.is_over(walker.ground)]
        if frame >= 0:
            yield _crowd(frame, walkers)


def _newcomer(spec: SceneSpec, planner: Planner, number: int, others: Floats) -> Pedestrian:
    own = chance(spec.seed, Topic.PERSON, number)
    crowded_start = number <= spec.people
    ground = planner.place_inside(others) if crowded_start else planner.door(others)
    return Pedestrian(
        number,
        ground,
        planner.errand(enters=not crowded_start),
        pace=own.uniform(*spec.speed),
        height=float(np.clip(own.normal(1.70, 0.10), 1.45, 1.98)),
        build=float(np.clip(own.normal(1.0, 0.09), 0.8, 1.25)),
        velocity=np.zeros(2),
        heading=own.uniform(-np.pi, np.pi),
        phase=own.uniform(0, 2 * np.pi),
    )


def _advance(walkers: list[Pedestrian], half: Floats, step: float) -> None:
    """Move everyone by one step of time; `half` is half the area's sides."""
    if not walkers:
        return
    ground = np.stack([walker.ground for walker in walkers])
    velocity = np.stack([walker.velocity for walker in walkers])
    wish = np.stack([_wish(walker) for walker in walkers])
    velocity = velocity + step * ((wish - velocity) / _REACTION + _repulsion(ground, velocity))
    speed = np.linalg.norm(velocity, axis=1)
    most = np.array([1.2 * walker.pace if not walker.errand.waits else 0.35 for walker in walkers])
    velocity *= np.minimum(1.0, most / np.maximum(speed, 1e-9))[:, None]
    stays = np.array([walker.errand.stays_inside for walker in walkers])
    moved = _apart(ground + step * velocity, stays, half - 0.05)
    for walker, place, way in zip(walkers, moved, (moved - ground) / step, strict=True):
        _turn_and_stride(walker, way, step)
        walker.ground, walker.velocity = place, way


def _wish(walker: Pedestrian) -> Floats:
    way = walker.errand.goal - walker.ground
    distance = float(np.hypot(*way))
    # Within half a metre of the goal people slow down.
    return np.asarray(way / max(distance, 1e-9) * walker.pace * min(1.0, distance / 0.5))


def _repulsion(ground: Floats, velocity: Floats) -> Floats:
    """Accelerations by which people push each other away, float64 (n, 2)."""
    away = ground[:, None] - ground[None]
    distance = np.linalg.norm(away, axis=2)
    away /= np.maximum(distance, 1e-9)[..., None]
    toward = velocity / np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)[:, None]
    ahead = -(away * toward[:, None]).sum(axis=2)
    strength = _PUSH * np.exp((_WIDTH - distance) / _REACH) * (_BEHIND + (1 - _BEHIND) * (1 + ahead) / 2)
    np.fill_diagonal(strength, 0.0)
    strength[distance > 2.5] = 0.0
    right = np.stack([-away[..., 1], away[..., 0]], -1)
    return np.asarray((strength[..., None] * (away + _SWERVE * right)).sum(axis=1))


def _apart(ground: Floats, stays: Flags, half: Floats) -> Floats:
    """Places moved as little as keeps bodies apart and those who stay inside the area."""
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


def _turn_and_stride(walker: Pedestrian, way: Floats, step: float) -> None:
    """Follow the way with chest and legs; one who waits faces what the errand says."""
    speed = float(np.hypot(*way))
    facing = walker.errand.facing(walker.ground) if speed < 0.25 else float(np.arctan2(way[1], way[0]))
    if facing is not None:
        turn = (facing - walker.heading + np.pi) % (2 * np.pi) - np.pi
        walker.heading += turn * min(1.0, step / 0.25)
    walker.swing += (min(1.0, speed) - walker.swing) * min(1.0, step / 0.3)
    walker.phase += 2 * np.pi * speed * step / stride(walker.height, walker.swing)


@overload
def stride(height: float, swing: float) -> float: ...
@overload
def stride(height: Floats, swing: Floats) -> Floats: ...
def stride(height: float | Floats, swing: float | Floats) -> float | Floats:
    """Length of two steps, metres, of people so tall whose limbs swing so far."""
    return height * (_STRIDE + _STRIDE_RISE * swing)


def _crowd(frame: int, walkers: list[Pedestrian]) -> Crowd:
    def column(name: str) -> Floats:
        return np.array([getattr(walker, name) for walker in walkers], float)

    ground = np.array([walker.ground for walker in walkers]).reshape(-1, 2)
    ids = np.array([walker.id for walker in walkers], np.int64)
    names = ("heading", "phase", "swing", "height", "build")
    return Crowd(frame, ids, ground, *(column(name) for name in names))
