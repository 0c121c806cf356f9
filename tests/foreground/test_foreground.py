"""Foreground: what the maps mean, what the background model learns and what it must not, boxes and instances."""

from copy import deepcopy
from pathlib import Path

import cv2
import numpy as np
import pytest
import reference_foreground as reference
from checks import compiled_only, data_path, drawn, refused
from hypothesis import example
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from reference_foreground import FLOOR, SHIRT, near_modes, noisy, random_modes

from stseg.arrays import Boxes, Bytes, Floats
from stseg.config import ChromaticConfig, MixtureConfig
from stseg.errors import InputError, SourceError
from stseg.foreground import Mixture, box_likelihood, instance_boxes, mask_likelihood
from stseg.foreground.background.gaussian_kernels import (
    Adaptation,
    adapt_mixture,
    fill_mixture_log_odds,
    put_strongest_first,
)
from stseg.foreground.background.posterior import Priors, pool_log_odds
from stseg.foreground.background.temporal_mode import commonest_colours
from stseg.foreground.channel_gain import channel_gains, fill_gains

SIZE = (12, 12)


def room(colour: tuple[int, int, int] = FLOOR, size: tuple[int, int] = SIZE) -> Bytes:
    """An empty scene of one colour, uint8 (v, u, 3)."""
    return np.full((size[1], size[0], 3), colour, np.uint8)


def with_person(image: Bytes, colour: tuple[float, float, float] = SHIRT) -> Bytes:
    """Somebody on the pixels 5..7 x 5..7."""
    occupied = image.copy()
    occupied[5:8, 5:8] = np.round(colour)
    return occupied


def taught(config: MixtureConfig | None = None, frame_rate: float = 10.0) -> Mixture:
    model = Mixture(SIZE, frame_rate, config)
    rng = np.random.default_rng(1)
    for _ in range(20):
        model.learn(noisy(room(), rng))
    return model


def answer(model: Mixture, colour: tuple[float, float, float]) -> float:
    """L in the middle of somebody of this colour, from a model that stays as it is."""
    return float(deepcopy(model).likelihood(with_person(room(), colour))[6, 6])


def test_likelihood_rises_with_distance_but_not_in_shadows() -> None:
    model = taught()
    answers = [answer(model, (110 + d, 140, 60)) for d in range(0, 100, 4)]
    assert (np.diff(answers) >= 0).all()
    assert any(0.1 < a < 0.9 for a in answers)  # soft, not a mask
    shadows = [answer(model, (110 * r, 140 * r, 60 * r)) for r in np.arange(1.0, 0.2, -0.05)]
    assert 0.02 < shadows[6] < 0.2
    assert answer(model, (110 + 33, 140 + 42, 60 - 18)) > 0.95  # as far from the background, but lit
    assert max(shadows[:9]) < 0.5 < 0.95 < shadows[-1]


def test_the_shadows_density_integrates_to_one() -> None:
    side = np.arange(-30.0, 160.0, 4.0)
    colours = np.stack(np.meshgrid(side, side, side, indexing="ij"), -1).reshape(-1, 3)
    mu, var, darkest = np.array([110.0, 90.0, 60.0]), 100.0, 0.5
    ratio = np.clip(colours @ mu / (mu @ mu), darkest, 1)
    likely = np.abs(colours - ratio[:, None] * mu).max(1) < 50
    total = sum(reference.mode_densities(c, mu, var, darkest)[1] for c in colours[likely])
    assert total * 4.0**3 == pytest.approx(1, abs=0.01)


def test_noisy_pixels_are_outvoted_and_gains_hold_in_crowds() -> None:
    image = room()
    image[6, 6] = SHIRT
    assert taught().likelihood(image)[6, 6] < 0.1
    assert taught(MixtureConfig(smoothing_radius=0)).likelihood(image)[6, 6] > 0.9
    rng = np.random.default_rng(6)
    background = rng.integers(50, 150, (40, 40, 3)).astype(np.float32)
    image = np.round(background * 1.3).astype(np.uint8)
    image[:24] = rng.integers(0, 256, (24, 40, 3))
    np.testing.assert_allclose(channel_gains(image, background), 1.3, rtol=0.01)
    np.testing.assert_array_equal(channel_gains(np.zeros_like(image), background), 1)


def test_learning_gives_every_empty_frame_the_same_weight() -> None:
    rng = np.random.default_rng(2)
    frames = [noisy(room(), rng) for _ in range(15)]
    model = Mixture(SIZE, 10.0)
    for frame in frames:
        model.learn(frame)
    mean, variance, weight = reference.modes_of(model.modes)
    np.testing.assert_allclose(mean[:, :, 0], np.mean(frames, axis=0), atol=0.5)
    np.testing.assert_allclose(weight[:, :, 0], 1, atol=1e-5)
    assert (variance[:, :, 0] >= MixtureConfig().minimum_sd ** 2).all()


def test_shadows_and_people_take_no_mode() -> None:
    model = taught()
    before = model.modes.copy()
    for _ in range(20):
        model.likelihood(with_person(room(), (77, 98, 42)))
    np.testing.assert_array_equal(model.modes[..., 6, 6], before[..., 6, 6])
    model = taught(MixtureConfig(modes=1))
    for _ in range(30):
        model.likelihood(with_person(room()))
    assert model.likelihood(room()).max() < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_gains_are_the_centroids_of_the_peaks_of_histograms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, 4, (3, 21)) + np.eye(3, 21, (0, 18, 7)[seed % 3], dtype=np.int64) * 9
    held = np.apply_along_axis(np.convolve, 1, counts, np.ones(5), "same")
    peak, bins = held.argmax(1), np.arange(21)
    near = (abs(bins - peak[:, None]) <= 2) * counts
    gains = np.empty(3)
    fill_gains(counts, 1.0, gains)
    np.testing.assert_allclose(gains, np.exp((near * (bins - 10)).sum(1) / near.sum(1) * 0.01))
    fill_gains(counts, 1e6, gains)
    np.testing.assert_array_equal(gains, 1)


GAUSSIAN_MODELS = st.sampled_from([MixtureConfig(), ChromaticConfig()])


@drawn(60, seed=st.integers(0, 10**6), modes=st.integers(1, 4), config=GAUSSIAN_MODELS)
def test_log_odds_are_their_formula(seed: int, modes: int, config: reference.GaussianConfig) -> None:
    rng = np.random.default_rng(seed)
    state = random_modes(rng, modes, config)
    image, gain = near_modes(rng, state[0]), rng.uniform(0.8, 1.25, 3)
    expected = reference.log_odds(image, gain, *state, config)
    log_odds, planes = np.empty(image.shape[:2], np.float32), reference.planes_of(*state)
    fill_mixture_log_odds(image, gain.astype(np.float32), planes, config.background_weight, Priors.of(config), log_odds)
    np.testing.assert_allclose(log_odds, expected, atol=2e-3)


@drawn(60, seed=st.integers(0, 10**6), modes=st.integers(1, 4), config=GAUSSIAN_MODELS)
def test_modes_learn_by_their_rules(seed: int, modes: int, config: reference.GaussianConfig) -> None:
    rng = np.random.default_rng(seed)
    state = random_modes(rng, modes, config)
    image, gain = near_modes(rng, state[0]), rng.uniform(0.8, 1.25, 3).astype(np.float32)
    likelihood = rng.uniform(0, 1, image.shape[:2]).astype(np.float32)
    expected = reference.updated(image, gain.astype(float), likelihood, 0.05, 0.001, state, config)
    least, tolerance = config.minimum_sd, 1e-4
    if isinstance(config, ChromaticConfig):
        least, tolerance = config.chromatic_sd, 1e-3
    numbers = config.background_weight, config.match_distance, config.initial_sd, least, config.minimum_sd
    adaptation = Adaptation(*(np.float32(number) for number in (0.05, 0.001, *numbers)))
    found = reference.planes_of(*state)
    adapt_mixture(image, gain, likelihood, adaptation, 0, 1, found)
    for one, other in zip(reference.modes_of(found), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance)


def test_rows_between_turns_stay_and_strong_modes_come_first() -> None:
    rng = np.random.default_rng(4)
    state = reference.planes_of(*random_modes(rng, 2, MixtureConfig()))
    found, adaptation = state.copy(), Adaptation(*(np.float32(number) for number in (0.05, 0.001, 0.1, 5, 12, 4, 4)))
    image, likelihood = rng.integers(0, 256, (3, 4, 3)).astype(np.uint8), np.zeros((3, 4), np.float32)
    adapt_mixture(image, np.ones(3, np.float32), likelihood, adaptation, 1, 4, found)
    np.testing.assert_array_equal(found[:, :, [0, 2]], state[:, :, [0, 2]])
    state = reference.planes_of(*random_modes(np.random.default_rng(3), 4, MixtureConfig()))
    found = state.copy()
    put_strongest_first(0, 1, found)
    assert (found[:1, -1] >= found[:, -1]).all()
    np.testing.assert_array_equal(np.sort(found, axis=0), np.sort(state, axis=0))


@drawn(20, seed=st.integers(0, 10**6), radius=st.integers(0, 3))
def test_pooling_is_a_mean_over_the_pixels_that_exist(seed: int, radius: int) -> None:
    log_odds = np.random.default_rng(seed).uniform(-5, 5, (5, 7)).astype(np.float32)
    likelihood = np.empty_like(log_odds)
    pool_log_odds(log_odds, radius, likelihood)
    np.testing.assert_allclose(likelihood, reference.pooled(log_odds.astype(float), radius), rtol=1e-5)


@drawn(20, seed=st.integers(0, 10**6), count=st.integers(1, 9))
def test_the_commonest_colour_is_the_one_with_most_companions(seed: int, count: int) -> None:
    frames = np.random.default_rng(seed).integers(0, 60, (count, 2, 3, 3)).astype(np.uint8)
    mean, variance = commonest_colours(frames, 25.5)
    expected_mean, expected_variance = reference.commonest(frames, 25.5)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-5)
    np.testing.assert_allclose(variance, expected_variance, atol=1e-3)


def test_masks_are_likelihoods_and_boxes_hold_soft_bodies() -> None:
    likelihood = mask_likelihood(np.array([[0, 51, 255]], np.uint8))
    assert likelihood.dtype == np.float32
    np.testing.assert_allclose(likelihood, [[0, 0.2, 1]])
    refused(SourceError, "expected", mask_likelihood, np.zeros((2, 2, 3), np.uint8))
    refused(InputError, "score", box_likelihood, boxes_of((0, 0, 1, 1), score=[1.5]), (4, 4))
    refused(InputError, "finite", box_likelihood, boxes_of((0, float("nan"), 1, 1)), (4, 4))
    refused(InputError, "step", box_likelihood, boxes_of((0, 0, 1, 1)), (4, 4), step=0)
    likelihood = box_likelihood(boxes_of((9.5, 4.5, 21, 51), score=[0.8]), (40, 60))
    assert likelihood.dtype == np.float32 and likelihood.max() == pytest.approx(0.8)
    assert likelihood[35, 20] == pytest.approx(0.8)  # the trunk
    assert likelihood[8, 20] > 0.4  # the head
    assert likelihood[6, 11] == 0  # beside the head
    assert 0 < likelihood[35, 11] < 0.4  # the soft border
    inside = np.zeros(likelihood.shape, bool)
    inside[5:56, 10:31] = True
    assert not likelihood[~inside].any()


def boxes_of(*rows: tuple[float, float, float, float], score: list[float] | None = None) -> Boxes:
    return Boxes(np.array(rows, float).reshape(-1, 4), np.array([1.0] * len(rows) if score is None else score))


@drawn(30, seed=st.integers(0, 10**6), count=st.integers(0, 3), step=st.integers(1, 4))
def test_the_box_map_is_its_definition(seed: int, count: int, step: int) -> None:
    rng = np.random.default_rng(seed)
    pixel = np.column_stack([rng.uniform(-10, 20, (count, 2)), rng.uniform(-1, 25, (count, 2))])
    boxes = Boxes(pixel, rng.uniform(0, 1, count))
    found = box_likelihood(boxes, (17, 19), step)
    np.testing.assert_allclose(found, reference.body_map(boxes, (17, 19), step), atol=1e-5)


@drawn(30, arrays(np.uint16, (6, 5), elements=st.sampled_from((0, 0, 0, 3, 7, 65535))))
@example(np.zeros((6, 5), np.uint16))
def test_instance_boxes_are_tight(instances: NDArray[np.uint16]) -> None:
    boxes = instance_boxes(instances)
    expected: list[Floats] = []
    for value in np.unique(instances[instances > 0]):
        v, u = np.nonzero(instances == value)
        expected.append(np.array([u.min() - 0.5, v.min() - 0.5, np.ptp(u) + 1.0, np.ptp(v) + 1.0]))
    np.testing.assert_array_equal(boxes.pixel, np.array(expected).reshape(-1, 4))
    np.testing.assert_array_equal(boxes.score, 1)
    refused(SourceError, "expected", instance_boxes, instances.astype(np.uint8))


@compiled_only
def test_people_in_a_real_room_are_found() -> None:
    model = Mixture((129, 98), 5.0)
    for image in _frames(data_path("uu4/cam1/background.avi"), 8):
        model.learn(image)
    overlap = union = 0
    silhouettes = _frames(data_path("uu4/cam1/foreground_cropped.avi"), 4)
    for image, silhouette in zip(_frames(data_path("uu4_colour/cam1.avi"), 4), silhouettes, strict=True):
        found, true = model.likelihood(image) > 0.5, silhouette[:, :, 0] > 127
        overlap, union = overlap + int((found & true).sum()), union + int((found | true).sum())
    assert overlap / union > 0.85


def _frames(path: Path, count: int) -> list[Bytes]:
    """The first frames of a video, one pixel in five of each row and column: quick in plain Python too."""
    video = cv2.VideoCapture(str(path))
    frames = [np.ascontiguousarray(video.read()[1][::5, ::5], np.uint8) for _ in range(count)]
    video.release()
    return frames
