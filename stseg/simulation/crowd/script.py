"""A crowd on scripted routes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stseg.arrays import Floats
from stseg.simulation.crowd.routes import Route
from stseg.simulation.crowd.social_forces import CrowdFrame, stride
from stseg.simulation.scene import SceneSpec, Topic, random_stream

_DIFFERENCE = 0.05
"""Half interval of the finite differences of velocity, seconds."""
_STANDING_SPEED = 0.05
"""Speed below which the heading stays, metres per second."""


def walk_routes(spec: SceneSpec) -> Iterator[CrowdFrame]:
    """The crowd at every frame of a scene with routes; ids count the routes from 1."""
    heading = np.array([_initial_heading(route) for route in spec.routes])
    phase = random_stream(spec.seed, Topic.CROWD).uniform(0, 2 * np.pi, len(spec.routes))
    height = np.array([route.height for route in spec.routes])
    for frame in range(spec.frames):
        time = frame / spec.frame_rate
        velocity = np.stack([_velocity(route, time) for route in spec.routes])
        speed = np.hypot(*velocity.T)
        heading = np.where(speed > _STANDING_SPEED, np.arctan2(velocity[:, 1], velocity[:, 0]), heading)
        swing = np.minimum(1.0, speed)
        phase = phase + 2 * np.pi * speed / spec.frame_rate / stride(height, swing)
        here = np.flatnonzero([route.is_there(time) for route in spec.routes])
        ground = np.array([spec.routes[k].ground(time) for k in here]).reshape(-1, 2)
        yield CrowdFrame(
            frame, here + 1, ground, heading[here], phase[here], swing[here], height[here], np.ones(len(here))
        )


def _initial_heading(route: Route) -> float:
    (_, *first), (_, *second) = route.stops[:2]
    return float(np.arctan2(second[1] - first[1], second[0] - first[0]))


def _velocity(route: Route, time: float) -> Floats:
    return (route.ground(time + _DIFFERENCE) - route.ground(time - _DIFFERENCE)) / (2 * _DIFFERENCE)
