"""Heights and widths: the E step by its definition, and what it finds of people in named scenes; lasting errors."""

from dataclasses import replace

import numpy as np
import pytest
from checks import cases, drawn, numbers
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, detector_of, evidence_of, expecting, likelihoods, people, room
from scipy.signal import lfilter
from scipy.special import expit

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.bodies.outlines import outlines
from stseg.bodies.pillars import SILHOUETTE, WIDTH
from stseg.bodies.views import BACKGROUND_WEIGHT, BODY_WEIGHT, PixelView
from stseg.detection.search.body_sizes import body_sizes
from stseg.detection.search.refine import EvidenceAssignment, RefinedPlaces
from stseg.noise.lasting_error import LastingError, constant_errors
from stseg.records.candidates import Candidates
from stseg.records.sizes import Sizes

VALUES = st.tuples(numbers(1.4, 2.0), numbers(0.01, 0.2), numbers(1.4, 2.0), numbers(0.03, 0.3))


def sizes_of(mean: float, spread: float) -> Sizes:
    one = np.ones(1)
    return Sizes(mean * one, spread**2 * one, mean / 4 * one, spread**2 * one)


def pixel_view(view: int = 0) -> PixelView:
    rig = room()
    return PixelView(rig.cameras[view], rig.grid, np.zeros((1, 2)), FEW_HEIGHTS, BODY)


def at(ground: Floats) -> RefinedPlaces:
    """People whose places say nothing of their heights."""
    n = len(ground)
    mean, variance = np.full(n, BODY.height_mean), np.full(n, BODY.height_spread**2)
    return RefinedPlaces(ground, np.zeros((n, 2, 2)), mean, variance)


def open_to_one(*views: Flags) -> EvidenceAssignment:
    """Of a single person, the pixels that are open to them in each view."""
    owners = [np.where(pixels, -1, 1).astype(np.int16) for pixels in views]
    return EvidenceAssignment(np.full((len(views), 1), -1), owners, np.zeros(1, np.int64))


@drawn(100, VALUES)
def test_the_priors_variance_can_be_taken_out_again(values: tuple[float, float, float, float]) -> None:
    measured, prior = sizes_of(*values[:2]), sizes_of(*values[2:])
    again = measured.with_prior(prior).as_measurements(prior)
    np.testing.assert_allclose(again.height_variance, measured.height_variance, rtol=1e-4)
    np.testing.assert_allclose(again.width_variance, measured.width_variance, rtol=1e-4)


def test_what_says_nothing_and_who_is_hidden_keep_the_prior() -> None:
    prior = sizes_of(1.8, 0.1)
    other = sizes_of(1.6, 0.05)
    after = prior.as_measurements(prior).with_prior(other)
    np.testing.assert_allclose([after.height, after.width], [other.height, other.width], atol=1e-5)
    np.testing.assert_allclose(after.height_variance, other.height_variance, rtol=1e-4)
    view = pixel_view()
    sight = view.observe(likelihoods([view.camera], people((0.3, -0.2, 1.9)))[0])
    nobodys = open_to_one(np.zeros(view.shape, bool))
    place, width, anybody = at(np.array([[0.3, -0.2]])), np.array([0.42]), Sizes.of_population(1, BODY)
    found = body_sizes(place, width, [view], [sight], nobodys, BODY)
    np.testing.assert_allclose([found.height, found.width], [anybody.height, anybody.width])
    blind = body_sizes(place, width, [view], [None], nobodys, BODY)
    np.testing.assert_allclose(blind.height_variance, anybody.height_variance, rtol=0.03)  # of the lattice, cut off


def by_definition(view: PixelView, raster: Singles, open_pixels: Flags, fits: Candidates) -> Floats:
    """The labels' log-likelihood of each pillar over the union of all of them, pixel by pixel, nats."""
    first, spans, area = view.outlines(fits.ground, fits.height, fits.width)
    inside = np.zeros((len(fits), *view.shape), bool)
    for i in range(len(fits)):
        for k, (start, stop) in enumerate(spans[i]):
            if stop > start:
                inside[i, first[i] + k, start:stop] = True
    union, own, score = inside.any(0), expit(raster.astype(float)), np.zeros(len(fits))
    for v, u in np.argwhere(union & open_pixels):
        within = BODY_WEIGHT * own[v, u] + BACKGROUND_WEIGHT * (1 - own[v, u])
        score += np.where(inside[:, v, u], within, -BODY_WEIGHT * own[v, u]) / area.mean()
    return view.config.effective_observations * score


@pytest.mark.parametrize("hidden", [0.0, 0.5])
def test_the_e_step_by_definition(hidden: float) -> None:
    view, rng = pixel_view(), np.random.default_rng(4)
    sight = replace(view.observe(None), raster=rng.normal(0, 2, view.shape).astype(np.float32))
    open_pixels = rng.random(view.shape) >= hidden
    place, width = np.array([[0.3, -0.2]]), np.array([0.45])
    found = body_sizes(at(place), width, [view], [sight], open_to_one(open_pixels), BODY)
    everywhere, one = np.tile(place, (25, 1)), np.ones(25)
    heights, widths = np.linspace(0.75, 2.19, 25), np.linspace(0.26, 0.86, 25)
    for lattice, off, fits, mean, variance in (
        (heights, (heights - BODY.height_mean) / BODY.height_spread, Candidates(everywhere, heights, 0.45 * one),
         found.height, found.height_variance),
        (widths, (widths - BODY.width_of(found.height)) / BODY.width_spread,
         Candidates(everywhere, found.height * one, widths), found.width, found.width_variance),
    ):  # fmt: skip
        tail = np.where(abs(off) < 2, off**2 / 2, 2 + 4 * np.log(np.maximum(abs(off), 2) / 2))
        score = by_definition(view, sight.raster, open_pixels, fits) - tail
        weight = np.exp(score - score.max())
        weight /= weight.sum()
        assert mean[0] == pytest.approx(weight @ lattice, abs=1e-6)
        assert variance[0] == pytest.approx(weight @ (lattice - weight @ lattice) ** 2, abs=1e-6)


def test_wider_people_are_found_wider_up_to_the_head() -> None:
    """Silhouettes of a body of the profile's width, and of one a fifth slimmer."""
    views, found, place = [pixel_view(k) for k in range(4)], [], np.zeros((1, 2))
    own = open_to_one(*(np.ones(view.shape, bool) for view in views))
    for wide in (0.8, 1.0):
        observations = []
        for view in views:
            image = np.zeros(view.camera.size[::-1], np.float32)
            first, spans, _ = outlines(view.table, place, np.array([1.75]), 1, image.shape[:2], np.array([wide]))
            for k, (start, stop) in enumerate(spans[0]):
                image[first[0] + k, start:stop] = 1.0
            observations.append(view.observe(image))
        found.append(float(body_sizes(at(place), np.array([0.42]), views, observations, own, BODY).width[0]))
    assert 0.8 * WIDTH - 0.03 < found[0] < found[1] - 0.04 and found[1] == pytest.approx(WIDTH, abs=0.04)
    # The highest pixel of a silhouette is that of the crown, also where the camera looks down.
    camera = corner_cameras()[0]
    shown = likelihoods([camera], people((0.0, 0.0, 1.8)))[0]
    crown, _ = camera.project(np.zeros((1, 2)), np.array([1.8]))
    assert crown[0, 1] - float(np.flatnonzero(shown.max(1) > 0.5)[0]) < 1.0
    assert SILHOUETTE[-1, 1] < 0.05


def tall_and_short(kind: str) -> tuple[Floats, Sizes]:
    standing = people((-0.9, 0.4, 1.58), (0.6, -0.5, 1.86), (0.9, 0.9, 1.7))
    frame_pass = detector_of(room(), kind)
    found = frame_pass.explain(evidence_of(kind, room().cameras, standing), None).people
    order = [int(np.hypot(*(found.ground - place[:2]).T).argmin()) for place in standing]
    assert sorted(order) == [0, 1, 2]
    return standing, found.sizes.at(order)


@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_heights_are_found(kind: str) -> None:
    standing, found = tall_and_short(kind)
    # Boxes of thirty pixels are read to two, which leaves open more than the search's few heights reach.
    np.testing.assert_allclose(found.height, standing[:, 2], atol=0.05 if kind == "pixels" else 0.1)
    assert (np.diff(found.height[[0, 2, 1]]) > 0.04).all()


def test_who_is_known_keeps_their_height() -> None:
    """A walker's own height is the prior of the next frame's; the frame's own measurement stays free of it."""
    rig, standing = room(), people((0.2, 0.1, 1.7))
    frame_pass = detector_of(rig, "pixels")
    expected = expecting((0.2, 0.1, 1.82))
    expected = replace(expected, sizes=replace(expected.sizes, height_variance=np.full(1, 0.01**2)))
    seen = likelihoods(rig.cameras, standing)
    stranger, known = frame_pass.explain(seen, None).people, frame_pass.explain(seen, expected).people
    assert known.track_index.tolist() == [0] and known.height[0] > stranger.height[0] + 0.05
    assert known.sizes.height[0] == pytest.approx(stranger.sizes.height[0], abs=0.03)


@drawn(20, numbers(1.45, 1.95))
def test_taller_people_are_found_taller(height: float) -> None:
    view = pixel_view()
    place, width = at(np.zeros((1, 2))), np.array([WIDTH])
    found = [
        body_sizes(place, width, [view], [view.observe(seen)], open_to_one(np.ones(view.shape, bool)), BODY).height[0]
        for tall in (height, height + 0.1)
        for seen in likelihoods([view.camera], people((0.0, 0.0, tall)))
    ]
    assert found[1] > found[0]


RATE = 8.0
PRIOR = LastingError(np.array([0.0]), np.array([0.05**2]), np.array([0.5]))


def recording(
    white: float, lasting: float, seconds: float, people: int = 400, frames: int = 160
) -> tuple[Floats, Ints]:
    """Values of people (person, frame), and their frames: people differ by 0.1."""
    rng, kept = np.random.default_rng(4), np.exp(-1 / (seconds * RATE))
    steps = np.sqrt(1 - kept**2) * rng.normal(size=(people, frames + 400))
    alike = lfilter([1.0], [1.0, -kept], steps)[:, 400:]
    values = lasting * alike + white * rng.normal(size=alike.shape) + rng.normal(1.7, 0.1, (people, 1))
    return values, np.tile(np.arange(frames), people)


def found(values: Floats, frame: Ints) -> LastingError:
    tracklets = np.split(np.arange(values.size), len(values))
    return constant_errors(values.reshape(1, -1), frame, tracklets, PRIOR, RATE)


def mean_variance(errors: LastingError, frames: Ints) -> float:
    """Variance of the mean of rows in frames (n,), of the first quantity."""
    alike = np.exp(-np.abs(frames[:, None] - frames) / RATE / errors.seconds[0]).mean()
    return float(errors.white[0] / len(frames) + errors.lasting[0] * alike)


@cases()
def test_differences_of_halves_are_as_large_as_claimed(white: float, lasting: float, seconds: float) -> None:
    """Between means of 5 s of one person, 5 s apart: their variance is claimed, and that of two people is not."""
    values, frame = recording(white, lasting, seconds)
    errors = found(values, frame)
    assert errors.variance[0] == pytest.approx(white**2 + lasting**2, rel=0.25)
    early, late, both = np.arange(40), np.arange(80, 120), np.r_[0:40, 80:120]
    # The mean of both spans is half the sum of theirs, so the variance of a difference follows from three means.
    apart, joint = (mean_variance(errors, span) for span in (early, both))
    claimed = 4 * (apart - joint)
    difference = values[:, early].mean(1) - values[:, late].mean(1)
    assert (difference**2).mean() / claimed == pytest.approx(1.0, abs=0.2)
    of_two = values[1:, early].mean(1) - values[:-1, late].mean(1)
    assert (of_two**2).mean() / claimed > 3


def test_short_recordings_sitters_and_long_tracklets_say_little() -> None:
    values, frame = recording(0.02, 0.0, 1.0, people=1, frames=5)
    errors = found(values, frame)
    assert errors.variance[0] > 0.1 * PRIOR.variance[0] and np.isfinite(errors.row_variance(RATE)).all()
    values, frame = recording(0.02, 0.04, 1.0, people=60)
    before = found(values, frame)
    values[:2, 80:] -= 0.4
    assert found(values, frame).row_variance(RATE)[0] < 1.5 * before.row_variance(RATE)[0]
    # Most tracklets are short; in the only long one somebody rises from a chair.
    values, frame = recording(0.02, 0.03, 0.6, people=151)
    values[0, 80:] += 0.5
    short = np.split(np.arange(160, values.size), 150)
    tracklets = [np.arange(160), *(rows[:16] for rows in short)]
    errors = constant_errors(values.reshape(1, -1), frame, tracklets, PRIOR, RATE)
    assert errors.variance[0] < 2 * (0.02**2 + 0.03**2)
    errors = LastingError(np.array([0.02**2]), np.array([0.05**2]), np.array([1.5]))
    frames = np.arange(4000)
    np.testing.assert_allclose(errors.row_variance(RATE) / len(frames), mean_variance(errors, frames), rtol=0.02)
    assert errors.row_variance(RATE)[0] > 10 * errors.variance[0]
