"""The motion model of people: constant velocity but for a white acceleration (a nearly-constant-velocity model).

State x, y, vx, vy in metres and metres per second. Over t seconds

    x' = F x,  P' = F P F^T + Q,  F = [[I, t I], [0, I]],  Q = velocity_noise^2 [[t^3/3 I, t^2/2 I], [t^2/2 I, t I]]

(Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2).

Errors of places are correlated over time (`stseg.noise.lasting_error`): a white part, and a part that decays with tau.
That part, in its own standard deviations, is a state u of two more coordinates (an augmented state, section 8.2):

    u' = r u + N(0, (1 - r^2) I),  r = exp(-t / tau)
"""

from functools import lru_cache

import numpy as np

from stseg.arrays import Floats
from stseg.config import MotionConfig
from stseg.noise.lasting_error import PLACE_ERROR


@lru_cache(maxsize=256)
def transition(seconds: float) -> Floats:
    """F, float64 (4, 4); read-only; kept, since frames follow each other at few intervals."""
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


@lru_cache(maxsize=256)
def augmented_transition(seconds: float) -> Floats:
    """The transition of x, y, vx, vy, u1, u2, float64 (6, 6); read-only."""
    motion = np.zeros((6, 6))
    motion[:4, :4], motion[4:, 4:] = transition(seconds), _lasting_correlation(seconds) * np.eye(2)
    motion.flags.writeable = False
    return motion


@lru_cache(maxsize=256)
def augmented_noise(seconds: float, model: MotionConfig) -> Floats:
    """The process noise of x, y, vx, vy, u1, u2, float64 (6, 6); read-only."""
    noise = np.zeros((6, 6))
    noise[:4, :4], noise[4:, 4:] = process_noise(seconds, model), (1.0 - _lasting_correlation(seconds) ** 2) * np.eye(2)
    noise.flags.writeable = False
    return noise


def _lasting_correlation(seconds: float) -> float:
    """r, the share of the lasting part that is left after some seconds."""
    return float(np.exp(-seconds / PLACE_ERROR.seconds))
