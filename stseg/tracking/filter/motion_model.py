"""The motion model of people: constant velocity but for a white acceleration (a nearly-constant-velocity model).

State x, y, vx, vy in metres and metres per second. Over t seconds

    x' = F x,  P' = F P F^T + Q,  F = [[I, t I], [0, I]],  Q = velocity_noise^2 [[t^3/3 I, t^2/2 I], [t^2/2 I, t I]]

(Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stseg.arrays import Floats
from stseg.config import MotionConfig


@lru_cache(maxsize=256)
def transition(seconds: float) -> Floats:
    """F, float64 (4, 4); read-only, since frames follow each other at the same few intervals."""
    motion = np.eye(4)
    motion[:2, 2:] = seconds * np.eye(2)
    motion.flags.writeable = False
    return motion


@lru_cache(maxsize=256)
def process_noise(seconds: float, model: MotionConfig) -> Floats:
    """Q, float64 (4, 4); read-only."""
    axis = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]]) * model.velocity_noise**2
    noise = np.asarray(np.kron(axis, np.eye(2)), np.float64)
    noise.flags.writeable = False
    return noise
