"""Light that changes at once: people stay, background stays background, and no view is blind for long."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Bytes, Flags, Floats, Singles
from stseg.config import IlluminationConfig
from stseg.errors import ConfigError
from stseg.foreground import Background, Chromatic, Codebook, IlluminationMonitor, LightChange, Mixture
from stseg.foreground.gain_field import gain_field
from stseg.foreground.illumination import stationary_gain
from stseg.foreground.view_foreground import ViewForeground

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
    """A model that has seen the empty room."""
    rng = np.random.default_rng(1)
    learned = model(SIZE, RATE)
    for _ in range(15):
        learned.learn(shot(1.0, np.zeros(SIZE[::-1], bool), rng))
    return IlluminationMonitor(learned, RATE)


def film(watch: IlluminationMonitor, light: Light, frames: int = 24) -> list[Singles | None]:
    """What the watch says of somebody who walks while the light changes."""
    rng = np.random.default_rng(2)
    return [watch.likelihood(shot(light(frame), body(frame), rng)) for frame in range(frames)]


def half_lit(frame: int) -> Floats:
    """A lamp with a sharp border lights half of the view."""
    return np.asarray(np.where(U < 32, 1.8 if frame >= EVENT else 1.0, 1.0))


def lamp(frame: int) -> Floats:
    """A lamp that lights what is near it."""
    return np.asarray(1.0 + (frame >= EVENT) * 1.2 / (1 + ((U - 50) ** 2 + (V - 10) ** 2) / 900))


def lamp_for_a_while(frame: int) -> Floats:
    """It is switched off again."""
    return lamp(frame) if frame < 15 else np.ones_like(U)


def cloud(frame: int) -> Floats:
    """A shadow that grows over the view for two seconds."""
    return np.asarray(1.0 - 0.5 * min(max(frame - EVENT, 0) / 20, 1.0) * U / SIZE[0])


def too_bright(frame: int) -> Floats:
    """A lamp that the sensor cannot bear near it."""
    return np.asarray(1.0 + (frame >= EVENT) * 2.2 / (1 + ((U - 50) ** 2 + (V - 10) ** 2) / 900))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("light", [half_lit, lamp, lamp_for_a_while, cloud, too_bright])
def test_people_stay_and_background_stays_background(model: Callable[..., Background], light: Light) -> None:
    watch = watched(model)
    maps = film(watch, light)
    assert sum(found is None for found in maps) <= RATE
    assert len(watch.changes) <= 2
    if light is not cloud:  # which a model may take for a passing shadow
        assert watch.changes[0].first == EVENT
    assert sum(change.blind for change in watch.changes) == sum(found is None for found in maps)
    settled = EVENT + round(RATE)
    for frame, found in enumerate(maps):
        if found is not None:
            assert (found[body(frame)] > 0.5).mean() > 0.8, frame
            if frame < EVENT or frame >= settled:
                assert (found[~body(frame)] > 0.5).mean() < 0.04, frame


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("gain", [0.45, 1.7])
def test_what_changes_all_of_a_view_alike_is_no_event(model: Callable[..., Background], gain: float) -> None:
    watch = watched(model)
    maps = film(watch, lambda frame: gain if frame >= EVENT else 1.0, 10)
    assert watch.changes == []
    for frame, found in enumerate(maps):
        assert found is not None
        assert (found[body(frame)] > 0.5).mean() > 0.8
        assert (found[~body(frame)] > 0.5).mean() < 0.03


def test_somebody_before_the_lens_is_no_light() -> None:
    watch = watched(Mixture)
    rng = np.random.default_rng(4)
    near = np.asarray((U > 20) & (U < 44) & (V > 4))
    maps = [watch.likelihood(shot(1.0, near if frame >= EVENT else near & False, rng)) for frame in range(30)]
    assert sum(found is None for found in maps) < RATE
    last = maps[-1]
    assert last is not None
    assert (last[near] > 0.5).mean() > 0.95
    again = watch.likelihood(shot(1.0, near & False, rng))
    assert again is not None
    assert (again > 0.5).mean() < 0.03  # and leaves no ghost


def test_a_blind_view_has_no_evidence_and_says_when() -> None:
    watch = watched(Mixture)
    sight, rng = ViewForeground(watch), np.random.default_rng(5)
    nobody = np.zeros(SIZE[::-1], bool)
    assert sight.evidence(None) is None
    for _ in range(EVENT):
        assert sight.evidence(shot(1.0, nobody, rng)) is not None
    other_scene = shot(1.0, nobody, rng)[::-1, ::-1]  # the camera was turned: no light explains that
    seen = [sight.evidence(other_scene) for _ in range(12)]
    assert seen[0] is None
    assert all(one is not None for one in seen[10:])
    assert watch.changes == [LightChange(EVENT + 1, EVENT + 9, 9)]


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), tilt=st.floats(-0.5, 0.5), level=st.floats(0.6, 1.6))
def test_the_field_is_the_light_where_people_cover_a_part(seed: int, tilt: float, level: float) -> None:
    rng = np.random.default_rng(seed)
    light = level * (1 + tilt * (U / SIZE[0] - 0.5))
    people = body(int(rng.integers(0, 30)))
    image = shot(light, people, rng)
    field = gain_field(image, scene().astype(np.float32), np.ones(SIZE[::-1], np.float32))
    assert field.dtype == np.float32
    off = np.abs(np.log(field / light[..., None]))
    assert np.median(off) < 0.03
    assert off[~people].mean() < 0.06


def test_nothing_to_ask_is_no_light() -> None:
    dark = np.zeros((48, 64, 3), np.uint8)
    field = gain_field(dark, scene().astype(np.float32), np.ones(SIZE[::-1], np.float32))
    np.testing.assert_allclose(field, 1)


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


@pytest.mark.parametrize(("key", "value"), [("changed_share", 1.0), ("change_time", 0.0), ("blind_time", -1.0)])
def test_what_is_out_of_range_is_named(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        IlluminationConfig(**{key: value})
