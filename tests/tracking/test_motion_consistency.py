"""The claimed errors of textbook filters are their true ones on walks of the motion model.

Bar-Shalom et al. 2001, section 5.4. The Kalman filters and the identity search are whole filters. Of the tracks' filter
only `TrackState` is here, corrected by posteriors with its prediction as their whole prior. `TrackFilter` itself gives
the detector a wider prior (`motion.position_noise`); nothing here says that its claims are true.

The mean normalised square of an error of two coordinates is 2: of innovations (NIS), and of smoothed places (NEES).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from stseg.arrays import Floats
from stseg.baselines.huang_wang_2012.kalman_filters import corrected, initial, innovations, predicted
from stseg.config import MotionConfig
from stseg.identities.search.hypotheses import correct_place, predicted_variance
from stseg.tracking.filter.motion_model import process_noise, transition
from stseg.tracking.filter.track_filter import Measurement, TrackState
from stseg.trajectories.smoother import smoothed_paths

MOTION = MotionConfig()
WALKS, STEPS, SECONDS = 200, 15, 0.2
NOISE = np.array([[0.02, 0.006], [0.006, 0.01]])
ROUND = 0.015
"""Variance of both coordinates, for the filter of the identity search."""


def walks(noise: Floats) -> tuple[Floats, Floats]:
    """True and measured places of walks of the motion model, float64 (walk, step, 2)."""
    rng = np.random.default_rng(5)
    state = np.concatenate([rng.normal(0, 3, (WALKS, 2)), rng.normal(0, MOTION.speed_spread, (WALKS, 2))], axis=1)
    true = np.empty((WALKS, STEPS, 2))
    for step in range(STEPS):
        true[:, step] = state[:, :2]
        turn = rng.multivariate_normal(np.zeros(4), process_noise(SECONDS, MOTION), WALKS)
        state = state @ transition(SECONDS).T + turn
    return true, true + rng.multivariate_normal(np.zeros(2), noise, (WALKS, STEPS))


def square(off: Floats, covariance: Floats) -> float:
    return float(off @ np.linalg.solve(covariance, off))


def of_track_states(measured: Floats, noise: Floats) -> list[float]:
    """Posteriors as of a detector with the prediction as its whole prior, without position noise."""
    spread = np.diag([0, 0, MOTION.speed_spread**2, MOTION.speed_spread**2])
    spread[:2, :2] = noise
    state = TrackState(1, 0, np.append(measured[0], [0, 0]), spread, 1.7, 0.01, 0.4, 0.01, 0.0)
    size, found = Measurement(1.7, 0.01), []
    for frame, place in enumerate(measured[1:], 1):
        state = state.predicted(SECONDS, MOTION)
        before = state.covariance[:2, :2]
        found.append(square(place - state.state[:2], before + noise))
        gain = before @ np.linalg.inv(before + noise)
        ground = state.state[:2] + gain @ (place - state.state[:2])
        state = state.corrected(frame, ground, before - gain @ before, size, size, 0.0)
    return found


def of_the_kalman_tracker(measured: Floats, noise: Floats) -> list[float]:
    filters, found = initial(measured[:1], noise[None], MOTION.speed_spread), []
    for place in measured[1:]:
        filters = predicted(filters, SECONDS, MOTION)
        found.append(float(innovations(filters, place[None], noise[None])[0][0, 0]))
        filters = corrected(filters, np.zeros(1, np.int64), place[None], noise[None])
    return found


def of_the_identity_search(measured: Floats, noise: Floats) -> list[float]:
    variance, turn = float(noise[0, 0]), MOTION.velocity_noise**2
    state, covariance = np.append(measured[:1], [[0.0, 0.0]], 1), np.array([[variance, 0.0, MOTION.speed_spread**2]])
    found = []
    for place in measured[1:]:
        total = predicted_variance(covariance, 0, SECONDS, turn) + variance
        found.append(float(((place - state[0, :2] - SECONDS * state[0, 2:]) ** 2).sum() / total))
        correct_place(state, covariance, 0, SECONDS, place[None], noise[:1, 0], 0, turn)
    return found


@pytest.mark.parametrize(
    ("squares", "noise"),
    [
        (of_track_states, NOISE),
        (of_the_kalman_tracker, NOISE),
        (of_the_identity_search, ROUND * np.eye(2)),
    ],
)
def test_innovations_are_as_large_as_claimed(squares: Callable[[Floats, Floats], list[float]], noise: Floats) -> None:
    """Innovations are independent, so their squares are: the mean of n has a standard deviation of 2 / sqrt(n)."""
    found = np.array([squares(path, noise) for path in walks(noise)[1]])
    assert found.shape == (WALKS, STEPS - 1)
    assert found.mean() == pytest.approx(2.0, abs=4 * 2 / np.sqrt(found.size))


def test_smoothed_places_err_by_as_much_as_claimed() -> None:
    """Errors within a walk are alike, so walks alone are counted as independent."""
    true, measured = walks(NOISE)
    seconds, noise = (
        np.asarray(np.arange(STEPS) * SECONDS, np.float64),
        np.asarray(np.tile(NOISE, (STEPS, 1, 1)), np.float64),
    )
    paths = [smoothed_paths(seconds, path, noise, [np.arange(STEPS)], MOTION) for path in measured]
    squares = [
        [square(*one) for one in zip(path[0] - real, path[1], strict=True)]
        for path, real in zip(paths, true, strict=True)
    ]
    assert np.mean(squares) == pytest.approx(2.0, abs=4 * 2 / np.sqrt(WALKS))
