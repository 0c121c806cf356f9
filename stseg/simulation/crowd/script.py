"""A crowd on scripted routes."""

from collections.abc import Iterator

import numpy as np

from stseg.simulation.crowd.social_forces import CrowdFrame, stride
from stseg.simulation.scene import SceneSpec, Topic, random_stream

_HALF_INTERVAL = 0.05
"""Half interval of the finite differences of velocity, seconds."""
_STANDING_SPEED = 0.05
"""Speed below which the heading stays, metres per second."""


def walk_routes(spec: SceneSpec) -> Iterator[CrowdFrame]:
    """The crowd at every frame of a scene with routes; ids count the routes from 1."""
    starts = np.array([[stop[1:] for stop in route.stops[:2]] for route in spec.routes])
    heading = np.arctan2(*(starts[:, 1] - starts[:, 0]).T[::-1])
    phase = random_stream(spec.seed, Topic.CROWD).uniform(0, 2 * np.pi, len(spec.routes))
    height = np.array([route.height for route in spec.routes])
    for frame in range(spec.frames):
        time = frame / spec.frame_rate
        before, after = (
            np.stack([route.ground(one) for route in spec.routes])
            for one in (time - _HALF_INTERVAL, time + _HALF_INTERVAL)
        )
        velocity = (after - before) / (2 * _HALF_INTERVAL)
        speed = np.hypot(*velocity.T)
        heading = np.where(speed > _STANDING_SPEED, np.arctan2(velocity[:, 1], velocity[:, 0]), heading)
        swing = np.minimum(1.0, speed)
        phase = phase + 2 * np.pi * speed / spec.frame_rate / stride(height, swing)
        here = np.flatnonzero([route.is_there(time) for route in spec.routes])
        ground = np.array([spec.routes[k].ground(time) for k in here]).reshape(-1, 2)
        yield CrowdFrame(
            frame, here + 1, ground, heading[here], phase[here], swing[here], height[here], np.ones(len(here))
        )
