"""The evidence level: rates are found, first guesses hold at first, no view teaches itself, state goes on."""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import reference_error_rates as reference
from checks import compiled_only, drawn
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, detector_of, evidence_of, likelihoods, no_boxes, people, rig_of

from stseg.arrays import Flags, Floats, Ints, ViewEvidence
from stseg.bodies.pillars import inside_bodies
from stseg.config import ErrorRateConfig, OccupancyConfig
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN
from stseg.occupancy import shown_cells
from stseg.occupancy.error_rate_estimate import (
    CLUTTER,
    MISS,
    NEAR_CLUTTER,
    ErrorRateEstimate,
    cells_per_person,
    fill_counts,
)
from stseg.occupancy.fusion import ErrorRates, FrameTerms, Sums, log_odds_terms
from stseg.occupancy.volume import Occupancy
from stseg.records.people import Explanation

FIRST = ErrorRates(0.2, 0.07, 0.07)
CONFIG = ErrorRateConfig(memory=30.0, prior_weight=2.0)
PRIOR = float(np.log(0.02 / 0.98))
RIG = rig_of(corner_cameras(), cell=0.5, planes=3)
STANDING = people((-0.75, 0.25), (0.75, -0.75))


def one_level(views: int = 1) -> ErrorRateEstimate:
    """Ten frames a second."""
    return ErrorRateEstimate([FIRST] * views, 10.0, CONFIG)


def teach(
    view: int, shown: reference.Shown, near: Ints, inside: Flags, trusted: Flags, rates: list[ErrorRates], worth: float
) -> tuple[Floats, Floats]:
    """What the kernel counts of one of several views of equal weight."""
    views, every = len(rates), np.tile(near.ravel(), len(inside)).astype(np.int32)
    terms = FrameTerms(
        np.array([own.ravel() for own in shown.levels]), np.array([own.ravel() for own in shown.share]), every,
        np.array([log_odds_terms(rate) for rate in rates]), np.ones(views, np.float32),
        np.ones((views, len(trusted)), np.float32),
    )  # fmt: skip
    sums = Sums.of(terms)
    errors, seen = np.full((2, views, 3), np.nan)
    counted, by_all = (np.arange(inside.size), np.ones(inside.size)), np.tile(trusted, (views, 1))
    fill_counts(terms, sums, inside.ravel(), *counted, by_all, np.array(rates), worth, PRIOR, errors, seen)
    return errors[view], seen[view]


@drawn(15, st.integers(0, 2**32 - 1))
def test_counts_by_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (2, 3, 4)
    levels = tuple(rng.integers(UNSEEN, TOP_LEVEL + 1, shape).astype(np.int16) for _ in range(3))
    levels[0][rng.random(shape) < 0.3] = UNSEEN
    share = tuple(rng.choice([0.0, 0.4, 1.0], shape).astype(np.float32) for _ in range(3))
    shown = reference.Shown(levels, share)
    near, inside = rng.integers(-1, 3, shape[1:]), rng.random(shape) < 0.4
    trusted, rates = np.array([True, False, True]), [ErrorRates(*rng.uniform(0.05, 0.5, 3)) for _ in range(3)]
    # Of equal weights the mean over a_i times the count is their sum, as in the definition.
    expected = reference.counts(shown, 1, near, inside, trusted, rates, 0.6, PRIOR)
    np.testing.assert_allclose(teach(1, shown, near, inside, trusted, rates, 0.6), expected, rtol=1e-3, atol=1e-6)


@compiled_only
def test_rates_of_some_cells_are_those_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a large ground one block stands for those that follow it."""
    seen, found = frame("pixels", 0), []
    fine = rig_of(corner_cameras(), cell=0.1, planes=3)
    for most in (1 << 17, 3000):
        monkeypatch.setattr(shown_cells, "_MOST_COUNTED", most)
        fusion = Occupancy(fine, ["pixels"] * 4, OccupancyConfig(), FEW_HEIGHTS, BODY, CONFIG)
        rates = fusion.new_error_rates()
        fusion.fuse_and_learn(rates, *seen)
        found.append(rates.counts.sums[:, :, CLUTTER])
    np.testing.assert_allclose(found[1], found[0], rtol=0.3)
    assert (found[1] != found[0]).any()


@compiled_only
def test_rates_are_found() -> None:
    """A stream of frames of known rates; three views, of which the first errs most."""
    true = [ErrorRates(0.35, 0.15, 0.45), ErrorRates(0.1, 0.02, 0.3), ErrorRates(0.1, 0.02, 0.3)]
    rng, level, shape = np.random.default_rng(0), one_level(3), (2, 12, 12)
    near = np.full(shape[1:], -1)
    near[:6, :6] = 0
    inside = np.zeros(shape, bool)
    inside[:, 1:4, 1:4] = True
    units = np.array([18.0, 288 - 72, 54.0])
    whole = (np.ones(shape, np.float32),) * 3
    for _ in range(300):
        chance = [np.where(inside, 1 - r.miss, np.where(near >= 0, r.near_clutter, r.clutter)) for r in true]
        maps = (np.where(rng.random(shape) < c, TOP_LEVEL, 0).astype(np.int16) for c in chance)
        shown = reference.Shown(tuple(maps), whole)
        counted = [teach(i, shown, near, inside, np.array([True]), level.rates, 1.0) for i in range(3)]
        level.learn(np.stack(counted, 1)[::-1] / units, np.array([1.0, 0.25]))
    first = CONFIG.prior_weight / (CONFIG.prior_weight + level.counts.sums[0])
    expected = first * FIRST + (1 - first) * np.array(true)
    np.testing.assert_allclose(np.array(level.rates), expected, atol=0.02)
    assert abs(level.filled_share - 0.25) < 0.03


def test_soft_likelihoods_sharpen_rates_of_pillars() -> None:
    """A map that only ever says 0.8 of bodies misses none of them: the rate falls frame by frame, not to 0.2."""
    level, shape = one_level(), (1, 1, 1)
    shown = reference.Shown((np.full(shape, round(0.8 * TOP_LEVEL), np.int16),), (np.ones(shape, np.float32),))
    near, inside, rates = np.zeros((1, 1), np.int64), np.ones(shape, bool), []
    for _ in range(200):
        errors, seen = teach(0, shown, near, inside, np.array([True]), level.rates, 1.0)
        level.learn(np.stack([seen, errors])[:, None], np.zeros(2))
        rates.append(level.rates[0].miss)
    assert (np.diff(rates) < 0).all() and rates[-1] < 0.1
    grid = Grid((-1.0, 1.0), (-1.0, 1.0), 0.05, 1.8, 10)
    ground, height = np.array([[0.2, 0.1]]), np.array([1.7])
    inside = inside_bodies(grid, nearest_person(grid.ground, ground, 0.5), ground, height)
    body, reached = cells_per_person(grid, 1.7, 0.4)
    assert inside.sum() == pytest.approx(body, rel=0.1)
    assert reached == pytest.approx(10 * np.pi * 0.4**2 / 0.05**2)
    assert not inside[-1].any()  # the uppermost plane is above the head
    widest = inside[grid.heights.searchsorted(0.8 * 1.7) - 1].sum()
    assert widest == inside.sum((1, 2)).max()


def test_the_first_guess_comes_back_in_seconds() -> None:
    level = one_level(2)
    assert level.rates == [FIRST, FIRST] and level.filled_share == 0.5
    trials = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    level.learn(np.stack([trials, trials * 0.5]), np.zeros(2))
    assert level.rates[1] == FIRST  # blind
    # One frame is a tenth of a second against the guess's two.
    assert level.rates[0].miss == pytest.approx((2.0 * 0.2 + 0.1 * 0.5) / 2.1)
    for _ in range(100):
        level.learn(np.stack([trials, trials * 0.5]), np.zeros(2))
    learned = level.rates[0].miss
    for _ in range(3000):
        level.learn(np.zeros((2, 2, 3)), np.zeros(2))
    assert learned > 0.4
    assert level.rates[0].miss == pytest.approx(0.2, abs=1e-3)
    slow, fast = ErrorRateEstimate([FIRST], 5.0, CONFIG), ErrorRateEstimate([FIRST], 20.0, CONFIG)
    once = np.ones((1, 3))
    for level, frames in ((slow, 100), (fast, 400)):
        for _ in range(frames):
            level.learn(np.stack([once, 0.3 * once]), np.zeros(2))
    np.testing.assert_allclose(slow.rates, fast.rates, atol=2e-3)


@cache
def frame(kind: str, lots: int) -> tuple[list[ViewEvidence], Explanation]:
    """Two people in noise, and who they are."""
    rng = np.random.default_rng(lots)
    seen = evidence_of(kind, RIG.cameras, STANDING)
    if kind == "pixels":
        clean = likelihoods(RIG.cameras, STANDING)
        seen = [np.where(rng.random(m.shape) < 0.1, 1 - m, m).astype(np.float32) for m in clean]
    return seen, detector_of(RIG, kind).explain(seen, None)


def occupancy(kind: str) -> Occupancy:
    return Occupancy(RIG, [kind] * 4, OccupancyConfig(), FEW_HEIGHTS, BODY, CONFIG)


@compiled_only
@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_a_frame_is_fused_by_those_before_it(kind: str) -> None:
    fusion = occupancy(kind)
    running, fresh = fusion.new_error_rates(), fusion.new_error_rates()
    frames = [frame(kind, k) for k in range(2)]
    np.testing.assert_array_equal(fusion.fuse_and_learn(running, *frames[0]).dense(), fusion.fuse(*frames[0]).dense())
    for one in frames[1:]:
        fusion.fuse_and_learn(running, *one)
    assert running.rates != fresh.rates and fresh.rates == [fresh.rates[0]] * 4
    assert all(r.near_clutter > r.clutter for r in running.rates)


@compiled_only
def test_going_on_from_a_state_is_going_on() -> None:
    """Wherever a recording is divided, its parts in order say what the whole says."""
    frames = [frame("pixels", k) for k in range(3)]
    fusion = occupancy("pixels")
    whole = fusion.new_error_rates()
    volumes = [fusion.fuse_and_learn(whole, *one).dense() for one in frames]
    for division in (1, 2):
        part = fusion.new_error_rates()
        for one in frames[:division]:
            fusion.fuse_and_learn(part, *one)
        rest = deepcopy(part)
        for one, volume in zip(frames[division:], volumes[division:], strict=True):
            np.testing.assert_array_equal(fusion.fuse_and_learn(rest, *one).dense(), volume)


@compiled_only
def test_blind_single_and_hiding_views_learn_nothing() -> None:
    fusion = occupancy("pixels")
    running = fusion.new_error_rates()
    seen, explanation = frame("pixels", 0)
    fusion.fuse_and_learn(running, [None, *seen[1:]], explanation)
    assert not running.counts.sums[0][0].any() and running.counts.sums[0][1:].all()
    fusion.fuse_and_learn(running, [None] * 4, explanation)
    assert running.rates[0] == ErrorRates(*running.first[0])
    fusion, (seen, explanation) = occupancy("pixels"), frame("pixels", 0)
    everybody = explanation.people
    parts = np.zeros_like(everybody.view_evidence)
    parts[0] = everybody.evidence
    running = fusion.new_error_rates()
    fusion.fuse_and_learn(running, seen, replace(explanation, people=replace(everybody, view_evidence=parts)))
    assert not running.counts.sums[0][0, [MISS, NEAR_CLUTTER]].any()
    assert running.counts.sums[0][1:, [MISS, NEAR_CLUTTER]].all()
    fusion = occupancy("boxes")
    seen, explanation = frame("boxes", 0)
    hidden = np.array([[0.5] * len(explanation.people), *np.ones((3, len(explanation.people)))])
    unseen = replace(
        explanation,
        people=replace(explanation.people, found_share=hidden),
        box_assignment=(np.zeros(0, np.int64), *explanation.box_assignment[1:]),
    )
    running = fusion.new_error_rates()
    fusion.fuse_and_learn(running, [no_boxes(), *seen[1:]], unseen)
    assert not running.counts.sums[0][0, MISS].any() and running.counts.sums[0][1:, MISS].all()
