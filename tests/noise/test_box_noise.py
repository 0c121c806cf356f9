"""How sharp boxes are: what is known of it, and what frames teach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, people, rig_of

from stseg.arrays import Boxes, Floats
from stseg.bodies.box_fit import (
    EDGE_GRAIN,
    EFFECTIVE_OBSERVATIONS,
    LOWER_EDGE_BELOW,
    PRIOR_NOISE,
    SCORE_KNOTS,
    TOLERANCE,
    WIDTH_OFFSET,
    BoxNoise,
    half_square,
)
from stseg.config import ErrorRateConfig
from stseg.detection.detector import Detector
from stseg.noise.box_noise_estimate import BoxNoiseEstimate

RATE = 5.0
CONFIG = ErrorRateConfig(memory=1e6, prior_weight=2.0)


def test_tolerance_of_boxes_follows_their_score() -> None:
    tolerance, belief = PRIOR_NOISE.of(np.array([1.0, 0.6, 0.2]))
    np.testing.assert_allclose(tolerance[0], TOLERANCE)
    np.testing.assert_allclose(belief, np.log([1.0, 0.6, 0.2]), atol=1e-12)


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), max_size=5))
def test_what_is_sharper_says_more(scores: list[float]) -> None:
    score = np.array(scores)
    tolerance, belief = PRIOR_NOISE.of(score)
    sharper, more = BoxNoise(PRIOR_NOISE.spread / 2).of(score)
    np.testing.assert_allclose(sharper, tolerance / 2)
    np.testing.assert_allclose(more - belief, 4 * EFFECTIVE_OBSERVATIONS * np.log(2))


def test_noise_begins_at_the_prior_and_forgets() -> None:
    sharpening = BoxNoiseEstimate(RATE, replace(CONFIG, memory=1.0))
    np.testing.assert_allclose(sharpening.noise.spread, PRIOR_NOISE.spread)
    taught(sharpening, 0.01, 1.0, 20)
    learned = sharpening.noise.spread[-1]
    assert (np.delete(learned, WIDTH_OFFSET) < np.delete(PRIOR_NOISE.spread[-1], WIDTH_OFFSET)).all()
    for _ in range(50):
        sharpening.offsets.forget()
    np.testing.assert_allclose(sharpening.noise.spread[-1], PRIOR_NOISE.spread[-1], rtol=1e-3)


def taught(sharpening: BoxNoiseEstimate, spread: float, score: float, frames: int) -> None:
    """Boxes of three people in four views, edges off by so much of the height; every fourth ends far above the feet."""
    rng, rig = np.random.default_rng(3), rig_of(corner_cameras())
    frame_pass = Detector(rig, ["boxes"] * 4, FEW_HEIGHTS, BODY)
    standing = people((-0.8, 0.3, 1.7), (0.7, -0.6, 1.7), (0.6, 0.8, 1.7))
    for _ in range(frames):
        seen = [shaken(view.table.boxes_of(*standing_of(standing)), spread, score, rng) for view in frame_pass.views]
        explained = frame_pass.explain(seen, None)
        sharpening.learn(explained, frame_pass.views, frame_pass.observe(seen))


def standing_of(standing: Floats) -> tuple[Floats, Floats]:
    return standing[:, :2], standing[:, 2]


def shaken(bodies: Floats, spread: float, score: float, rng: np.random.Generator) -> Boxes:
    tall = bodies[:, 3] - bodies[:, 1] + EDGE_GRAIN[: LOWER_EDGE_BELOW + 1, None]
    middle, wide, head, foot = rng.normal(0, spread, (4, len(bodies))) * tall
    left, right = bodies[:, 0] + middle - wide / 2, bodies[:, 2] + middle + wide / 2
    top, bottom = bodies[:, 1] + head, bodies[:, 3] + foot
    return Boxes(np.column_stack([left, top, right - left, bottom - top]), np.full(len(bodies), score))


@pytest.mark.parametrize("spread", [0.015, 0.04])
def test_the_spread_of_boxes_is_found(spread: float) -> None:
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, spread, 1.0, 60)
    learned, loosest = sharpening.noise.spread, np.delete(PRIOR_NOISE.spread[-1], WIDTH_OFFSET)
    # An edge counts as half a look, so places are less sure than such independent edges make them, and spreads wider.
    found, true = np.delete(learned[-1], WIDTH_OFFSET), np.minimum(spread, loosest)
    assert ((found > 0.8 * true) & (found < 2.2 * true)).all()
    np.testing.assert_allclose(learned[:-2], PRIOR_NOISE.spread[:-2])


def test_the_width_is_not_learned_and_nothing_gets_looser() -> None:
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, 0.1, 1.0, 30)
    learned = sharpening.noise.spread
    assert (learned <= PRIOR_NOISE.spread).all()
    np.testing.assert_array_equal(learned[:, WIDTH_OFFSET], PRIOR_NOISE.spread[:, WIDTH_OFFSET])


def test_only_knots_beside_a_score_learn_of_it() -> None:
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, 0.02, 0.7, 10)
    changed = ~np.isclose(sharpening.noise.spread, PRIOR_NOISE.spread).all(1)
    np.testing.assert_array_equal(changed, np.isin(SCORE_KNOTS, (0.6, 0.8)))


def test_a_boxs_distance_is_measured_by_its_own_tolerance() -> None:
    body, off = np.array([40.0, 10.0, 60.0, 60.0]), np.array([42.0, 12.0, 62.0, 63.0])
    tight, loose = (half_square(body, off, factor * TOLERANCE, 128.0, 96.0) for factor in (1, 2))
    assert tight == pytest.approx(4 * loose)


def test_each_session_begins_with_the_first_guess() -> None:
    rig = rig_of(corner_cameras())
    frame_pass = Detector(rig, ["boxes"] * 4, FEW_HEIGHTS, BODY)
    standing = people((-0.8, 0.3, 1.7), (0.7, -0.6, 1.7))
    rng = np.random.default_rng(0)
    seen = [shaken(view.table.boxes_of(*standing_of(standing)), 0.02, 1.0, rng) for view in frame_pass.views]
    learned = frame_pass.new_estimates()
    frame_pass.explain_next(learned, 0, seen, None)
    assert (learned.box_noise.offsets.sums[:, 0] > 0).any()
    np.testing.assert_allclose(frame_pass.new_estimates().box_noise.noise.spread, PRIOR_NOISE.spread)
