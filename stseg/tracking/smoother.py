"""Places smoothed along each track by what came before and after (Rauch, Tung and Striebel 1965).

A body moves at constant velocity but for a white acceleration; each row is a measurement with its own covariance.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.config import MotionConfig


def smooth_places(trajectory: Rows, frame_rate: float, model: MotionConfig) -> Rows:
    """A copy with smoothed x, y and their covariance; raw_x and raw_y stay what each frame said.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
        Sorted by frame.
    frame_rate
        Frames per second.
    model
        Motion model.
    """
    smoothed = trajectory.copy()
    for identity in np.unique(trajectory["id"]):
        rows = np.flatnonzero(trajectory["id"] == identity)
        own = trajectory[rows]
        places = np.column_stack([own["raw_x"], own["raw_y"]])
        noise = np.array([[own["xx"], own["xy"]], [own["xy"], own["yy"]]]).transpose(2, 0, 1)
        ground, covariance = smoothed_path(own["frame"] / frame_rate, places, noise, model)
        smoothed["x"][rows], smoothed["y"][rows] = ground.T
        smoothed["xx"][rows], smoothed["xy"][rows] = covariance[:, 0, 0], covariance[:, 0, 1]
        smoothed["yy"][rows] = covariance[:, 1, 1]
    return smoothed


def smoothed_path(seconds: Floats, ground: Floats, noise: Floats, model: MotionConfig) -> tuple[Floats, Floats]:
    """One path.

    Parameters
    ----------
    seconds : float64 (n,)
        Rising.
    ground, noise : float64 (n, 2), (n, 2, 2)
        Measured places and their covariances, metres.
    model
        Motion model.

    Returns
    -------
    float64 (n, 2), float64 (n, 2, 2)
        Smoothed places and their covariances.
    """
    velocity_variance = model.speed_spread**2
    state, spread = np.append(ground[0], [0.0, 0.0]), np.diag([0.0, 0.0, velocity_variance, velocity_variance])
    spread[:2, :2] = noise[0]
    filtered, steps = [(state, spread)], [_step(b - a, model) for a, b in pairwise(seconds.tolist())]
    for (motion, turn), place, error in zip(steps, ground[1:], noise[1:], strict=True):
        state, spread = motion @ state, motion @ spread @ motion.T + turn
        gain = spread[:, :2] @ np.linalg.inv(spread[:2, :2] + error)
        state, spread = state + gain @ (place - state[:2]), spread - gain @ spread[:2]
        filtered.append((state, spread))
    result = [filtered[-1]]
    for (motion, turn), (state, spread) in zip(steps[::-1], filtered[-2::-1], strict=True):
        ahead = motion @ spread @ motion.T + turn
        gain = spread @ motion.T @ np.linalg.inv(ahead)
        later, later_spread = result[-1]
        result.append((state + gain @ (later - motion @ state), spread + gain @ (later_spread - ahead) @ gain.T))
    result.reverse()
    places: Floats = np.zeros((len(result), 2))
    spreads: Floats = np.zeros((len(result), 2, 2))
    for k, (middle, covariance) in enumerate(result):
        places[k], spreads[k] = middle[:2], covariance[:2, :2]
    return places, spreads


def _step(seconds: float, model: MotionConfig) -> tuple[Floats, Floats]:
    """Motion over some time, and the noise that it adds, both float64 (4, 4)."""
    motion = np.eye(4)
    motion[:2, 2:] = seconds * np.eye(2)
    turn = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]]) * model.velocity_noise**2
    return motion, np.asarray(np.kron(turn, np.eye(2)), np.float64)
