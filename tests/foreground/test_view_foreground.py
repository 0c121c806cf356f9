"""The foreground of one view, and changes of illumination."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from checks import drawn, refused
from hypothesis import strategies as st

from stseg.arrays import Boxes, Bytes, Flags, Floats, Singles
from stseg.config import ForegroundConfig
from stseg.foreground import Background, Chromatic, Codebook, IlluminationMonitor, LightChange, Mixture, make_background
from stseg.foreground.gain_field import gain_field
from stseg.foreground.illumination import stationary_gain
from stseg.foreground.view_foreground import ViewForeground, without_prior


@drawn(100, st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_without_prior_keeps_the_likelihood_ratio(ratio_share: float, prior: float) -> None:
    ratio = ratio_share / (1 - ratio_share)
    posterior = prior * ratio / (prior * ratio + 1 - prior)
    alone = float(without_prior(np.full((1, 1), posterior, np.float32), prior)[0, 0])
    assert alone == pytest.approx(ratio_share, rel=2e-2, abs=1e-4)


def test_each_kind_of_observation_has_evidence_or_is_refused() -> None:
    foreground = ViewForeground()
    boxes = Boxes(np.array([[1.0, 2.0, 3.0, 4.0]]), np.ones(1))
    assert foreground.evidence(None) is foreground.pixels(None) is foreground.pixels(boxes) is None
    assert foreground.evidence(boxes) is boxes
    mask, instances = np.array([[0, 51], [255, 0]], np.uint8), np.array([[0, 3], [9, 0]], np.uint16)
    for likelihood in (foreground.evidence(mask), foreground.pixels(mask)):
        np.testing.assert_allclose(np.asarray(likelihood), mask / 255, atol=1e-6)
    found = foreground.evidence(instances)
    assert isinstance(found, Boxes) and len(found) == 2
    np.testing.assert_array_equal(foreground.pixels(instances), np.array([[0, 1], [1, 0]], np.float32))
    refused(ValueError, "background", ViewForeground().evidence, np.zeros((4, 4, 3), np.uint8))


@pytest.mark.parametrize("model", ["mixture", "chromatic", "codebook"])
def test_the_prior_is_taken_out_of_colour_likelihoods(model: Any) -> None:
    empty = np.full((12, 16, 3), 120, np.uint8)
    models = [make_background((16, 12), 10.0, ForegroundConfig(model=model)) for _ in range(2)]
    for background in models:
        for _ in range(20):
            background.learn(empty)
    frame = empty.copy()
    frame[4:8, 5:10] = (124, 116, 126)
    posterior = models[0].likelihood(frame)
    found = np.asarray(ViewForeground(IlluminationMonitor(models[1], 10.0)).evidence(frame))
    np.testing.assert_array_equal(found, without_prior(posterior, models[1].prior))
    assert (found >= posterior).all() and found[6, 7] > posterior[6, 7]


SIZE = (64, 48)
RATE = 10.0
EVENT = 6
MODELS = (Mixture, Chromatic, Codebook)
V, U = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)

Light = Callable[[int], Floats | float]
"""Gain of each pixel, or of all, at a frame."""


def scene() -> Floats:
    """An empty room of many tones, grey levels."""
    rng = np.random.default_rng(3)
    tones = np.kron(rng.uniform(60, 110, (12, 16)), np.ones((4, 4)))
    return np.asarray(tones[..., None] * [0.9, 1.0, 1.1])


def body(frame: int) -> Flags:
    """The pixels of somebody who walks through the room."""
    return np.asarray((np.abs(U - 14 - frame) < 4) & (np.abs(V - 26) < 12))


def shot(light: Floats | float, people: Flags, rng: np.random.Generator) -> Bytes:
    """A frame of people in striped clothes, in a light."""
    clothes = np.where((V % 4 < 2)[..., None], [30.0, 40.0, 150.0], [140.0, 40.0, 30.0])
    image = np.where(people[..., None], clothes, scene()) * np.broadcast_to(light, SIZE[::-1])[..., None]
    return np.asarray(np.clip(np.round(image + rng.normal(0, 2, image.shape)), 0, 255), np.uint8)


def watched(model: Callable[..., Background]) -> IlluminationMonitor:
    rng = np.random.default_rng(1)
    learned = model(SIZE, RATE)
    for _ in range(15):
        learned.learn(shot(1.0, np.zeros(SIZE[::-1], bool), rng))
    return IlluminationMonitor(learned, RATE)


def film(monitor: IlluminationMonitor, light: Light, frames: int = 24) -> list[Singles | None]:
    """Likelihoods of somebody who walks while the light changes."""
    rng = np.random.default_rng(2)
    return [monitor.likelihood(shot(light(frame), body(frame), rng)) for frame in range(frames)]


NEAR_LAMP = 1 / (1 + ((U - 50) ** 2 + (V - 10) ** 2) / 900)
LIGHTS: dict[str, Light] = {
    "a lamp with a sharp border": lambda frame: np.where((U < 32) & (frame >= EVENT), 1.8, 1.0),
    "a lamp": lambda frame: 1.0 + (frame >= EVENT) * 1.2 * NEAR_LAMP,
    "a lamp for a while": lambda frame: 1.0 + (EVENT <= frame < 15) * 1.2 * NEAR_LAMP,
    "a cloud": lambda frame: 1.0 - 0.5 * min(max(frame - EVENT, 0) / 20, 1.0) * U / SIZE[0],
    "a lamp that the sensor cannot bear": lambda frame: 1.0 + (frame >= EVENT) * 2.2 * NEAR_LAMP,
}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", LIGHTS)
def test_people_stay_and_background_stays_background(model: Callable[..., Background], name: str) -> None:
    watch = watched(model)
    maps = film(watch, LIGHTS[name])
    assert sum(found is None for found in maps) <= RATE
    assert len(watch.changes) <= 2
    # A model may take a cloud for a passing shadow.
    assert name == "a cloud" or watch.changes[0].first == EVENT
    assert sum(change.blind for change in watch.changes) == sum(found is None for found in maps)
    settled = EVENT + round(RATE)
    for frame, found in enumerate(maps):
        if found is not None:
            assert (found[body(frame)] > 0.5).mean() > 0.8, frame
            if frame < EVENT or frame >= settled:
                assert (found[~body(frame)] > 0.5).mean() < 0.04, frame


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("until", [48, 20])
def test_a_background_takes_the_first_light_of_a_segment(model: Callable[..., Background], until: int) -> None:
    watch, rng, light = watched(model), np.random.default_rng(2), np.where(U < 32, 1.8, 1.0)
    images = [shot(light if frame < until else 1.0, body(frame), rng) for frame in range(0, 48, 4)]
    assert watch.sees_other_light(images[0])
    watch.relight(images)
    np.testing.assert_allclose(np.median(watch.model.background_image() / scene(), (0, 2)), light[0], rtol=0.1)
    found = watch.likelihood(shot(light, body(20), rng))
    assert found is not None and (found[body(20)] > 0.5).mean() > 0.8 and (found[~body(20)] > 0.5).mean() < 0.04


@pytest.mark.parametrize("model", MODELS)
def test_a_grey_body_before_the_lens_is_no_light(model: Callable[..., Background]) -> None:
    watch, rng = watched(model), np.random.default_rng(2)
    nobody, near = np.zeros(SIZE[::-1], bool), (U > 12) & (U < 52) & (V > 4)
    images = [shot(1.0, nobody, rng) for _ in range(EVENT + 24)]
    for image in images[EVENT:]:
        image[near] = shot(2.0, nobody, rng)[::-1, ::-1][near]  # another texture in the room's colours
    before = watch.model.background_image()
    watch.relight(images[EVENT:])
    np.testing.assert_array_equal(watch.model.background_image(), before)
    found = [watch.likelihood(image) for image in images][-1]
    assert found is not None and (found[near] > 0.5).mean() > 0.8 and (found[~near] > 0.5).mean() < 0.04


@pytest.mark.parametrize("model", MODELS)
def test_walking_people_are_no_other_light(model: Callable[..., Background]) -> None:
    watch, rng = watched(model), np.random.default_rng(2)
    images = [shot(1.0, np.abs(U - 3 * frame) < 10, rng) for frame in range(24)]
    before = watch.model.background_image()
    assert watch.sees_other_light(images[4]) and not watch.sees_other_light(images[-1])
    watch.relight(images)
    np.testing.assert_array_equal(watch.model.background_image(), before)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("gain", [0.45, 1.7])
def test_what_changes_all_of_a_view_alike_is_no_event(model: Callable[..., Background], gain: float) -> None:
    watch = watched(model)
    maps = film(watch, lambda frame: gain if frame >= EVENT else 1.0, 10)
    assert watch.changes == []
    for frame, found in enumerate(maps):
        assert found is not None and (found[body(frame)] > 0.5).mean() > 0.8
        assert (found[~body(frame)] > 0.5).mean() < 0.03


def test_somebody_before_the_lens_and_nothing_are_no_light() -> None:
    watch = watched(Mixture)
    rng = np.random.default_rng(4)
    near = np.asarray((U > 20) & (U < 44) & (V > 4))
    maps = [watch.likelihood(shot(1.0, near if frame >= EVENT else near & False, rng)) for frame in range(30)]
    assert sum(found is None for found in maps) < RATE and (np.asarray(maps[-1])[near] > 0.5).mean() > 0.95
    again = np.asarray(watch.likelihood(shot(1.0, near & False, rng)), float)
    assert (again > 0.5).mean() < 0.03 and np.isfinite(again).all()  # and leaves no ghost
    dark = np.zeros((48, 64, 3), np.uint8)
    field = gain_field(dark, scene().astype(np.float32), np.ones(SIZE[::-1], np.float32))
    np.testing.assert_allclose(field, 1)


def test_a_blind_view_has_no_evidence_and_says_when() -> None:
    watch = watched(Mixture)
    foreground, rng = ViewForeground(watch), np.random.default_rng(5)
    nobody = np.zeros(SIZE[::-1], bool)
    assert foreground.evidence(None) is None
    for _ in range(EVENT):
        assert foreground.evidence(shot(1.0, nobody, rng)) is not None
    other_scene = shot(1.0, nobody, rng)[::-1, ::-1]  # the camera was turned: no light explains that
    found = [foreground.evidence(other_scene) for _ in range(12)]
    assert found[0] is None and all(likelihood is not None for likelihood in found[10:])
    assert watch.changes == [LightChange(EVENT + 1, EVENT + 9, 9)]


@drawn(45, seed=st.integers(0, 10**6), tilt=st.floats(-0.5, 0.5), level=st.floats(0.6, 1.6))
def test_the_field_is_the_light_where_people_cover_a_part(seed: int, tilt: float, level: float) -> None:
    rng = np.random.default_rng(seed)
    light = level * (1 + tilt * (U / SIZE[0] - 0.5))
    people = body(int(rng.integers(0, 30)))
    image = shot(light, people, rng)
    field = gain_field(image, scene().astype(np.float32), np.ones(SIZE[::-1], np.float32))
    assert field.dtype == np.float32
    off = np.abs(np.log(field / light[..., None]))
    assert np.median(off) < 0.03 and off[~people].mean() < 0.06


def test_only_still_colours_are_learned_in_a_new_light() -> None:
    rng = np.random.default_rng(6)
    lit = np.where(U < 32, 1.6, 1.0)
    frames = np.stack([shot(lit, body(frame), rng) for frame in range(9)])
    everywhere = np.ones(SIZE[::-1], bool)
    gain = stationary_gain(frames, scene().astype(np.float32), everywhere.astype(np.float32), everywhere)
    apart = np.asarray((V < 8) & (np.abs(U - 32) > 2))
    np.testing.assert_allclose(gain[apart], lit[apart][:, None] * np.ones(3), rtol=0.08)
    there = body(4) & (U < 28)
    assert np.abs(np.log(gain[there] / 1.6)).mean() < 0.15  # filled in from around
    known = stationary_gain(frames, scene().astype(np.float32), everywhere.astype(np.float32), ~everywhere)
    np.testing.assert_allclose(known[apart], 1)
