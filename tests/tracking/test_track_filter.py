"""The filter of tracks from frame to frame: against the textbook's, its consistency, and tracks in named scenes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import reference_core as reference
from checks import drawn, numbers
from hypothesis import strategies as st
from scenes import CONFIG, found, people
from simulated_people import smoothed

from stseg.arrays import Boxes, Floats, Ints, ViewEvidence
from stseg.baselines.huang_wang_2012.kalman_filters import corrected_filters, initial, innovations, predicted_filters
from stseg.config import MotionConfig
from stseg.identities.search.hypotheses import correct_place, predicted_variance
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.records.people import People
from stseg.records.sizes import Sizes
from stseg.tracking.filter.motion_model import process_noise, transition
from stseg.tracking.filter.track_filter import TrackFilter
from stseg.tracking.filter.track_state import BodyPlace, Measurement, PlacePosterior, TrackState

RATE = 8.0
IDENTITY = CONFIG.tracking
GHOSTS = found(people())
"""Nobody."""
NOTHING = Measurement(1.0, np.inf)
Way = Callable[[int], tuple[float, float, float] | None]
"""Place of a person in a frame: x, y, height in metres; None where the frame does not see them."""
BOXES, PIXELS = Boxes(np.zeros((0, 4)), np.zeros(0)), np.zeros((1, 1), np.float32)
TENTATIVE = [(-1, 2, BOXES, 2), (-5, 2, BOXES, 1), (-1, 0.4, BOXES, 1), (-1, 0.4, PIXELS, 2), (-1, 0.3, PIXELS, 1)]
STATES = st.tuples(numbers(-3, 3), numbers(-3, 3), numbers(-2, 2), numbers(-2, 2)).map(np.array)


def track_state(state: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0), odds: float = 1.0) -> TrackState:
    spread = np.diag([0.03, 0.02, 0.6, 0.5, 1.0, 0.9])
    spread[0, 2] = spread[2, 0] = spread[1, 3] = spread[3, 1] = 0.05
    return TrackState(3, 9, 10, np.array([*state, 0.2, -0.1]), spread, 1.7, 0.12**2, 0.42, 0.04**2, odds)


@drawn(100, STATES, numbers(0.01, 3), numbers(0.01, 3))
def test_constant_velocity(state: Floats, first: float, second: float) -> None:
    track = track_state(tuple(state))
    then = track.predicted(first, CONFIG.motion)
    np.testing.assert_allclose(then.state[:4], [*(state[:2] + first * state[2:]), *state[2:]])
    assert (np.linalg.eigvalsh(then.covariance[:4, :4] - np.diag([0, 0, 0.6, 0.5])).sum()) > 0
    at_once, in_steps = track.predicted(first + second, CONFIG.motion), then.predicted(second, CONFIG.motion)
    np.testing.assert_allclose(at_once.state, in_steps.state, atol=1e-9)
    np.testing.assert_allclose(at_once.covariance, in_steps.covariance, atol=1e-9)
    assert at_once.height_variance == pytest.approx(in_steps.height_variance)


@drawn(100, STATES, numbers(-1, 1), numbers(-1, 1), numbers(0.02, 0.5), numbers(-0.8, 0.8), numbers(0, 0.1))
def test_a_correction_is_the_textbooks(state: Floats, x: float, y: float, sd: float, slant: float, q: float) -> None:
    """A posterior of the body's place under its prediction holds all of a measurement of the body."""
    track = track_state(tuple(state)).predicted(0.3, CONFIG.motion)
    noise = sd**2 * np.array([[1.0, slant], [slant, 1.0]])
    body = BodyPlace.of(float(np.sqrt(q)))
    place, prior = body.ground(track.state) + np.array([x, y]), body.covariance(track.covariance)
    posterior = np.linalg.inv(np.linalg.inv(prior) + np.linalg.inv(noise))
    mean = posterior @ (np.linalg.solve(prior, body.ground(track.state)) + np.linalg.solve(noise, place))
    after = track.corrected(11, PlacePosterior(mean, posterior, body), NOTHING, NOTHING)
    white = noise + body.white * np.eye(2)
    expected, covariance = reference.kalman(track.state, track.covariance, place, white, body.matrix)
    np.testing.assert_allclose(after.state, expected, atol=1e-8)
    np.testing.assert_allclose(after.covariance, covariance, atol=1e-8)


def unchanged_place(track: TrackState) -> PlacePosterior:
    """The posterior of a frame that shows no place."""
    body = BodyPlace.of(0.15)
    return PlacePosterior(body.ground(track.state), body.covariance(track.covariance), body)


def test_a_posterior_that_says_nothing_new_changes_nothing() -> None:
    track = track_state((1.0, 2.0, 0.3, -0.2)).predicted(0.2, CONFIG.motion)
    after = track.corrected(12, unchanged_place(track), NOTHING, NOTHING)
    np.testing.assert_allclose(after.state, track.state)
    np.testing.assert_allclose(after.covariance, track.covariance)
    assert (after.track, after.last_seen, after.log_odds) == (3, 12, track.log_odds)
    assert (after.height, after.width) == pytest.approx((track.height, track.width))


def test_sizes_converge_and_what_frames_tell_is_used_once() -> None:
    """They are properties of the person: the mean of what the frames say, and ever surer."""
    noise, rng = 0.05, np.random.default_rng(2)
    seen = rng.normal(1.83, noise, 60)
    track, sure = track_state(), [0.12**2]
    for height in seen:
        tall, wide = Measurement(float(height), noise**2), Measurement(float(height) - 1.4, noise**2)
        track = track.corrected(11, unchanged_place(track), tall, wide)
        sure.append(track.height_variance)
    assert (np.diff(sure) < 0).all()
    weight = len(seen) / noise**2
    assert track.height_variance == pytest.approx(1 / (1 / 0.12**2 + weight))
    assert track.height == pytest.approx((1.7 / 0.12**2 + weight * seen.mean()) / (1 / 0.12**2 + weight))
    assert track.width == pytest.approx((0.42 / 0.04**2 + weight * (seen.mean() - 1.4)) / (1 / 0.04**2 + weight))
    later = track.predicted(4.0, CONFIG.motion)  # shoes, stoop, lens, clothes
    assert later.height_variance > track.height_variance and later.width_variance > track.width_variance
    # The prior of a frame's posterior, anybody's size, is taken out before the person's own comes in.
    track_filter = TrackFilter(RATE, CONFIG)
    tracks = found(people((0.0, 0.0, 1.85)))
    nothing = replace(tracks, sizes=Sizes.of_population(1, CONFIG.body))
    track_filter.update(0, tracks, GHOSTS)
    known = track_filter.tracks[0]
    for frame in range(1, 40):
        track_filter.update(frame, replace(nothing, track_index=np.zeros(1, np.int64)), GHOSTS)
    (track,) = track_filter.tracks
    assert track.height == pytest.approx(known.height, abs=1e-3)
    assert track.height_variance > known.height_variance


def follow(ways: list[Way], frames: range, order: int | None = None) -> tuple[list[list[int]], TrackFilter]:
    """The chains that these people get, one for each frame that sees them, and who is followed in the end."""
    track_filter = TrackFilter(RATE, CONFIG)
    chains: list[list[int]] = [[] for _ in ways]
    rng = np.random.default_rng(order)
    for frame in frames:
        turn = range(len(ways)) if order is None else rng.permutation(len(ways)).tolist()
        here = [(k, place) for k in turn if (place := ways[k](frame)) is not None]
        seen = found(people(*(place for _, place in here)), track_filter.predict(frame))
        tracks = track_filter.update(frame, seen, GHOSTS)
        assert len(set(tracks.tolist())) == len(tracks)  # no track is in two places
        for (k, _), chain in zip(here, tracks.tolist(), strict=True):
            chains[k].append(chain)
    return chains, track_filter


def walk(x: float, y: float, vx: float, vy: float, height: float = 1.7) -> Way:
    """Constant velocity in metres per second."""
    return lambda f: (x + vx * f / RATE, y + vy * f / RATE, height)


def except_for(way: Way, unseen: range) -> Way:
    return lambda f: None if f in unseen else way(f)


def test_walkers_are_expected_ahead_and_after_empty_frames() -> None:
    _, track_filter = follow([walk(-3, 1, 1.2, -0.4)], range(20))
    for ahead in (20, 24):
        expected = track_filter.predict(ahead)
        assert expected is not None
        there = np.array([[-3 + 1.2 * ahead / RATE, 1 - 0.4 * ahead / RATE]])
        np.testing.assert_allclose(expected.ground, there, atol=0.03)
    (track,) = track_filter.tracks
    np.testing.assert_allclose(track.state[2:4], [1.2, -0.4], atol=0.03)
    track_filter = TrackFilter(RATE, CONFIG)
    assert track_filter.predict(0) is None and track_filter.update(0, GHOSTS, GHOSTS).shape == (0,)
    expected = track_filter.predict(1)
    assert expected is not None and len(expected) == 0
    assert track_filter.update(1, found(people((0, 0)), expected), GHOSTS).tolist() == [1]


@pytest.mark.parametrize("order", range(3))
def test_crossing_walkers_keep_their_chains(order: int) -> None:
    (first, second), _ = follow([walk(-1.5, -0.1, 1, 0.1), walk(1.55, 0.2, -1, -0.05)], range(25), order)
    assert len(set(first)) == len(set(second)) == 1 and first[0] != second[0]


def meeting(side: float, height: float, back: bool) -> Way:
    """Somebody who comes from one side, stands near the middle for a second, and goes back or on to the other side."""

    def way(frame: int) -> tuple[float, float, float]:
        then = side if back or frame < 12 else -side
        return then * (0.1 + max(8 - frame, frame - 16, 0) / RATE), 0.0, height

    return way


@pytest.mark.parametrize("back", [True, False])
@pytest.mark.parametrize("heights", [(1.6, 1.8), (1.85, 1.7), (1.7, 1.7)])
def test_two_who_meet_are_told_apart_by_their_heights(back: bool, heights: tuple[float, float]) -> None:
    """One of them is out of sight while they stand: whether they then go back or on, motion cannot tell.

    Of two who are equally tall each is taken for the other, for a while at least.
    """
    left, right = meeting(-1.0, heights[0], back), meeting(1.0, heights[1], back)
    chains, _ = follow([except_for(left, range(9, 15)), right], range(28))
    assert ([set(chain) for chain in chains] == [{1}, {2}]) == (heights[0] != heights[1])


def test_who_turns_or_hides_is_the_same_and_far_away_is_new() -> None:
    turning: Way = lambda f: (f / RATE - 3.0, 0.0, 1.7) if f < 25 else (0.125, (f - 24) / RATE, 1.7)  # noqa: E731
    (chains,), _ = follow([turning], range(50))
    assert len(set(chains)) == 1
    for unseen in (range(10, 11), range(10, 14)):
        (chains,), _ = follow([except_for(walk(-1.5, 0, 1.2, 0), unseen)], range(24))
        assert set(chains) == {1}, unseen
    (chains,), _ = follow([lambda f: (0.0, 0.0, 1.7) if f < 10 else (2.5, 0.0, 1.7)], range(20))
    assert chains == [1] * 10 + [2] * 10


def test_odds_fall_while_out_of_sight_until_patience_ends() -> None:
    _, track_filter = follow([except_for(walk(0, 0, 0.3, 0), range(10, 99))], range(14))
    odds, spread = [], []
    for frame in range(14, 18):
        expected = track_filter.predict(frame)
        assert expected is not None
        odds.append(float(expected.existence[0]))
        spread.append(float(np.linalg.det(expected.covariance[0])))
    np.testing.assert_allclose(np.diff(odds), odds[1] - odds[0])
    assert odds[0] > odds[1]
    assert (np.diff(spread) > 0).all()
    for frames, most in ((10, 1 + 9 / 80), (99, 2.0)):  # whoever is seen may leave all the same
        just_seen = follow([walk(0, 0, 0.3, 0)], range(frames))[1].predict(frames)
        assert just_seen is not None and just_seen.existence[0] == pytest.approx(most)
    for gone, left in ((patience := round(IDENTITY.patience * RATE), 1), (patience + 1, 0)):
        _, track_filter = follow([except_for(walk(0, 0, 0, 0), range(10, 99))], range(10 + gone))
        assert len(track_filter.tracks) == left
    (chains,), _ = follow([except_for(walk(0, 0, 0, 0), range(10, 11 + patience))], range(40))
    assert chains == [1] * 10 + [2] * (len(chains) - 10)


def test_who_was_almost_believed_is_looked_for_once_more() -> None:
    """They have no number before they are found, and are forgotten if the next frame does not find them."""
    cases: list[tuple[bool, ViewEvidence, int, float]] = [
        *((again, BOXES, 4, -3.0) for again in (True, False)),
        *((True, PIXELS, views, odds) for views, odds in ((2, -3.0), (3, -1.0))),
    ]
    for found_again, view, views, odds in cases:
        track_filter, almost = TrackFilter(RATE, CONFIG), found(people((0.5, 0.5)), evidence=-1.0, views=views)
        assert track_filter.update(0, GHOSTS, almost, [None, view]).shape == (0,)
        expected = track_filter.predict(1)
        assert expected is not None
        np.testing.assert_array_equal(expected.ground, [[0.5, 0.5]])
        assert expected.existence[0] == odds  # a second box of the same thing is not a second witness
        assert track_filter.issued == 0
        now = found(people((0.52, 0.5)), expected) if found_again else GHOSTS
        assert track_filter.update(1, now, GHOSTS).tolist() == [1] * found_again
        assert track_filter.issued == len(track_filter.tracks) == int(found_again)


@pytest.mark.parametrize(("evidence", "place", "view", "looked_for"), TENTATIVE)
def test_who_is_not_looked_for_again(evidence: float, place: float, view: ViewEvidence, looked_for: int) -> None:
    """Who was hardly believed at all, and whoever stands beside somebody who is followed: it may be the same."""
    track_filter, almost = TrackFilter(RATE, CONFIG), found(people((place, 0.0)), evidence=evidence)
    track_filter.update(0, found(people((0, 0))), almost, [view])
    assert len(track_filter.predict(1) or ()) == looked_for
    assert [track.track for track in track_filter.tracks] == [1, 0][:looked_for]


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


def of_the_kalman_tracker(measured: Floats, noise: Floats) -> list[float]:
    filters, found = initial(measured[:1], noise[None], MOTION.speed_spread), []
    for place in measured[1:]:
        filters = predicted_filters(filters, SECONDS, MOTION)
        found.append(float(innovations(filters, place[None], noise[None])[0][0, 0]))
        filters = corrected_filters(filters, np.zeros(1, np.int64), place[None], noise[None])
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
    ("squares", "noise"), [(of_the_kalman_tracker, NOISE), (of_the_identity_search, ROUND * np.eye(2))]
)
def test_innovations_are_as_large_as_claimed(squares: Callable[[Floats, Floats], list[float]], noise: Floats) -> None:
    """Innovations are independent, so their squares are: the mean of n has a standard deviation of 2 / sqrt(n)."""
    found = np.array([squares(path, noise) for path in walks(noise)[1]])
    assert found.shape == (WALKS, STEPS - 1)
    assert found.mean() == pytest.approx(2.0, abs=4 * 2 / np.sqrt(found.size))


def lasting_errors(noise: Floats, people: int, frames: int, seconds: float) -> Floats:
    """Errors of which a part lasts, by the constants of places, float64 (person, frame, 2)."""
    rng, kept = np.random.default_rng(7), np.exp(-seconds / PLACE_ERROR.seconds)
    lasting = rng.normal(size=(people, frames, 2))
    for frame in range(1, frames):
        lasting[:, frame] = kept * lasting[:, frame - 1] + np.sqrt(1 - kept**2) * lasting[:, frame]
    white = rng.normal(size=lasting.shape)
    both = np.sqrt(PLACE_ERROR.lasting) * lasting + np.sqrt(PLACE_ERROR.white) * white
    return np.asarray(both @ np.linalg.cholesky(noise).T)


def test_smoothed_places_err_by_as_much_as_claimed() -> None:
    """Errors within a walk are alike, so walks alone are counted as independent."""
    true = walks(NOISE)[0]
    noise = np.asarray(np.tile(NOISE, (STEPS, 1, 1)), np.float64)
    measured = true + lasting_errors(NOISE, WALKS, STEPS, SECONDS)
    frames, one = np.arange(STEPS), np.ones(STEPS, np.int64)
    paths = [smoothed(frames, path, noise, 1 / SECONDS, one) for path in measured]
    pairs = [one for path, real in zip(paths, true, strict=True) for one in zip(path[0] - real, path[1], strict=True)]
    squares = [square(off, covariance) for off, covariance in pairs]
    assert np.mean(squares) == pytest.approx(2.0, abs=4 * 2 / np.sqrt(WALKS))
    # Rows that err alike are worth far less than as many independent ones.
    assert np.mean([np.trace(path[1][STEPS // 2]) for path in paths]) > 0.5 * np.trace(NOISE)


PEOPLE, FRAMES = 60, 45
"""People who are followed at the same time."""


def detections(ground: Floats, covariance: Floats, index: Ints) -> People:
    """Detections that measure places alone."""
    one, sizes = found(people(*np.zeros((len(ground), 2)))), Sizes.of_population(len(ground), CONFIG.body)
    return replace(one, ground=ground, covariance=covariance, track_index=index, sizes=sizes)


@pytest.mark.parametrize("rate", [5.0, 10.0, 25.0])
@pytest.mark.parametrize("detector_noise", [0.05, 0.1])
@pytest.mark.parametrize("place_noise", [0.15, 0.001])
def test_the_filter_is_as_right_as_it_is_sure(rate: float, detector_noise: float, place_noise: float) -> None:
    """Walks of the motion model, bodies that stray from them, a detector that gives exact posteriors of the bodies."""
    config = replace(CONFIG, motion=replace(MOTION, position_noise=place_noise))
    rng, noise, track_filter = np.random.default_rng(3), detector_noise**2 * np.eye(2), TrackFilter(rate, config)
    state = np.append(rng.normal(0, 300, (PEOPLE, 2)), rng.normal(0, MOTION.speed_spread, (PEOPLE, 2)), axis=1)
    strays = lasting_errors(place_noise**2 * np.eye(2), PEOPLE, FRAMES, 1 / rate)
    errors, claimed = [], []
    for frame in range(FRAMES):
        shown = state[:, :2] + strays[:, frame] + rng.normal(0, detector_noise, (PEOPLE, 2))
        predicted = track_filter.predict(frame)
        ground, covariance, index = shown, np.tile(noise, (PEOPLE, 1, 1)), np.full(PEOPLE, -1)
        if predicted is not None:
            gain = predicted.covariance @ np.linalg.inv(predicted.covariance + noise)
            ground = predicted.ground + (gain @ (shown - predicted.ground)[:, :, None])[:, :, 0]
            covariance, index = predicted.covariance - gain @ predicted.covariance, np.arange(PEOPLE)
        track_filter.update(frame, detections(ground, covariance, index), GHOSTS)
        if frame >= 15:
            errors.append([track.state[:4] - true for track, true in zip(track_filter.tracks, state, strict=True)])
            claimed.append([track.covariance[:4, :4] for track in track_filter.tracks])
        noises = rng.multivariate_normal(np.zeros(4), process_noise(1 / rate, MOTION), PEOPLE)
        state = state @ transition(1 / rate).T + noises
    error, spread = np.array(errors).reshape(-1, 4), np.array(claimed).reshape(-1, 4, 4)
    squares = np.einsum("ni,nij,nj->n", error[:, :2], np.linalg.inv(spread[:, :2, :2]), error[:, :2])
    assert 1.8 < squares.mean() < 2.3
    velocity = np.sqrt((error[:, 2:] ** 2).mean() / np.trace(spread[:, 2:, 2:], axis1=1, axis2=2).mean() * 2)
    assert velocity == pytest.approx(1.0, abs=0.1)
