"""Background models: what all of them promise, and what sets the chromatic mixture and the codebook apart."""

from copy import deepcopy
from dataclasses import astuple, replace
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
import reference_foreground as reference
from checks import compiled_only, drawn, refused
from hypothesis import strategies as st
from numpy.typing import NDArray
from reference_foreground import FLOOR, SHIRT, near_modes, noisy

from stseg.arrays import Bytes
from stseg.config import ChromaticConfig, CodebookConfig, ForegroundConfig, MixtureConfig
from stseg.errors import ConfigError, SourceError
from stseg.foreground import MODELS as MODELS_BY_NAME
from stseg.foreground import Chromatic, Codebook, Mixture, make_background
from stseg.foreground.background import codebook_kernels
from stseg.foreground.background.codebook import forget_rare_words
from stseg.foreground.background.codebook_kernels import Codewords
from stseg.foreground.background.model import Background
from stseg.foreground.background.posterior import Priors

SIZE = (7, 6)
MIDDLE = (3, 3)  # (v, u) of somebody who covers the pixels 2..4 x 2..4
RATE = 4.0  # frames per second

MODELS: dict[type[Background], type[Any]] = {
    Mixture: MixtureConfig,
    Chromatic: ChromaticConfig,
    Codebook: CodebookConfig,
}
every_model = pytest.mark.parametrize("kind", MODELS, ids=lambda kind: kind.__name__)


def room(colour: tuple[float, float, float] = FLOOR) -> Bytes:
    """An empty scene of one colour, uint8 (v, u, 3)."""
    return np.full((SIZE[1], SIZE[0], 3), np.round(colour), np.uint8)


def with_person(image: Bytes, colour: tuple[float, float, float] = SHIRT) -> Bytes:
    occupied = image.copy()
    occupied[2:5, 2:5] = np.round(colour)
    return occupied


def taught(kind: type[Background], **constants: float) -> Background:
    model = new(kind, **constants)
    rng = np.random.default_rng(1)
    for _ in range(20):
        model.learn(noisy(room(), rng))
    return model


def new(kind: type[Background], **constants: float) -> Background:
    return kind(SIZE, RATE, MODELS[kind](**constants))


def in_shadow(share: float) -> tuple[float, float, float]:
    return FLOOR[0] * share, FLOOR[1] * share, FLOOR[2] * share


@every_model
def test_likelihoods_are_posteriors_of_what_a_model_can_take(kind: type[Background]) -> None:
    model: Background = taught(kind, foreground_prior=0.2)
    assert model.prior == 0.2
    likelihood = model.likelihood(with_person(room()))
    assert likelihood.dtype == np.float32 and likelihood[0, 0] < 0.01
    assert likelihood[MIDDLE] > 0.98 and ((likelihood > 0) & (likelihood < 1)).all()
    refused(SourceError, "learned nothing", new(kind).likelihood, room())
    refused(SourceError, "no frames", new(kind).learn_from, [])
    for image in (room()[1:], room()[:, :, 0], room().astype(np.float32)):
        refused(SourceError, "image", taught(kind).likelihood, image)  # type: ignore[arg-type]
    refused(ConfigError, "frame_rate", kind, SIZE, 0.0)


@compiled_only
@every_model
def test_people_do_not_fade_and_light_that_changes_is_nobody(kind: type[Background]) -> None:
    model, rng = taught(kind), np.random.default_rng(4)
    for _ in range(int(60 * RATE)):
        likelihood = model.likelihood(noisy(with_person(room()), rng))
    assert likelihood[MIDDLE] > 0.98
    assert model.likelihood(room())[MIDDLE] < 0.02  # and leaves no hole behind
    scene = np.random.default_rng(5).integers(40, 160, (24, 24, 3)).astype(np.uint8)
    model = kind((24, 24), RATE)  # type: ignore[call-arg]  # as models have it
    for _ in range(5):
        model.learn(scene)
    for gain in (1.0, 0.6, 1.5, *np.linspace(1.5, 0.7, 20)):
        empty = np.clip(np.round(scene * gain * np.array([1.0, 0.95, 1.05])), 0, 255).astype(np.uint8)
        assert model.likelihood(empty).max() < 0.05
        assert model.likelihood(with_person(empty, (5, 5, 5)))[MIDDLE] > 0.95


@every_model
def test_shadows_and_people_teach_nothing(kind: type[Background]) -> None:
    model = taught(kind)
    for _ in range(60):
        likelihood = model.likelihood(with_person(room(), in_shadow(0.7)))
    assert 0.02 < likelihood[MIDDLE] < 0.2
    assert model.likelihood(with_person(room(), in_shadow(0.3)))[MIDDLE] > 0.95  # deeper than any shadow
    assert model.likelihood(room())[MIDDLE] < 0.02
    model, rng = taught(kind), np.random.default_rng(8)
    for _ in range(40):
        b, g, r = rng.integers(0, 256, 3)
        model.likelihood(with_person(room(), (b, g, r)))
    assert model.likelihood(room()).max() < 0.02


@compiled_only
@every_model
def test_a_part_of_the_scene_may_change_slowly(kind: type[Background]) -> None:
    changed = (FLOOR[0] + 50, FLOOR[1], FLOOR[2] + 30)
    assert taught(kind).likelihood(with_person(room(), changed))[MIDDLE] > 0.9  # at once it is somebody
    model, rng = taught(kind, memory=10.0), np.random.default_rng(5)
    for done in np.linspace(0, 1, int(120 * RATE)):
        colour = tuple(a + done * (b - a) for a, b in zip(FLOOR, changed, strict=True))
        likelihood = model.likelihood(noisy(with_person(room(), (colour[0], colour[1], colour[2])), rng))
        assert likelihood[MIDDLE] < 0.3
    assert likelihood[MIDDLE] < 0.05


@every_model
def test_flicker_is_background_and_a_chair_becomes_it(kind: type[Background]) -> None:
    model = new(kind)
    for k in range(20):
        model.learn(room() if k % 2 else room((200, 200, 200)))
    assert model.likelihood(room()).max() < 0.05 and model.likelihood(room((200, 200, 200))).max() < 0.05
    model, rng = taught(kind, absorption_time=20.0, smoothing_radius=0), np.random.default_rng(6)
    chair = with_person(room())
    answers = [float(model.likelihood(noisy(chair, rng))[MIDDLE]) for _ in range(int(24 * RATE))]
    assert min(answers[: int(19 * RATE)]) > 0.9 and max(answers[int(22 * RATE) :]) < 0.1
    assert model.likelihood(room())[MIDDLE] < 0.1  # its leaving is no ghost


@every_model
def test_the_start_among_people_finds_what_is_behind_them(kind: type[Background]) -> None:
    rng, frames = np.random.default_rng(3), []
    for k in range(20):  # 12 of 20 frames are covered, by people of many colours
        b, g, r = rng.integers(0, 256, 3)
        frames.append(noisy(room() if k % 5 < 2 else room((b, g, r)), rng))
    model = new(kind)
    model.learn_from(frames)
    likelihood = model.likelihood(with_person(room()))
    assert likelihood[0, 0] < 0.05 and likelihood[MIDDLE] > 0.95


@every_model
def test_drifting_light_does_not_spoil_the_start(kind: type[Background]) -> None:
    rng, frames = np.random.default_rng(4), []
    scene = rng.integers(60, 150, (24, 36, 3)).astype(float)
    for light in 1 + 0.25 * np.sin(np.arange(20)):
        image = scene.copy()
        column = rng.integers(0, 28)
        image[3:21, column : column + 8] = rng.integers(0, 256, 3)
        frames.append(noisy(np.round(image * light).clip(0, 255).astype(np.uint8), rng))
    model = kind((36, 24), RATE, MODELS[kind]())
    model.learn_from(frames)
    image = np.round(scene).astype(np.uint8)
    image[3:21, 12:20] = SHIRT
    shows_person = model.likelihood(image) > 0.5
    assert shows_person[4:20, 13:19].mean() > 0.95
    shows_person[1:23, 10:22] = False
    assert shows_person.mean() < 0.01


@every_model
@pytest.mark.parametrize(("colour", "least", "most"), [((120.0, 120.0, 120.0), 0.2, 0.5), (FLOOR, 0.0, 0.12)])
def test_dark_clothes_show_where_a_camera_knows_greys(
    kind: type[Background], colour: tuple[float, float, float], least: float, most: float
) -> None:
    learned, started = new(kind), new(kind)
    for _ in range(20):
        learned.learn(room(colour))
    started.learn_from([room(colour)] * 20)
    for model in (learned, started):
        darker = with_person(room(colour), (0.75 * colour[0], 0.75 * colour[1], 0.75 * colour[2]))
        likelihood = model.likelihood(darker)
        assert least <= likelihood[MIDDLE] <= most and likelihood[0, 0] < 0.02


@every_model
@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_scenes_are_scenes_too(kind: type[Background], level: int) -> None:
    scenes = [room((level, level, level)) for _ in range(20)]
    learned, started = new(kind), new(kind)
    for scene in scenes:
        learned.learn(scene)
    started.learn_from(scenes)
    for model in (learned, started):
        for _ in range(8):
            assert model.likelihood(scenes[0]).max() < 0.02
        assert model.likelihood(with_person(scenes[0]))[MIDDLE] > 0.95


@every_model
def test_a_copy_goes_on_bit_for_bit_and_by_itself(kind: type[Background]) -> None:
    rng = np.random.default_rng(7)
    frames = [noisy(with_person(room()) if k % 3 else room(), rng, 4.0) for k in range(24)]
    whole, first = taught(kind, absorption_time=3.0), taught(kind, absorption_time=3.0)
    expected = [whole.likelihood(frame) for frame in frames]
    for frame in frames[:9]:
        first.likelihood(frame)
    second = deepcopy(first)
    for frame in frames[::-1]:
        first.likelihood(frame)
    for frame, one in zip(frames[9:], expected[9:], strict=True):
        np.testing.assert_array_equal(second.likelihood(frame), one)


def test_the_configuration_names_the_model() -> None:
    named = get_args(get_type_hints(ForegroundConfig)["model"])
    assert set(named) == {*MODELS_BY_NAME}
    config = ForegroundConfig(codebook=CodebookConfig(channel_sd=7.0), mixture=MixtureConfig(memory=9.0))
    for name in named:
        model: Any = make_background(SIZE, RATE, replace(config, model=name))
        assert type(model).__name__.lower() == name and model.config == getattr(config, name)
    assert isinstance(make_background(SIZE, RATE, config), Background)


@drawn(100, seed=st.integers(0, 10**6))
def test_the_chromatic_distance_is_mahalanobis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, mu, sigma = rng.uniform(1, 255, 3), rng.uniform(1, 255, 3), 3.0
    plane = mu / mu.sum()
    spread = (np.eye(3) - np.outer(plane, np.ones(3))) / x.sum()  # of noise on x, in x's place of the plane
    residual = x / x.sum() - plane
    squared = residual @ np.linalg.pinv(sigma**2 * spread @ spread.T, rcond=1e-9) @ residual
    assert np.sqrt(squared) == pytest.approx(reference.polar(x, mu)[1] / sigma, rel=1e-5, abs=1e-6)


def test_people_are_found_by_colour_but_dark_or_in_highlights() -> None:
    rng = np.random.default_rng(9)
    models = [new(Mixture, smoothing_radius=0), new(Chromatic, smoothing_radius=0)]
    for _ in range(40):
        light = np.clip(rng.normal(1, 0.1), 0.8, 1.2)
        flickering = np.where(np.indices((SIZE[1], SIZE[0]))[1][..., None] < 4, light, 1.0)  # no gain of the whole view
        for model in models:
            model.learn(noisy(np.round(room() * flickering).astype(np.uint8), rng))
    alike = (FLOOR[0] - 18, FLOOR[1], FLOOR[2] + 18)
    mixture, chromatic = (float(model.likelihood(with_person(room(), alike))[3, 2]) for model in models)
    assert chromatic > 0.9 > 0.5 > mixture
    dark = new(Chromatic)
    for _ in range(20):
        dark.learn(room((7, 9, 4)))
    assert dark.likelihood(with_person(room((7, 9, 4)), (5, 6, 7)))[MIDDLE] < 0.1
    answers = [float(taught(Codebook).likelihood(with_person(room(), in_shadow(r)))[MIDDLE]) for r in (1.15, 1.5)]
    assert answers[0] < 0.7 and answers[1] > 0.95


def test_brightness_in_bounds_and_second_colours_stay() -> None:
    model = new(Codebook)
    for k in range(20):
        model.learn(room(in_shadow(0.9 + 0.01 * k)))
    for share in (0.9, 1.0, 1.09):
        image = with_person(room(), in_shadow(share))
        image[0] = SHIRT  # an edge that keeps the view from having one gain
        assert model.likelihood(image)[MIDDLE] < 0.02
    lamp = (90, 200, 240)
    for colours, likely in (([0, 1] * 10, False), ([1, 1, 1, 0, 0, 0, 0, 0, 0, 0] * 2, True)):
        model = new(Codebook)
        model.learn_from([room(lamp) if lit else room() for lit in colours])
        assert model.likelihood(room()).max() < 0.05
        assert (model.likelihood(with_person(room(), lamp))[MIDDLE] > 0.9) == likely


def test_nobody_is_absorbed_and_the_first_is_never_forgotten() -> None:
    model, rng = taught(Codebook, absorption_time=20.0, absence=3.0), np.random.default_rng(10)
    for second in range(80):  # there for ten seconds, away for five
        seen = with_person(room()) if second % 15 < 10 else room()
        for _ in range(int(RATE)):
            likelihood = model.likelihood(noisy(seen, rng))
            assert (likelihood[MIDDLE] > 0.9) == (second % 15 < 10)
    model = taught(Codebook, absorption_time=5.0, memory=5.0, smoothing_radius=0)
    for _ in range(int(60 * RATE)):
        model.likelihood(with_person(room()))
    assert model.likelihood(with_person(room()))[MIDDLE] < 0.05  # the chair
    assert model.likelihood(room())[MIDDLE] < 0.05  # the floor below it
    for _ in range(int(10 * RATE)):
        model.likelihood(room())
    assert model.likelihood(with_person(room()))[MIDDLE] > 0.9  # somebody like the chair, after it is gone


NOW = 50


def random_book(rng: np.random.Generator, words: int) -> Codewords:
    shape = (3, 4, words)
    mean = rng.uniform(8, 240, (*shape, 3)).astype(np.float32)
    bounds = np.stack([rng.uniform(0.8, 1, shape), rng.uniform(1, 1.2, shape)], -1).astype(np.float32)
    frequency = rng.choice([0, 0, 1, 5, 40], shape).astype(np.float32)
    frequency[:, :, 0] = 7
    weight = np.where(rng.random(shape) < 0.5, np.minimum(frequency, 20), 0).astype(np.float32)
    weight[:, :, 0] = 7
    first = np.where(weight > 0, rng.integers(0, 2, shape) * 5, rng.integers(1, 40, shape))
    access = np.stack([first, rng.integers(first, NOW)], -1).astype(np.int32)
    return Codewords(mean, bounds, frequency, weight, access)


def book_of(records: Codewords, longest: NDArray[np.int32], v: int, u: int) -> reference.Book:
    """A pixel's codewords as the reference has them."""
    mean, bounds, frequency, weight, access = (part[v, u] for part in records)
    book: reference.Book = []
    for k, colour in enumerate(mean.astype(float)):
        low, high = bounds[k].astype(float) * np.linalg.norm(colour)
        first, last = access[k].tolist()
        word = reference.Codeword(
            colour, low, high, float(frequency[k]), float(weight[k]), int(longest[v, u, k]), first, last
        )
        book.append(word if frequency[k] else None)
    return book


def assert_same_book(found: reference.Book, expected: reference.Book) -> None:
    one, other = (
        np.array([np.full(10, np.nan) if word is None else np.hstack(astuple(word)) for word in book])
        for book in (found, expected)
    )
    np.testing.assert_allclose(one[:, :3], other[:, :3], rtol=1e-4)  # colours
    np.testing.assert_allclose(one[:, 3:], other[:, 3:], rtol=1e-3)


@drawn(30, seed=st.integers(0, 10**6), words=st.integers(1, 3))
def test_the_codebooks_log_odds_are_their_formula(seed: int, words: int) -> None:
    rng = np.random.default_rng(seed)
    book = random_book(rng, words)
    image, gain, config = near_modes(rng, book.mean), rng.uniform(0.8, 1.25, 3), CodebookConfig()
    expected = reference.codebook_log_odds(image, gain, book.mean, book.bounds, book.weight, config)
    tube = codebook_kernels.Tube(config.highlight_prior, config.brightest_highlight, config.channel_sd)
    log_odds = np.empty(image.shape[:2], np.float32)
    codebook_kernels.fill_codebook_log_odds(image, gain.astype(np.float32), book, Priors.of(config), tube, log_odds)
    np.testing.assert_allclose(log_odds, expected, atol=5e-3)


@pytest.mark.parametrize("empty", [True, False])
@drawn(30, seed=st.integers(0, 10**6), words=st.integers(1, 3))
def test_codewords_learn_and_follow_by_their_rules(empty: bool, seed: int, words: int) -> None:
    rng = np.random.default_rng(seed)
    state = random_book(rng, words)
    longest = rng.integers(0, 20 if empty else 1, state[2].shape).astype(np.int32)
    image, gain = near_modes(rng, state[0]), rng.uniform(0.8, 1.25, 3).astype(np.float32)
    likelihood = rng.uniform(0, 1, image.shape[:2]).astype(np.float32)
    found, runs = deepcopy(state), longest.copy()
    if empty:
        codebook_kernels.teach(image, gain, NOW, np.float32(15), runs, found)
    else:
        codebook_kernels.follow(image, gain, likelihood, NOW, np.float32(15), np.float32(0.06), (30, 12), found)
    for v, u in np.ndindex(image.shape[:2]):
        book, x, light = book_of(state, longest, v, u), image[v, u].astype(float), gain.astype(float)
        if empty:
            reference.teach(book, x, light, NOW, 15)
        else:
            reference.follow(book, x, light, float(likelihood[v, u]), NOW, 15, 0.06, (30, 12))
        assert_same_book(book_of(found, runs, v, u), book)


def test_a_negative_run_goes_on_from_the_end_to_the_beginning() -> None:
    longest = np.array([[[9, 2, 2, 5]]], np.int32)
    access = np.array([[[[1, 20], [3, 19], [4, 18], [1, 20]]]], np.int32)
    frequency, weight = np.ones((1, 1, 4), np.float32), np.ones((1, 1, 4), np.float32)
    mean, bounds = np.zeros((1, 1, 4, 3), np.float32), np.ones((1, 1, 4, 2), np.float32)
    forget_rare_words(20, 3, longest, Codewords(mean, bounds, frequency, weight, access))
    np.testing.assert_array_equal(weight[0, 0], [1, 1, 0, 0])  # the first stays; 3, 5 and 5 away
    np.testing.assert_array_equal(frequency, weight)
    assert not access.any()
