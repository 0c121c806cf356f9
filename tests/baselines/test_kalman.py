"""The tracker `kalman`: filters against a plain one, gates, patience, and identities that stand."""

from dataclasses import replace

import numpy as np
import pytest
import reference_core as reference
from checks import drawn
from hypothesis import strategies as st
from scenes import CONFIG, FRAME_RATE, found, people, room

from stseg.arrays import Floats, Rows
from stseg.baselines.huang_wang_2012.kalman import KalmanTracker
from stseg.baselines.huang_wang_2012.kalman_filters import corrected_filters, initial, innovations, predicted_filters
from stseg.config import Config, KalmanConfig, MotionConfig
from stseg.records.sparse_volume import SparseVolume
from stseg.trackers import FrameObservations, FusedFrame
from stseg.trajectories.final_tracks import committed_tracks

RIG = room()
UNSEEN = FrameObservations((None,) * 4, (None,) * 4)
EMPTY = SparseVolume.whole(np.full(RIG.grid.shape, -3.0, np.float32))


def follow(frames: list[list[tuple[float, float]]], config: Config = CONFIG) -> tuple[Rows, Rows]:
    """Trajectory and events of people found at places frame by frame."""
    tracker = KalmanTracker(RIG, config, 0)
    commits = [
        commit
        for frame, places in enumerate(frames)
        for commit in tracker.add(
            FusedFrame(frame, found(people(*places), tracker.predict(frame)), found(people()), EMPTY), UNSEEN
        )
    ]
    assert tracker.finish() == []
    return (np.concatenate([c.trajectory for c in commits]), np.concatenate([c.events for c in commits]))


def plain(places: Floats, noise: float, seconds: float, config: MotionConfig) -> tuple[Floats, Floats]:
    """One person's filter, in the words of a textbook."""
    motion = np.kron([[1, seconds], [0, 1]], np.eye(2))
    brownian = np.kron([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]], np.eye(2))
    state = np.append(places[0], [0, 0])
    covariance = np.diag([noise, noise, config.speed_spread**2, config.speed_spread**2])
    for place in places[1:]:
        covariance = motion @ covariance @ motion.T + config.velocity_noise**2 * brownian
        state, covariance = reference.kalman(motion @ state, covariance, place, noise * np.eye(2))
    return state, covariance


@drawn(30, st.integers(0, 2**32 - 1), st.integers(1, 6), st.floats(0.02, 0.5))
def test_filters_side_by_side_are_each_a_plain_one(seed: int, length: int, seconds: float) -> None:
    config, noise = MotionConfig(), 0.03
    paths = np.random.default_rng(seed).normal(0.0, 1.0, (3, length, 2))
    error = np.tile(noise * np.eye(2), (3, 1, 1))
    filters = initial(paths[:, 0], error, config.speed_spread)
    for step in range(1, length):
        filters = corrected_filters(predicted_filters(filters, seconds, config), np.arange(3), paths[:, step], error)
    for path, state, covariance in zip(paths, *filters, strict=True):
        expected = plain(path, noise, seconds, config)
        np.testing.assert_allclose(state, expected[0], atol=1e-9)
        np.testing.assert_allclose(covariance, expected[1], atol=1e-9)


def test_innovation_is_twice_the_negative_log_likelihood() -> None:
    born = initial(np.array([[0.0, 0.0], [1.0, 2.0]]), np.tile(0.04 * np.eye(2), (2, 1, 1)), 0.8)
    filters = predicted_filters(born, 0.2, MotionConfig())
    place, noise = np.array([[0.3, -0.1]]), np.array([[[0.05, 0.01], [0.01, 0.02]]])
    squares, cost = innovations(filters, place, noise)
    for k in range(2):
        spread = filters.covariance[k, :2, :2] + noise[0]
        off = place[0] - filters.state[k, :2]
        assert squares[k, 0] == pytest.approx(off @ np.linalg.solve(spread, off))
        assert cost[k, 0] == pytest.approx(squares[k, 0] + np.log(np.linalg.det(spread)))


def test_two_who_cross_or_turn_back_keep_their_names() -> None:
    """Where they meet, places alone do not tell them apart, but the ways that they come do."""
    step = 1.2 / FRAME_RATE
    frames = [[(-1.5 + step * k, 0.1), (1.5 - step * k, -0.1)] for k in range(20)]
    rows, events = follow(frames)
    assert [(bytes(e["kind"]), int(e["id"])) for e in events] == [(b"birth", 1), (b"birth", 2)]
    assert np.ptp(rows["raw_y"][rows["id"] == 1]) == 0.0
    assert rows["raw_x"][rows["id"] == 1].tolist() == [x for (x, _), _ in frames]
    # By their ways alone they would have passed each other.
    step, turned = 1.2 / FRAME_RATE, 10
    short, tall = 1.62, 1.86
    tracker, names = KalmanTracker(RIG, CONFIG, 0), []
    for frame in range(2 * turned):
        away = 0.05 + step * abs(frame - turned)
        standing = people((-away, 0.0, short), (away, 0.0, tall))
        shown = found(standing, tracker.predict(frame))
        (commit,) = tracker.add(FusedFrame(frame, shown, found(people()), EMPTY), UNSEEN)
        rows = commit.trajectory[np.argsort(commit.trajectory["raw_x"])]
        names.append(rows["id"].tolist())
    assert names == [names[0]] * len(names)


def test_places_beyond_the_gate_or_too_late_are_somebody_new() -> None:
    rows, events = follow([[(0.0, 0.0)]] * 8 + [[(1.2, 0.0)]])
    assert rows["id"].tolist() == [1] * 8 + [2]
    wide = replace(CONFIG, kalman=KalmanConfig(gate_probability=1 - 1e-12))
    rows, events = follow([[(0.0, 0.0)]] * 8 + [[(0.8, 0.0)]], wide)
    assert rows["id"].tolist() == [1] * 9 and len(events) == 1
    patience = round(CONFIG.kalman.patience * FRAME_RATE)
    for gap, ids in ((patience - 1, [1]), (patience, [1, 2])):
        rows, events = follow([[(0.0, 0.0)]] * 8 + [[]] * gap + [[(0.0, 0.0)]] * 3)
        assert np.unique(rows["id"]).tolist() == ids
        deaths = events[events["kind"] == b"death"]
        assert deaths["reason"].tolist() == [b"not found for 1 s"] * (len(ids) - 1)


def test_rows_hold_places_of_long_tracks_without_gaps() -> None:
    jitter = [0.0, 0.1, -0.1, 0.1, -0.1, 0.1, -0.1, 0.1]
    rows, _ = follow([[(0.0, y)] for y in jitter])
    assert rows["raw_y"].tolist() == jitter and np.abs(rows["y"][4:]).max() < 0.08
    assert (rows["xx"][1:] < rows["xx"][0]).all()
    places = [[(-1.0, 0.0)]] * 8 + [[]] * 2 + [[(-1.0, 0.0)]] * 8
    places[3] = [(-1.0, 0.0), (1.5, 1.5)]
    rows, events = follow(places)
    whole = committed_tracks(rows, events, FRAME_RATE, CONFIG.tracking)
    assert whole.trajectory["id"].tolist() == [1] * 18
    assert whole.trajectory["frame"].tolist() == list(range(18))
    assert sorted(set(whole.identity.tolist())) == [0, 1] and b"dropped" in whole.events["kind"].tolist()
