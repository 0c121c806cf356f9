"""Smoothed paths: the exact Gaussian posterior of a body of white acceleration, nearer to the truth than its rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import numbers

from stseg.arrays import Floats, Ints
from stseg.config import MotionConfig
from stseg.records.tables import TRAJECTORY
from stseg.trajectories.smoother import smooth_places, smoothed_paths

RATE = 8.0
MOTION = MotionConfig()
PACE = 0.8


def conditioned(seconds: Floats, ground: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """The same, as one joint Gaussian of all places of one path, conditioned on all measurements at once.

    The first place is known by its measurement alone, so the prior is written relative to it: place at t is
    first + t v + the twice integrated white noise, whose covariance at s <= t is turn^2 s^2 (3 t - s) / 6.
    """
    n, since = len(seconds), seconds - seconds[0]
    early, late = np.minimum.outer(since, since), np.maximum.outer(since, since)
    along = MOTION.velocity_noise**2 * early**2 * (3 * late - early) / 6 + PACE**2 * np.outer(since, since)
    prior = np.kron(along, np.eye(2)) + np.kron(np.ones((n, n)), noise[0])
    measured = np.zeros((2 * n - 2, 2 * n))
    measured[:, 2:] = np.eye(2 * n - 2)
    error = np.zeros((2 * n - 2, 2 * n - 2))
    for k, own in enumerate(noise[1:]):
        error[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = own
    gain = prior @ measured.T @ np.linalg.inv(measured @ prior @ measured.T + error)
    mean = np.tile(ground[0], n)
    mean = mean + gain @ (ground[1:].ravel() - measured @ mean)
    covariance = prior - gain @ measured @ prior
    return mean.reshape(n, 2), np.stack([covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(n)])


@st.composite
def measured(draw: st.DrawFn) -> tuple[Ints, Floats, Floats]:
    """Uneven frames, places and their covariances."""
    frames = np.array(sorted(draw(st.sets(st.integers(0, 40), min_size=1, max_size=12))))
    rng = np.random.default_rng(draw(st.integers(0, 9999)))
    ground = rng.normal(0, 2, (len(frames), 2))
    root = rng.normal(0, draw(numbers(0.05, 0.3)), (len(frames), 2, 2))
    return frames, ground, root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(2)


@settings(deadline=None)
@given(measured())
def test_a_path_is_what_all_its_measurements_say_at_once(path: tuple[Ints, Floats, Floats]) -> None:
    frames, ground, noise = path
    places, spread = smoothed_paths(frames / RATE, ground, noise, [np.arange(len(frames))], MOTION)
    expected, covariance = conditioned(frames / RATE, ground, noise)
    np.testing.assert_allclose(places, expected, atol=1e-9, rtol=0)
    np.testing.assert_allclose(spread, covariance, atol=1e-9, rtol=0)


@settings(deadline=None)
@given(measured())
def test_smoothing_never_knows_less(path: tuple[Ints, Floats, Floats]) -> None:
    frames, ground, noise = path
    _, spread = smoothed_paths(frames / RATE, ground, noise, [np.arange(len(frames))], MOTION)
    assert (np.linalg.eigvalsh(spread) > 0).all()
    assert (np.linalg.eigvalsh(noise - spread) > -1e-9).all()


def test_a_single_measurement_stays_what_it_is() -> None:
    ground, noise = np.array([[1.0, 2.0]]), np.array([[[0.02, 0.01], [0.01, 0.03]]])
    places, spread = smoothed_paths(np.array([3.0]), ground, noise, [np.arange(1)], MOTION)
    np.testing.assert_array_equal(places, ground)
    np.testing.assert_array_equal(spread, noise)


@pytest.mark.parametrize("seed", range(3))
def test_a_noisy_walk_gets_nearer_to_the_truth(seed: int) -> None:
    """Two people at once, one of them seen in every third frame only; raw places stay."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(80, TRAJECTORY)
    rows["frame"][:60], rows["id"][:60] = range(60), 4
    rows["frame"][60:], rows["id"][60:] = range(0, 60, 3), 2
    seconds = rows["frame"] / RATE
    true = np.column_stack([-3 + 0.8 * seconds, np.where(rows["id"] == 4, 1 - 0.2 * seconds, 2.0)])
    rows["xx"] = rows["yy"] = 0.1**2
    rows["raw_x"], rows["raw_y"] = (true + rng.normal(0, 0.1, true.shape)).T
    rows["x"], rows["y"], rows["height"] = rows["raw_x"], rows["raw_y"], 1.7
    rows = rows[np.lexsort((rows["id"], rows["frame"]))]
    true = true[np.lexsort((np.repeat([4, 2], [60, 20]), np.concatenate([np.arange(60), np.arange(0, 60, 3)])))]
    before = rows.copy()
    smoothed = smooth_places(rows, RATE, MOTION)
    np.testing.assert_array_equal(rows, before)
    for name in ("frame", "id", "raw_x", "raw_y", "height"):
        np.testing.assert_array_equal(smoothed[name], rows[name])
    for identity, share in ((4, 0.7), (2, 0.95)):
        own = rows["id"] == identity
        raw, now = (
            float(np.hypot(*(np.column_stack([table[x], table[y]])[own] - true[own]).T).mean())
            for table, x, y in ((rows, "raw_x", "raw_y"), (smoothed, "x", "y"))
        )
        assert now < share * raw
        assert (smoothed["xx"][own] < 0.1**2).all()


@settings(deadline=None)
@given(measured(), measured())
def test_paths_smoothed_at_once_are_as_each_alone(
    one: tuple[Ints, Floats, Floats], other: tuple[Ints, Floats, Floats]
) -> None:
    frames, ground, noise = (np.concatenate(pair) for pair in zip(one, other, strict=True))
    tracks = np.split(np.arange(len(frames)), [len(one[0])])
    both = smoothed_paths(frames / RATE, ground, noise, tracks, MOTION)
    for rows in tracks:
        alone = smoothed_paths(frames[rows] / RATE, ground[rows], noise[rows], [np.arange(len(rows))], MOTION)
        np.testing.assert_array_equal(both[0][rows], alone[0])
        np.testing.assert_array_equal(both[1][rows], alone[1])


def test_nobody_at_all() -> None:
    assert len(smooth_places(np.zeros(0, TRAJECTORY), RATE, MOTION)) == 0
