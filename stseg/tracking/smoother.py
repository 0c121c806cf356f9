"""Fixed-interval smoothing of a track's places (Rauch, Tung and Striebel 1965).

The motion model is that of the track filter; each row is a measurement with its own covariance.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.config import MotionConfig
from stseg.tracking.motion_model import process_noise, transition
from stseg.tracking.rows_of_tracks import rows_of_tracks


def smooth_places(trajectory: Rows, frame_rate: float, model: MotionConfig) -> Rows:
    """A copy with smoothed x, y and their covariance; raw_x and raw_y stay the detection's.

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
    for rows in rows_of_tracks(trajectory["id"]):
        own = trajectory[rows]
        places = np.column_stack([own["raw_x"], own["raw_y"]])
        noise = np.array([[own["xx"], own["xy"]], [own["xy"], own["yy"]]]).transpose(2, 0, 1)
        ground, covariance = smoothed_path(own["frame"] / frame_rate, places, noise, model)
        smoothed["x"][rows], smoothed["y"][rows] = ground.T
        smoothed["xx"][rows], smoothed["xy"][rows] = covariance[:, 0, 0], covariance[:, 0, 1]
        smoothed["yy"][rows] = covariance[:, 1, 1]
    return smoothed


def smoothed_path(seconds: Floats, ground: Floats, noise: Floats, model: MotionConfig) -> tuple[Floats, Floats]:
    """Smoothed places of one track.

    Parameters
    ----------
    seconds : float64 (n,)
        Increasing.
    ground, noise : float64 (n, 2), (n, 2, 2)
        Measured places and their covariances, metres.
    model
        Motion model.

    Returns
    -------
    float64 (n, 2), float64 (n, 2, 2)
        Smoothed places and their covariances.
    """
    state, spread = np.append(ground[0], [0.0, 0.0]), np.diag([0.0, 0.0, model.speed_spread**2, model.speed_spread**2])
    spread[:2, :2] = noise[0]
    number = len(seconds)
    states, spreads = np.zeros((number, 4)), np.zeros((number, 4, 4))
    predicted, ahead = np.zeros((number, 4)), np.zeros((number, 4, 4))
    states[0], spreads[0] = state, spread
    steps = [(transition(b - a), process_noise(b - a, model)) for a, b in pairwise(seconds.tolist())]
    for k, (motion, turn) in enumerate(steps, 1):
        state, spread = motion @ state, motion @ spread @ motion.T + turn
        predicted[k], ahead[k] = state, spread
        gain = spread[:, :2] @ np.linalg.inv(spread[:2, :2] + noise[k])
        state, spread = state + gain @ (ground[k] - state[:2]), spread - gain @ spread[:2]
        states[k], spreads[k] = state, spread
    motions = np.array([motion for motion, _ in steps]).reshape(-1, 4, 4)
    gains = spreads[:-1] @ motions.transpose(0, 2, 1) @ np.linalg.inv(ahead[1:])
    for k in range(number - 2, -1, -1):
        states[k] += gains[k] @ (states[k + 1] - predicted[k + 1])
        spreads[k] += gains[k] @ (spreads[k + 1] - ahead[k + 1]) @ gains[k].T
    return states[:, :2].copy(), spreads[:, :2, :2].copy()
