"""Estimates of a run: noise of boxes, the population of bodies, and rims of silhouettes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import drawn, refused
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, detector_of, expecting, found, likelihoods, people, rig_of, room
from scipy.ndimage import maximum_filter

from stseg.arrays import Boxes, Floats, Singles, ViewEvidence
from stseg.bodies import box_fit
from stseg.bodies.box_fit import FEET_LIMIT, LOWER_EDGE, PRIOR_NOISE, TOLERANCE, WIDTH_OFFSET
from stseg.bodies.covered_feet import are_feet_covered
from stseg.bodies.views import ViewObservation
from stseg.config import BodyConfig, Config, DetectionConfig, ErrorRateConfig
from stseg.detection.detector import Detector
from stseg.engine.rig_body import with_body_of
from stseg.errors import ConfigError, RigError
from stseg.io.recording.recording import BodyPrior, CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.noise.box_bias_estimate import BoxBiasEstimate
from stseg.noise.box_noise_estimate import BoxNoiseEstimate
from stseg.noise.population_estimate import PopulationEstimate
from stseg.noise.rim_estimate import RimEstimate, without_rim
from stseg.noise.torn_masks import is_unexplained, mask_log_likelihood, with_rates
from stseg.records.people import People

RATE = 5.0
CONFIG = ErrorRateConfig(memory=1e6, prior_weight=2.0)
SHARP = replace(PRIOR_NOISE, spread=PRIOR_NOISE.spread / 4)


@drawn(100, st.lists(st.floats(0, 1), max_size=5))
def test_what_is_sharper_says_more(scores: list[float]) -> None:
    score = np.array(scores)
    tolerance, belief = PRIOR_NOISE.of(score, score > 2)
    sharper, more = replace(PRIOR_NOISE, spread=PRIOR_NOISE.spread / 2).of(score, score > 2)
    np.testing.assert_allclose(sharper[:, :FEET_LIMIT], tolerance[:, :FEET_LIMIT] / 2)
    np.testing.assert_allclose(more - belief, 4 * box_fit.EFFECTIVE_OBSERVATIONS * np.log(2))


def test_noise_begins_at_the_prior_by_score_and_forgets() -> None:
    sharpening = BoxNoiseEstimate(RATE, replace(CONFIG, memory=1.0))
    np.testing.assert_allclose(sharpening.noise.spread, PRIOR_NOISE.spread)
    taught(sharpening, 0.01, 1.0, 20)
    learned = sharpening.noise.spread[-1]
    assert (np.delete(learned, WIDTH_OFFSET) < np.delete(PRIOR_NOISE.spread[-1], WIDTH_OFFSET)).all()
    for _ in range(50):
        sharpening.offsets.forget()
    np.testing.assert_allclose(sharpening.noise.spread[-1], PRIOR_NOISE.spread[-1], rtol=1e-3)
    tolerance, belief = PRIOR_NOISE.of(np.array([1.0, 0.6, 0.2]), np.array([False, True, False]))
    np.testing.assert_allclose(tolerance[0, :FEET_LIMIT], TOLERANCE)
    np.testing.assert_allclose(belief, np.log([1.0, 0.6, 0.2]), atol=1e-12)


def taught(sharpening: BoxNoiseEstimate, spread: float, score: float, frames: int, hidden: float = 0.0) -> None:
    """Boxes of three people in four views, edges off by so much of the height; some end far above the feet."""
    rng, frame_pass = np.random.default_rng(3), detector_of(room(), "boxes")
    for _ in range(frames):
        seen = shaken_boxes(frame_pass, people((-0.8, 0.3), (0.7, -0.6), (0.6, 0.8)), spread, score, rng, hidden)
        sharpening.learn(frame_pass.explain(seen, None), frame_pass.views, frame_pass.observe(seen))


def shaken_boxes(
    detector: Detector, standing: Floats, spread: float, score: float, rng: np.random.Generator, hidden: float = 0.0
) -> list[Boxes]:
    found = []
    for view in detector.views:
        bodies = view.table.boxes_of(standing[:, :2], standing[:, 2])
        tall = bodies[:, 3] - bodies[:, 1] + box_fit.EDGE_GRAIN[:, None]
        middle, wide, head, foot = rng.normal(0, spread, (4, len(bodies))) * tall
        foot -= (rng.random(len(bodies)) < hidden) * rng.uniform(0.2, 0.7, len(bodies)) * tall[LOWER_EDGE]
        left, right = bodies[:, 0] + middle - wide / 2, bodies[:, 2] + middle + wide / 2
        top, bottom = bodies[:, 1] + head, bodies[:, 3] + foot
        found.append(Boxes(np.column_stack([left, top, right - left, bottom - top]), np.full(len(bodies), score)))
    return found


@pytest.mark.parametrize("spread", [0.015, 0.03, 0.04])
@pytest.mark.parametrize("hidden", [0.0, 0.25])
def test_the_spread_of_boxes_and_hidden_feet_are_found(spread: float, hidden: float) -> None:
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, spread, 1.0, 60, hidden)
    learned = sharpening.noise
    found = np.delete(learned.spread[-1], WIDTH_OFFSET) / spread
    assert ((found > 0.8) & (found < 1.25)).all()
    assert learned.hidden_feet[0] == pytest.approx(hidden, abs=0.05)
    np.testing.assert_allclose(learned.spread[:-2], PRIOR_NOISE.spread[:-2])


@pytest.mark.parametrize(("share", "rate"), [(0.0, 0.2), (0.4, 0.4), (0.6, 0.6)])
def test_the_share_of_missing_boxes_is_found(share: float, rate: float) -> None:
    rng, frame_pass, estimate = (
        np.random.default_rng(4),
        detector_of(room(), "boxes"),
        BoxNoiseEstimate(RATE, CONFIG),
    )
    for _ in range(150):
        seen = shaken_boxes(frame_pass, people((-0.8, 0.3), (0.7, -0.6), (0.6, 0.8)), 0.02, 1.0, rng)
        kept = [rng.random(len(boxes.score)) >= share for boxes in seen]
        views = [Boxes(boxes.pixel[some], boxes.score[some]) for boxes, some in zip(seen, kept, strict=True)]
        estimate.learn(frame_pass.explain(views, None), frame_pass.views, frame_pass.observe(views))
    assert estimate.miss_rate(0.2) == pytest.approx(rate, abs=0.05)


def test_feet_are_covered_by_a_box_that_ends_lower() -> None:
    """The first stands behind the second, not behind the third beside it, nor behind a box of the same person."""
    edges = np.array([[10.0, 10, 30, 60], [15, 20, 40, 80], [32, 20, 60, 90], [11, 10, 31, 61]])
    np.testing.assert_array_equal(are_feet_covered(edges), [True, False, False, True])
    many = np.tile(edges, (600, 1))
    np.testing.assert_array_equal(are_feet_covered(many), np.tile([True, False, False, True], 600))
    assert are_feet_covered(np.zeros((0, 4))).shape == (0,)


@pytest.mark.parametrize("views", [4, 2, 1])
def test_places_are_as_sure_as_they_are_right(views: int) -> None:
    """Squared errors, in the stated covariance: 2 by independent edges, of which each counts as half an observation."""
    squares, rng, frame_pass = [], np.random.default_rng(1), detector_of(room(), "boxes")
    for _ in range(100):
        x, y, tall = *rng.uniform(-0.8, 0.8, 2), rng.normal(1.7, 0.09)
        seen: list[ViewEvidence] = [*shaken_boxes(frame_pass, people((x, y, tall)), 0.04, 1.0, rng)]
        person = frame_pass.explain([*seen[:views], *[None] * (4 - views)], None).people
        if len(person) == 1:
            off = person.ground[0] - (x, y)
            squares.append(off @ np.linalg.solve(person.covariance[0], off))
    assert len(squares) > 60 and 0.7 < np.mean(squares) < 1.4


def test_boxes_of_a_view_that_is_turned_move_to_their_people() -> None:
    """The residual is still that of the boxes as they were delivered, and of people who are close to each other."""
    frame_pass, estimate, rng = detector_of(room(), "boxes"), BoxBiasEstimate(4, RATE, CONFIG), np.random.default_rng(0)
    sizes, found = [view.camera.size for view in frame_pass.views], []
    for _ in range(150):
        x, y = rng.uniform(-0.8, 0.8, 2)
        seen = shaken_boxes(frame_pass, people((x - 0.25, y), (x + 0.25, y)), 0.01, 1.0, rng)
        seen[1].pixel[:, 0] -= 0.02 * sizes[1][0]
        corrected = estimate.corrected(seen, sizes)
        explanation, observed = frame_pass.explain(corrected, None), frame_pass.observe(corrected, SHARP)
        estimate.learn(explanation, frame_pass.views, observed)
        found.append(explanation.residual)
    np.testing.assert_allclose(estimate.bias.shift, [[0.02 * (k == 1), 0, 0] for k in range(4)], atol=0.004)
    assert np.nanmedian(found[-30:], 0)[1] < -0.05


@pytest.mark.parametrize("bias", [-0.05, 0.0, 0.05, 0.1])
def test_boxes_that_end_beside_the_feet_are_corrected(bias: float) -> None:
    frame_pass, estimate = detector_of(room(), "boxes"), BoxBiasEstimate(4, RATE, CONFIG)
    standing, sizes = people((-0.5, 0.3, 1.7), (0.5, -0.4, 1.7)), [view.camera.size for view in frame_pass.views]
    bodies = [view.table.boxes_of(standing[:, :2], standing[:, 2]) for view in frame_pass.views]
    grain = box_fit.EDGE_GRAIN[LOWER_EDGE]
    delivered = []
    for body in bodies:
        high = body[:, 3] - body[:, 1] - bias * (body[:, 3] - body[:, 1] + grain)
        pixel = np.column_stack([body[:, :2], body[:, 2] - body[:, 0], high])
        delivered.append(Boxes(pixel, np.ones(len(body))))
    for _ in range(25):
        corrected = estimate.corrected(delivered, sizes)
        observed = frame_pass.observe(corrected, SHARP)
        estimate.learn(frame_pass.explain(corrected, None), frame_pass.views, observed)
    assert estimate.bias.lower_edge == pytest.approx(bias, abs=0.015) and np.abs(estimate.bias.shift).max() < 0.003
    explanation, weight = frame_pass.explain(corrected, None), estimate.equations.sums[0, 0]
    one = [np.full_like(owner, -1) if k else owner for k, owner in enumerate(explanation.box_assignment)]
    estimate.learn(replace(explanation, box_assignment=tuple(one)), frame_pass.views, frame_pass.observe(corrected))
    # One view says nothing of the bias without the place.
    assert estimate.equations.sums[0, 0] == pytest.approx(weight, rel=1e-3)
    ends = [boxes for boxes in estimate.corrected(delivered, sizes) if isinstance(boxes, Boxes)]
    feet = [boxes.pixel[:, 1] + boxes.pixel[:, 3] for boxes in ends]
    assert max(np.abs(foot - body[:, 3]).max() for foot, body in zip(feet, bodies, strict=True)) < 2.0


def test_knots_alone_learn_anew_in_each_session_not_the_width() -> None:
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, 0.1, 1.0, 30)
    learned = sharpening.noise.spread
    assert (learned[-1, :WIDTH_OFFSET] > 1.5 * PRIOR_NOISE.spread[-1, :WIDTH_OFFSET]).all()
    np.testing.assert_array_equal(learned[:, WIDTH_OFFSET], PRIOR_NOISE.spread[:, WIDTH_OFFSET])
    sharpening = BoxNoiseEstimate(RATE, CONFIG)
    taught(sharpening, 0.02, 0.7, 10)
    changed = ~np.isclose(sharpening.noise.spread, PRIOR_NOISE.spread).all(1)
    np.testing.assert_array_equal(changed, np.isin(box_fit.SCORE_KNOTS, (0.6, 0.8)))
    frame_pass = detector_of(room(), "boxes")
    seen = shaken_boxes(frame_pass, people((-0.8, 0.3), (0.7, -0.6)), 0.02, 1.0, np.random.default_rng(0))
    estimates = frame_pass.new_estimates()
    frame_pass.explain_next(estimates, 0, seen, None)
    assert (estimates.box_noise.offsets.sums[:, 0] > 0).any()
    np.testing.assert_allclose(frame_pass.new_estimates().box_noise.noise.spread, PRIOR_NOISE.spread)


POPULATION_RATE = 8.0
LASTING = ErrorRateConfig(memory=1e9)


def sized(heights: list[float], widths: list[float], unresolved: float = 0.0, evidence: float = 6.0) -> People:
    """People whose sizes a frame left open by a share of the default population's variance."""
    n, body = len(heights), BodyConfig()
    seen = found(people(*[(0.1 * k, 0.0) for k in range(n)]), evidence=evidence)
    tall, wide = (np.full(n, unresolved * spread**2) for spread in (body.height_spread, body.width_spread))
    return replace(seen, sizes=replace(seen.sizes, height=np.array(heights), height_variance=tall,
                                       width=np.array(widths), width_variance=wide))  # fmt: skip


def learned_body(frames: list[People], config: ErrorRateConfig = LASTING) -> BodyConfig:
    estimate = PopulationEstimate(BodyConfig(), POPULATION_RATE, config)
    for frame in frames:
        estimate.learn(frame)
    return estimate.body


def test_means_and_spreads_by_the_formulas() -> None:
    heights, body = np.array([1.0, 1.2, 1.8]), BodyConfig()
    after = learned_body([sized(heights.tolist(), (0.25 * heights).tolist())] * 400)
    weight, before = 400 / POPULATION_RATE, body.prior_weight
    mean = (before * body.height_mean + weight * heights.sum()) / (before + 3 * weight)
    spread = before * (body.height_spread**2 + (body.height_mean - mean) ** 2) + weight * ((heights - mean) ** 2).sum()
    assert after.height_mean == pytest.approx(mean)
    assert after.height_spread == pytest.approx(np.sqrt(spread / (before + 3 * weight)))
    share = body.width_mean / body.height_mean
    relative = (before * share + 3 * weight * 0.25) / (before + 3 * weight)
    assert after.width_mean == pytest.approx(relative * mean) and after.width_spread >= body.width_spread


def test_a_spread_has_bounds_and_nothing_teaches_nothing() -> None:
    after = learned_body([sized([0.6, 0.6], [0.1, 1.2])] * 400)
    assert after.width_spread == pytest.approx(0.45 * after.width_mean)
    for frame in (sized([], []), sized([1.0], [0.2], unresolved=1.0), sized([1.0], [0.2], evidence=1.0)):
        after = learned_body([frame] * 20)
        found = [after.height_mean, after.height_spread, after.width_mean, after.width_spread]
        np.testing.assert_allclose(found, [1.7, 0.12, 0.42, 0.04])
    alike = sized([1.7, 1.7], [0.42, 0.42])
    assert learned_body([alike] * 500).height_spread == BodyConfig().height_spread
    small = [sized([1.0], [0.25])] * 200
    config = ErrorRateConfig(memory=5.0)
    assert learned_body(small, config).height_mean < 1.6
    assert learned_body([*small, *[sized([], [])] * 400], config).height_mean == pytest.approx(1.7, abs=1e-3)


@pytest.mark.slow
def test_a_run_among_children_learns_their_height() -> None:
    rig = room()
    standing = {"children": [(-0.9, 0.4, 1.2), (0.6, -0.5, 1.15)], "adults": [(-0.9, 0.4, 1.72), (0.6, -0.5, 1.68)]}
    means = {}
    for who, places in standing.items():
        asked = Detector(rig, ["pixels"] * 4, FEW_HEIGHTS, replace(BODY, heights=(1.1, 1.4, 1.7)))
        estimates = asked.new_estimates()
        for _ in range(40):
            explained = asked.explain_next(estimates, 0, likelihoods(rig.cameras, people(*places)), None)
        assert len(explained.people) == 2
        means[who] = estimates.population.body.height_mean
    assert means["children"] < 1.62 and means["adults"] == pytest.approx(1.7, abs=0.04)


def recording(body: BodyPrior) -> Recording:
    cameras = corner_cameras()
    sources = tuple(CameraSource(Source("masks", Path(f"{camera.name}.avi"))) for camera in cameras)
    return Recording(Path("rig.toml"), rig_of(cameras), sources, body)


def test_stout_bodies_are_tolerated_and_kept_in_the_rig() -> None:
    for body in (BodyPrior(), BodyPrior(height_mean=0.6), BodyPrior(0.6, 0.05, 0.5, 0.1)):
        text = format_rig(recording(body), Path("rig.toml"))
        assert ("[body]" in text) == (body != BodyPrior()) and parse_rig(text, Path("rig.toml")).body == body
    score = np.array([0.3, 0.9])
    low = BoxNoiseEstimate(RATE, CONFIG, BodyConfig(height_mean=0.6, width_mean=0.42).stoutness)
    stout, slim = (one.noise.of(score, score > 2) for one in (low, BoxNoiseEstimate(RATE, CONFIG)))
    for of_stout, person, ratio in zip(stout, slim, (1.7 / 0.6, 1), strict=True):
        np.testing.assert_allclose(of_stout, ratio * person)
    assert BodyConfig().stoutness == BodyConfig().breadth == BodyConfig(width_mean=0.3).stoutness == 1.0


@pytest.mark.parametrize("line", ["height_mean = -1", "heights = 1", "width_mean = 0.3\nwidth_spread = 0.2"])
def test_the_rigs_bodies_are_checked(line: str) -> None:
    key = line.splitlines()[-1].split()[0]
    text = format_rig(recording(BodyPrior()), Path("rig.toml")) + f"\n[body]\n{line}\n"
    refused(RigError, key, parse_rig, text, Path("rig.toml"))


def test_the_configuration_precedes_the_rig_as_a_prior() -> None:
    dogs = recording(BodyPrior(height_mean=0.6, width_mean=0.5))
    assert with_body_of(recording(BodyPrior()), Config()) == Config()
    body = with_body_of(dogs, Config()).body
    assert (body.height_mean, body.width_mean) == (0.6, 0.5)
    assert body.height_spread == pytest.approx(0.6 * 0.12 / 1.7)
    assert with_body_of(dogs, Config()).detection.minimum_distance == pytest.approx(0.3 * 0.5 / 0.42)
    told = Config(detection=DetectionConfig(minimum_distance=0.2))
    assert with_body_of(dogs, told).detection.minimum_distance == 0.2
    assert min(body.heights) < 0.6 < max(body.heights) < 0.8
    configured = with_body_of(dogs, Config(body=BodyConfig(height_mean=0.9, heights=(0.8, 1.0)))).body
    assert (configured.height_mean, configured.heights, configured.width_mean) == (0.9, (0.8, 1.0), 0.5)
    refused(ConfigError, "height_mean", with_body_of, dogs, Config(body=BodyConfig(height_spread=0.4)))


APART = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75))


def shown(raster: Singles) -> ViewObservation:
    none = np.zeros(0)
    return ViewObservation(np.zeros((0, 4)), none, np.zeros((0, 5)), none, raster)


def seen(standing: Floats, eaten: int) -> list[ViewEvidence]:
    """Likelihoods of people, of whose edges some pixels are missing."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * eaten + 1,) * 2)
    return [np.asarray(cv2.erode(view, disc), np.float32) for view in likelihoods(room().cameras, standing)]


def learned_rims(
    standing: Floats, views: Sequence[ViewEvidence], frames: int = 10, evidence: float = 20.0
) -> RimEstimate:
    asked = detector_of(room(), "pixels")
    rims, here = asked.new_estimates().rims, replace(found(standing, evidence=evidence), height=standing[:, 2])
    observations = asked.observe(views)
    for _ in range(frames):
        rims.learn(here, asked.views, observations)
    return rims


def test_eaten_silhouettes_lose_their_rim_and_whole_ones_none() -> None:
    rims, whole = learned_rims(APART, seen(APART, 0)), shown(np.full((3, 3), -1.0, np.float32))
    assert rims.shares.sums[:, 0].min() > 1.0
    np.testing.assert_array_equal(rims.withdrawn, 0.0)
    assert without_rim(whole, 0.0) is whole
    weak, strong = (learned_rims(APART, seen(APART, eaten)).withdrawn for eaten in (1, 3))
    assert (strong > 0.8).all() and (weak < strong).all()
    raster = np.random.default_rng(5).normal(-1.0, 1.0, (17, 23)).astype(np.float32)
    beside = (maximum_filter(raster, 3) > 0) & (raster < 0)
    assert 20 < beside.sum() < (raster < 0).sum()
    expected = np.where(beside, raster * np.float32(0.25), raster)
    np.testing.assert_array_equal(without_rim(shown(raster), 0.75).raster, expected)


def test_shares_leave_usual_misses_and_torn_masks_own_rates() -> None:
    rims = learned_rims(APART, seen(APART, 2), frames=200)
    weight, missing, rim = rims.shares.sums.T
    left = (missing - rims.withdrawn * rim) / weight
    np.testing.assert_allclose(left[rims.withdrawn < 1], FEW_HEIGHTS.pixel_miss_rate, atol=0.01)
    assert (rims.withdrawn > 0).any()
    whole = seen(APART, 0)
    bands = np.arange(room().cameras[0].size[1])[:, None] // 10 % 2
    torn = [np.asarray(np.where(bands, 0, view), np.float32) for view in map(np.asarray, whole)]
    usual = FEW_HEIGHTS.pixel_miss_rate, FEW_HEIGHTS.pixel_clutter_rate
    np.testing.assert_array_equal(learned_rims(APART, whole).torn, [usual] * len(whole))
    rates = learned_rims(APART, torn, frames=100).torn
    assert (rates[:, 0] > usual[0]).all() and (rates[:, 1] < usual[1]).all()


@drawn(100, st.floats(0.01, 0.45), st.floats(0.01, 0.45))
def test_log_odds_by_other_rates_are_those_of_the_likelihood(miss: float, clutter: float) -> None:
    likelihood = np.linspace(0, 1, 21)[None]

    def log_odds(m: float, b: float) -> Floats:
        body, empty = (1 - m) * likelihood + m * (1 - likelihood), b * likelihood + (1 - b) * (1 - likelihood)
        return np.asarray(np.log(body / empty))

    found = with_rates(shown(log_odds(0.2, 0.07).astype(np.float32)), (0.2, 0.07), (miss, clutter)).raster
    np.testing.assert_allclose(found, log_odds(miss, clutter), atol=1e-4)


def test_masks_are_most_likely_by_the_people_in_them() -> None:
    inside = [view > 0.5 for view in map(np.asarray, seen(APART, 0))]
    views = [shown(np.where(view, 2.6, -1.5).astype(np.float32)) for view in inside]
    exact, aside = (
        mask_log_likelihood([np.roll(view, shift, axis=1).astype(np.int16) - 1 for view in inside], views)
        for shift in (0, 3)
    )
    assert aside < exact == 0.0
    order = [np.cumsum(view).reshape(view.shape) % 10 for view in inside]
    shares = [
        np.where(view, (k < tenths) - 1, -1).astype(np.int16)
        for tenths in (7, 8)
        for view, k in zip(inside, order, strict=True)
    ]
    assert is_unexplained(shares[: len(views)], views) and not is_unexplained(shares[len(views) :], views)


def test_limbs_make_up_and_empty_views_take_the_mean() -> None:
    alone = people((0.0, 0.0, 1.7))
    views = likelihoods(room().cameras, alone)
    shifted = [np.roll(view, 2, axis=1) for view in views]
    eaten = [np.minimum(view, beside) for view, beside in zip(views, shifted, strict=True)]
    lost, beside = (learned_rims(alone, evidence).shares.sums[:, 1] for evidence in (eaten, shifted))
    assert (lost > 1.5 * beside).all()
    rims = learned_rims(APART, seen(APART, 3))
    every = rims.withdrawn
    rims.shares.sums[2] = 0.0
    assert rims.withdrawn[2] == pytest.approx(np.delete(every, 2).mean(), abs=0.1) and rims.withdrawn[2] > 0.5


@pytest.mark.parametrize(
    ("standing", "evidence"), [(people((0.0, 0.0), (0.1, 0.1)), 20.0), (APART, 1.0), (people(), 20.0)]
)
def test_who_overlaps_or_is_doubted_teaches_nothing(standing: Floats, evidence: float) -> None:
    np.testing.assert_array_equal(learned_rims(standing, seen(standing, 3), evidence=evidence).shares.sums, 0.0)


def test_learned_rims_raise_evidence_in_eaten_silhouettes() -> None:
    standing = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75), (0.7, 0.9, 1.65))
    asked, evidence = detector_of(room(), "pixels"), []
    first = asked.new_estimates()
    for known in (first, replace(first, rims=learned_rims(APART, seen(APART, 1)))):
        explained = asked.explain_next(known, 1, seen(standing, 1), expecting(*standing))  # no key frame
        assert len(explained.people) == len(standing)
        evidence.append(explained.people.evidence.sum())
    assert evidence[1] > evidence[0] + 2.0
