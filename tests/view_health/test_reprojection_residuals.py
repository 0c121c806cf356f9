"""A knocked camera is found at its frame, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from stseg.arrays import Bytes, Floats
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig, pixel_rays
from stseg.simulation.rendering.room import render_room
from stseg.view_health.image_shifts import background_shift
from stseg.view_health.knock_detection import find_knocks


def correlated(frames: int, views: int, seed: int, correlation: float = 0.6) -> Floats:
    """Noise of standard deviation 1 whose neighbours are alike."""
    lots = np.random.default_rng(seed)
    noise = lots.normal(size=(frames, views))
    for k in range(1, frames):
        noise[k] = correlation * noise[k - 1] + np.sqrt(1 - correlation**2) * noise[k]
    return noise


@pytest.mark.parametrize("view", [0, 2])
def test_a_knock_is_found_at_its_frame(view: int) -> None:
    agreement = 4.0 + correlated(400, 4, view)
    agreement[250:, view] -= 4.0
    (knock,) = find_knocks(agreement)
    assert knock.view == view and abs(knock.frame - 250) <= 3
    assert knock.before - knock.after == pytest.approx(4.0, abs=1.0)


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_knock(seed: int) -> None:
    assert find_knocks(4.0 + correlated(400, 4, seed, 0.8)) == []


def test_what_all_views_suffer_is_no_knock() -> None:
    agreement = 4.0 + correlated(400, 4, 1)
    agreement[200:] -= 5.0
    assert find_knocks(agreement) == []


def test_a_view_that_gets_better_was_not_knocked() -> None:
    agreement = 4.0 + correlated(400, 4, 2)
    agreement[200:, 1] += 5.0
    assert find_knocks(agreement) == []


def test_frames_without_people_and_wild_frames_do_not_matter() -> None:
    agreement = 4.0 + correlated(600, 3, 3)
    agreement[100:180] = np.nan
    agreement[::50, 0] = -1e6
    agreement[400:, 1] -= 4.0
    (knock,) = find_knocks(agreement)
    assert knock.view == 1 and abs(knock.frame - 400) <= 3


def test_two_cameras_are_told_apart_by_time() -> None:
    agreement = 4.0 + correlated(900, 5, 4)
    agreement[300:, 0] -= 5.0
    agreement[600:, 3] -= 5.0
    assert [(knock.view, round(knock.frame, -2)) for knock in find_knocks(agreement)] == [(0, 300), (3, 600)]


def test_too_few_frames_say_nothing() -> None:
    agreement = np.array([4.0] * 15 + [-4.0] * 15)[:, None] * [1.0, 0.0]
    assert find_knocks(agreement) == []


def test_a_step_that_harms_nobody_is_none() -> None:
    agreement = 0.01 * correlated(400, 3, 5)
    agreement[200:, 1] -= 0.2
    assert len(find_knocks(agreement)) == 1
    assert find_knocks(agreement, least=0.5) == []


def rooms() -> list[Bytes]:
    """What three cameras see of an empty room."""
    spec = SceneSpec("knock", 1, (5.0, 5.0), 1.0, cameras=3, size=(240, 180), seed=3)
    return [render_room(spec, pixel_rays(camera), camera.centre).image for camera in build_rig(spec).cameras]


def filmed(room: Bytes, frame: int, shift: int, lots: np.random.Generator) -> Bytes:
    """A noisy frame in which somebody dark walks, by a camera that was turned by so many pixels."""
    image = np.roll(room, shift, axis=1).astype(float) * (1 + 0.05 * np.sin(frame / 7))
    left = 30 + 3 * frame % 150
    image[60:140, left : left + 25] = 40.0
    return np.asarray(np.clip(image + lots.normal(0, 3, image.shape), 0, 255), np.uint8)


def test_a_shifted_background_is_measured() -> None:
    room, lots = rooms()[0], np.random.default_rng(0)
    for shift in (-7, 0, 2):
        np.testing.assert_allclose(background_shift(room, filmed(room, 5, shift, lots)), [shift, 0], atol=0.3)


def test_a_simulated_knock_is_reported_with_its_frame() -> None:
    lots = np.random.default_rng(1)
    shifts = np.array(
        [
            [-np.hypot(*background_shift(room, filmed(room, k, 2 * (view == 1 and k >= 47), lots))) for k in range(80)]
            for view, room in enumerate(rooms())
        ]
    ).T
    (knock,) = find_knocks(shifts, least=0.5)
    assert (knock.view, knock.frame) == (1, 47)
    assert knock.after == pytest.approx(-2.0, abs=0.4)
