"""The tracker `belief`: each equation of DP06 against a plain one, and people whom views follow together."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import reference_belief as plain
from checks import compiled_only, drawn
from coloured_people import FLOOR, RIG, follow, frame_of, observations_of, painted, rows_of
from hypothesis import strategies as st
from scenes import CONFIG, FRAME_RATE, SIZE, people
from scipy.stats import multivariate_normal
from strategies import cameras

from stseg.arrays import Bytes, Floats, Observation
from stseg.baselines.du_piater_2006.exclusion import exclusion
from stseg.baselines.du_piater_2006.histogram import BINS, HSV_BINS, PARTS, POINTS, histograms
from stseg.baselines.du_piater_2006.particles import Motion, Particles, Prediction, fill_origin, systematic
from stseg.baselines.du_piater_2006.potential import Outlier, Potential
from stseg.baselines.du_piater_2006.star import Rounds, Star, propagate
from stseg.baselines.du_piater_2006.target import Target, in_front, target_likelihoods
from stseg.baselines.du_piater_2006.target_likelihood import TargetLikelihood, squares
from stseg.baselines.du_piater_2006.tracker import BeliefTracker
from stseg.baselines.du_piater_2006.view import StarView
from stseg.config import BeliefConfig
from stseg.geometry import Camera
from stseg.kernels.accelerate import COMPILED
from stseg.trackers import FrameObservations

VIEWS = [StarView.of(camera, RIG.grid) for camera in RIG.cameras]
MOTION = Motion(1 / FRAME_RATE, 0.5, 0.8)
FEW = BeliefConfig(particles=30)


def images_of(standing: Floats) -> list[Bytes | None]:
    """The four cameras' images of people."""
    return [painted(camera, standing) for camera in RIG.cameras]


def known(standing: Floats) -> Target:
    """Somebody of SHIRTS[0] whose colours all views have learned."""
    target = Target.at(1, standing[0, :2], np.eye(2) * 0.03**2, 1.7, 4, 30, 0.8, np.random.default_rng(3))
    target.learn(VIEWS, images_of(standing[:1]), standing[0, :2], [np.zeros((0, 4))] * 4, 1.0)
    return target


def spots(data: st.DataObject, n: int) -> Floats:
    """Points about the room, metres."""
    return np.array(data.draw(st.lists(st.tuples(*[st.floats(-2, 2)] * 2), min_size=n, max_size=n)))


@drawn(15, st.data())
def test_a_prediction_is_a_mixture(data: st.DataObject) -> None:
    n, k = data.draw(st.integers(1, 5)), data.draw(st.integers(1, 4))
    centre, place = spots(data, n), spots(data, k)
    weight = np.arange(1.0, n + 1) / (n * (n + 1) / 2)
    axes = np.array([[30.0, 4.0], [-3.0, 12.0]])
    prediction = Prediction(100 * centre, np.zeros_like(centre), weight, axes, MOTION)
    covariance = MOTION.place_variance * axes @ axes.T
    expected = [weight @ [multivariate_normal.pdf(100 * p, 100 * c, covariance) for c in centre] for p in place]
    np.testing.assert_allclose(prediction.density(100 * place), expected, rtol=1e-9, atol=1e-300)


def test_predictions_go_on_and_who_is_ahead_is_faster() -> None:
    walking = Particles(np.array([[1.0, 2.0]]), np.array([[0.8, -0.4]]), np.ones(1))
    prediction = Prediction.of(walking, np.eye(2), MOTION)
    np.testing.assert_allclose(prediction.mean, [1.1, 1.95])
    drawn = prediction.draw(4000, np.random.default_rng(1))
    np.testing.assert_allclose(drawn.mean(0), [1.1, 1.95], atol=0.02)
    np.testing.assert_allclose(np.cov(drawn.T), prediction.covariance, atol=0.003)
    # The velocity follows the place as the covariance of a random walk of the velocity says.
    still = Particles(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1))
    prediction = Prediction.of(still, np.eye(2), MOTION)
    place = np.tile([0.2, 0.0], (4000, 1))
    settled = prediction.settled(place, np.full(4000, 1 / 4000), np.random.default_rng(2))
    np.testing.assert_allclose(settled.velocity.mean(0), [MOTION.gain * 0.2, 0.0], atol=0.02)
    assert settled.velocity[:, 1].var() == pytest.approx(MOTION.velocity_variance, rel=0.1)


def test_a_particle_comes_from_one_near_it() -> None:
    origin = np.empty(300, np.int64)
    centre, weight = np.array([[0.0, 0.0], [1.0, 0.0], [50.0, 0.0]]), np.array([0.5, 0.25, 0.25])
    inverse, lot = np.array([1.0, 0.0, 1.0]), (np.arange(300) + 0.5) / 300
    fill_origin(np.tile([0.5, 0.0], (300, 1)), centre, weight, inverse, lot, origin)
    assert np.bincount(origin, minlength=3).tolist() == [200, 100, 0]
    fill_origin(np.tile([49.0, 0.0], (300, 1)), centre, weight, inverse, lot, origin)
    assert (origin == 2).all()


@drawn(100, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8).filter(lambda w: sum(w) > 0.1), st.floats(0, 0.999))
def test_drawn_as_often_as_the_weight_says(weight: list[float], lot: float) -> None:
    share = np.array(weight) / sum(weight)
    often = np.bincount(systematic(share, 40, lot), minlength=len(share))
    assert np.abs(often - 40 * share).max() < 1 + 1e-6


@drawn(20, cameras(lenses=False), st.floats(-1, 1), st.floats(-1, 1))
def test_the_jacobians_are_slopes_of_the_homography(camera: Camera, x: float, y: float) -> None:
    view, ground = StarView.of(camera, RIG.grid), np.array([[x, y]])
    pixel = view.to_pixel(ground)
    np.testing.assert_allclose(view.to_ground(pixel), ground, atol=1e-8)
    step = 1e-5
    moved = (view.to_pixel(ground + step * np.eye(2)) - pixel).T / step
    np.testing.assert_allclose(view.pixel_slope(ground[0]), moved, rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(view.ground_slope(pixel)[0] @ view.pixel_slope(ground[0]), np.eye(2), atol=1e-7)


def test_a_view_shows_those_in_its_image_and_the_front_one() -> None:
    assert (np.abs(VIEWS[0].to_ground(np.array([[64.0, -400.0]]))) > 1e3).all()
    assert np.isfinite(VIEWS[0].ground_slope(np.array([[64.0, -400.0]]))).all()
    assert VIEWS[0].shows(np.zeros(2), 1.7, 0.5) and not VIEWS[0].shows(np.array([-3.4, -3.3]), 1.7, 0.5)
    # The first corner camera stands at (-3.5, -3.5).
    boxes = in_front(np.array([[0.5, 0.5], [0.0, 0.0], [1.0, -1.0]]), np.full(3, 1.7), VIEWS[0])
    np.testing.assert_allclose(boxes[0], VIEWS[0].boxes(np.zeros((1, 2)), 1.7))
    assert [len(b) for b in boxes] == [1, 0, 0]


def test_bins_of_colours_and_distances_of_histograms() -> None:
    """Colours on the border of two bins may fall in either."""
    for colour in np.ndindex(8, 8, 8):
        blue, green, red = ((np.array(colour) * 4 + 0.5) / 32).tolist()
        nearly = {plain.hsv_bin((blue + off, green, red)) for off in (-1e-9, 1e-9)}
        assert HSV_BINS[tuple(4 * c for c in colour)] in nearly | {plain.hsv_bin((blue, green, red))}
    one, other = np.zeros((2, PARTS, BINS)), np.zeros((PARTS, BINS))
    one[0, :, 3] = other[:, 3] = 1.0
    one[1, :, 7] = 1.0
    np.testing.assert_allclose(squares(one, other), [[0.0] * PARTS, [1.0] * PARTS])


@drawn(10, st.data())
def test_histograms(data: st.DataObject) -> None:
    image = np.random.default_rng(data.draw(st.integers(0, 99))).integers(0, 256, (40, 50, 3)).astype(np.uint8)
    edges = st.floats(-9.7, 45.3)
    boxes = np.array(data.draw(st.lists(st.tuples(edges, edges, edges, edges), min_size=1, max_size=3)))
    boxes = np.concatenate([np.minimum(boxes[:, :2], boxes[:, 2:]), np.maximum(boxes[:, :2], boxes[:, 2:]) + 3.1], 1)
    nearer = np.array([[10.2, 5.1, 30.4, 25.7]])[: data.draw(st.integers(0, 1))]
    colours, share = histograms(image, np.append(boxes, [[np.nan] * 4], 0), nearer)
    for k, box in enumerate(boxes):
        one, visible = plain.histogram(image, box, nearer, POINTS, PARTS, HSV_BINS)
        np.testing.assert_allclose(colours[k], one, atol=1e-12)
        np.testing.assert_allclose(share[k], visible, atol=1e-12)
    assert not colours[-1].any() and not share[-1].any()


def test_colours_prefer_the_target_and_ignore_hidden_parts() -> None:
    standing = people((0.0, 0.0), (1.2, -0.6))
    target = known(standing)
    colours = target.colours[0]
    assert colours is not None
    look = TargetLikelihood(VIEWS[0], painted(RIG.cameras[0], standing), colours, 1.7, np.zeros((0, 4)), FEW)
    likelihood, share = look.likelihood(np.array([[0.0, 0.0], [1.2, -0.6], [-0.5, 0.9]]))
    assert likelihood[0] > 100 * likelihood[1:].max()
    np.testing.assert_allclose(share[0], 1.0)
    covered = replace(look, nearer=VIEWS[0].boxes(np.zeros((1, 2)), 2.0) + np.array([-9, -9, 9, 9]))
    unseen, none = covered.likelihood(np.zeros((1, 2)))
    np.testing.assert_allclose(unseen, covered.hidden)
    assert none[0] == 0.0


@drawn(15, st.data(), st.sampled_from(([0.1, 0.3, 0.0, 0.2], [0.0] * 4)))
def test_messages_are_sums_over_the_potential(data: st.DataObject, likelihood: list[float]) -> None:
    ground, mapped = spots(data, 3), spots(data, 4)
    slope: Floats = np.array([[0.3, 0.1], [0.0, 0.2]]) * (1 + np.arange(4))[:, None, None]
    covariance: Floats = slope @ slope.transpose(0, 2, 1)
    outlier = Outlier(0.2, np.array([0.3, -0.1]), 1.5)
    potential = Potential.of(ground, mapped, covariance, outlier)
    pairs = list(zip(mapped, covariance, strict=True))
    psi = np.array([[plain.potential(g, m, c, 0.2, outlier.mean, 1.5) for m, c in pairs] for g in ground])
    weight, visible = np.array([0.5, 0.2, 0.3]), np.array(likelihood)
    message = psi @ visible + (1 - visible.sum()) * outlier.flat
    np.testing.assert_allclose(potential.to_ground(visible), message)
    np.testing.assert_allclose(potential.to_view(weight), weight @ psi)


@drawn(15, st.data())
def test_targets_exclude_each_other(data: st.DataObject) -> None:
    ground, weight = spots(data, 3), np.array([0.2, 0.5, 0.3])
    others = [Particles(spots(data, 3), np.zeros((3, 2)), weight) for _ in range(2)]
    plainly = [np.prod([plain.exclusion(g, o.place, weight, 0.3) for o in others]) for g in ground]
    np.testing.assert_allclose(exclusion(ground, others, 0.3), plainly, atol=1e-6)


def test_a_round_brings_the_ground_to_the_views_if_any() -> None:
    walking = Particles(np.tile([0.0, 0.0], (30, 1)), np.tile([0.8, 0.0], (30, 1)), np.full(30, 1 / 30))
    star = Star(walking, (None,) * 4, np.zeros(4))
    rounds = Rounds(star, [None] * 4, MOTION, FEW, np.random.default_rng(0))
    rounds.advance([])
    moved = rounds.settled()
    np.testing.assert_allclose(moved.ground.mean, [0.1, 0.0], atol=0.1)
    assert moved.views == (None,) * 4
    # The target has gone a step further than it should have; all views see it.
    target, standing = known(people((0.0, 0.0))), people((0.25, -0.15))
    seen = target_likelihoods([target], VIEWS, images_of(standing), MOTION, FEW)
    star = propagate([target.star], seen, MOTION, FEW, [np.random.default_rng(1)])[0]
    np.testing.assert_allclose(star.ground.mean, [0.25, -0.15], atol=0.08)
    assert (star.visibility > 0.9).all()
    for view, own in zip(VIEWS, star.views, strict=True):
        assert own is not None
        np.testing.assert_allclose(view.to_ground(own.mean[None])[0], [0.25, -0.15], atol=0.15)
        assert own.weight.sum() == pytest.approx(1.0)
    # The first view's image is blank: its particles go where the others see the target.
    target, standing = known(people((0.0, 0.0))), people((0.2, 0.2))
    images = images_of(standing)
    images[0] = np.full((*SIZE[::-1], 3), FLOOR, np.uint8)
    seen = target_likelihoods([target], VIEWS, images, MOTION, FEW)
    star = propagate([target.star], seen, MOTION, FEW, [np.random.default_rng(1)])[0]
    hidden = star.views[0]
    assert hidden is not None and star.visibility[0] < 0.2
    np.testing.assert_allclose(VIEWS[0].to_ground(hidden.mean[None])[0], [0.2, 0.2], atol=0.15)
    np.testing.assert_allclose(star.ground.mean, [0.2, 0.2], atol=0.1)


QUICK = replace(CONFIG, belief=FEW)
PASSING = ((-0.9, -0.3, 0.1, 0.0), (0.9, 0.3, -0.1, 0.0))


@compiled_only
def test_the_order_of_targets_does_not_matter() -> None:
    standing = people((0.0, 0.0), (0.5, 0.2))
    targets = [known(standing), known(standing[::-1])]
    asked = target_likelihoods(targets, VIEWS, images_of(standing), MOTION, FEW)
    there = propagate([t.star for t in targets], asked, MOTION, FEW, [np.random.default_rng(k) for k in (1, 2)])
    stars = [t.star for t in targets[::-1]]
    back = propagate(stars, asked[::-1], MOTION, FEW, [np.random.default_rng(k) for k in (2, 1)])
    for one, other in zip(there, back[::-1], strict=True):
        np.testing.assert_array_equal(one.ground.place, other.ground.place)


@compiled_only
def test_two_who_pass_keep_numbers_also_after_a_break() -> None:
    tracker = BeliefTracker(RIG, QUICK, 0)
    assert follow(tracker, 3, PASSING)
    stored = pickle.loads(pickle.dumps(tracker))
    standing = people((-0.6, -0.3), (0.6, 0.3))
    one, other = (t.add(frame_of(3, standing), observations_of(standing))[0] for t in (tracker, stored))
    np.testing.assert_array_equal(one.trajectory, other.trajectory)
    frames = 18 if COMPILED else 8
    rows = rows_of(follow(BeliefTracker(RIG, QUICK, 0), frames, PASSING))
    assert len(rows) == 2 * frames
    for who, (x, y, dx, _) in enumerate(PASSING, start=1):
        own = rows[rows["id"] == who]
        away = np.hypot(own["x"] - (x + dx * own["frame"]), own["y"] - y)
        assert away.max() < 0.25 and np.median(away) < 0.12
    # The pass finds a person in three frames and then no more: they are followed, and then ended with a reason.
    tracker = BeliefTracker(RIG, replace(CONFIG, belief=replace(FEW, patience=0.5)), 0)
    commits = follow(tracker, 9, ((-0.5, 0.2, 0.08, 0.0),), found_until=3)
    rows, events = rows_of(commits), np.concatenate([commit.events for commit in commits])
    assert rows["frame"].tolist() == list(range(6))
    assert np.hypot(rows["x"] - (-0.5 + 0.08 * rows["frame"]), rows["y"] - 0.2).max() < 0.25
    assert [(e["kind"], e["id"]) for e in events] == [(b"birth", 1), (b"death", 1)]
    assert events["reason"][1] == b"nobody was found there for 4 frames; its colours were seen"
    assert not tracker.targets


def test_whom_it_expects() -> None:
    tracker = BeliefTracker(RIG, QUICK, 0)
    assert tracker.predict(0) is None
    follow(tracker, 3, ((-0.5, 0.2, 0.1, 0.0),))
    expected = tracker.predict(3)
    assert expected is not None
    np.testing.assert_allclose(expected.ground, [[-0.2, 0.2]], atol=0.15)
    assert expected.existence[0] == 1.0


@compiled_only
def test_each_view_by_itself_is_worse_where_one_sees_nothing() -> None:
    """The ablation: a view whose picture is blank takes its fused place along; messages do not."""
    away = {}
    for way in ("messages", "condensation"):
        config = replace(FEW, method=way)
        tracker = BeliefTracker(RIG, replace(CONFIG, belief=config), 0)
        for frame in range(10 if COMPILED else 5):
            standing = people((-0.8 + 0.12 * frame, 0.2))
            observations = observations_of(standing)
            views: list[Observation] = list(observations.observations)
            if frame > 1:
                views[:2] = [np.full((*SIZE[::-1], 3), FLOOR, np.uint8)] * 2
            tracker.add(frame_of(frame, standing), FrameObservations(views, observations.evidence))
        away[way] = float(np.hypot(*(tracker.targets[0].star.ground.mean - standing[0, :2])))
    assert away["messages"] < 0.15 and away["condensation"] > away["messages"]
