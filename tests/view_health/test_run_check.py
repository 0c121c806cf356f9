"""A run sees which of its views is beside the others, and when one was knocked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import compiled_only, track, write_recording
from scenes import BODY, FEW_HEIGHTS, boxes, likelihoods, people, room

from stseg.arrays import Floats, ViewEvidence
from stseg.detection.detector import Detector
from stseg.geometry import Camera, Rig
from stseg.io.recording.rigs import read_recording, write_rig
from stseg.io.runfile.runs import read_run
from stseg.tasks.overview import summarise_run
from stseg.view_health.knock_detection import find_residual_step, views_off

CELL = 0.1


def moved(rig: Rig, view: int, pixels: float) -> Rig:
    """The rig with one view's picture of the ground moved to the right."""
    camera = rig.cameras[view]
    shift = np.array([[1.0, 0.0, pixels], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    there = Camera(camera.name, camera.size, shift @ camera.ground, shift @ camera.vertical, camera.lens)
    return replace(rig, cameras=tuple(there if k == view else one for k, one in enumerate(rig.cameras)))


def told(rig: Rig, kind: str, standing: Floats) -> Floats:
    """What the frame tells of each view of a rig, of people as the room's own cameras show them."""
    seen: list[ViewEvidence] = (
        list(likelihoods(room().cameras, standing))
        if kind == "pixels"
        else [boxes(camera, standing) for camera in room().cameras]
    )
    return Detector(rig, [kind] * 4, FEW_HEIGHTS, BODY).explain(seen, None).residual


@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_views_of_a_sound_rig_are_not_aside(kind: str) -> None:
    standing = people((-0.4, 0.1))
    assert np.abs(told(room(), kind, standing)).max() < 0.03


@pytest.mark.parametrize("kind", ["pixels", "boxes"])
@pytest.mark.parametrize("pixels", [6.0, -6.0])
def test_the_wrong_view_is_the_one_aside_and_to_which_side(kind: str, pixels: float) -> None:
    aside = told(moved(room(), 1, pixels), kind, people((-0.4, 0.1)))
    assert np.nanargmax(np.abs(aside)) == 1
    # The rig says that people appear further right than they do: the view sees them to the left.
    assert aside[1] * pixels < 0


def test_who_stands_before_another_tells_nothing() -> None:
    camera = room().cameras[0]
    place = np.array([-0.6, -0.6])
    away = place - camera.centre[:2]
    behind = place + 1.6 * away / np.hypot(*away)
    aside = told(room(), "pixels", people(tuple(place), tuple(behind)))
    assert np.isnan(aside[0]) and np.isfinite(aside[1:]).any()


def windows(seed: int, count: int = 60) -> Floats:
    return np.random.default_rng(seed).normal(0, 0.03, (count, 4))


def test_views_are_named_beyond_a_cell_alone() -> None:
    aside = windows(1)
    assert views_off(aside, CELL) == []
    aside[:, 2] -= 0.18
    aside[::3, 2] = np.nan
    aside[:, 0] += 0.06
    (off,) = views_off(aside, CELL)
    assert off.view == 2 and off.metres == pytest.approx(-0.18, abs=0.03)
    aside[:, 1] += 0.14
    assert [one.view for one in views_off(aside, CELL)] == [2, 1]
    aside[3:, 1:3] = np.nan
    assert views_off(aside, CELL) == []
    assert views_off(np.full((40, 3), np.nan), CELL) == []


@pytest.mark.parametrize("side", [1, -1])
def test_a_knock_is_found_with_its_window(side: int) -> None:
    aside = windows(2)
    assert find_residual_step(aside, CELL) is None
    aside[35:, 3] += side * 0.15
    knock = find_residual_step(aside, CELL)
    assert knock is not None and knock.view == 3
    assert abs(knock.frame - 35) <= 1
    assert knock.after - knock.before == pytest.approx(side * 0.15, abs=0.04)


@compiled_only
def test_a_run_says_which_view_disagrees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_recording(tmp_path)
    recording = read_recording(path)
    assert track(path, tmp_path / "sound.h5") == 0
    assert "calibrate check" not in capsys.readouterr().err
    write_rig(tmp_path / "wrong.toml", replace(recording, rig=moved(recording.rig, 1, 9.0)))
    assert track(tmp_path / "wrong.toml", tmp_path / "wrong.h5") == 0
    warned = capsys.readouterr().err
    assert "view east sees people" in warned and "to the left of where the views put them" in warned
    assert any(
        "view east sees people" in warning for warning in summarise_run(read_run(tmp_path / "wrong.h5")).warnings
    )
