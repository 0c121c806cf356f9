"""Nonsense leaves signs: each kind is named on several sets, and none is seen in what is right, perturbed as well."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import data_path, write_recording

from stseg.arrays import Floats
from stseg.geometry import Camera
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_recording
from stseg.tasks.sources import SourceSummary, recording_warnings, summarise_sources
from stseg.view_health.plausibility import box_warnings, pace_warnings, scene_warnings, twin_warnings

HEIGHT = 1.7


@pytest.fixture(params=["walkers", "laboratory"])
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> Recording:
    return read_recording(write_recording(tmp_path) if request.param == "walkers" else data_path("laboratory/rig.toml"))


@pytest.fixture
def summaries(recording: Recording) -> list[SourceSummary]:
    return summarise_sources(recording)


def warnings_of(summaries: list[SourceSummary], changed: Callable[[Floats, Camera], Floats]) -> list[str]:
    changes = [(one, changed(one.boxes, one.camera)) for one in summaries]
    return [words for one, boxes in changes for words in box_warnings(one.camera, one.grid, boxes, HEIGHT)]


def test_what_is_right_is_not_doubted(recording: Recording, summaries: list[SourceSummary]) -> None:
    assert recording_warnings(recording, summaries) == []
    chance = np.random.default_rng(5)
    assert not warnings_of(summaries, lambda boxes, _: boxes * chance.normal(1, 0.05, boxes.shape))
    for one in summaries:
        frame, ground = one.feet
        shaken = ground + chance.normal(0, 0.2, ground.shape)
        assert not pace_warnings(recording.rig.frame_rate, frame, shaken, HEIGHT)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        (lambda boxes, camera: boxes / np.tile(camera.size, 2), "shares of the image"),
        (lambda boxes, _: np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), "corners x1, y1, x2, y2"),
        (lambda boxes, _: boxes / 2, "an image half as large"),
    ],
)
def test_boxes_in_another_form_are_named(
    summaries: list[SourceSummary], changed: Callable[[Floats, Camera], Floats], named: str
) -> None:
    assert any(named in words for words in warnings_of(summaries, changed))


def test_a_pace_of_no_people_is_named(recording: Recording, summaries: list[SourceSummary]) -> None:
    for one in summaries:
        assert "are frame_rate and" in pace_warnings(1000 * recording.rig.frame_rate, *one.feet, HEIGHT)[0]


def test_one_file_for_two_cameras_is_named(recording: Recording, summaries: list[SourceSummary]) -> None:
    boxes = [one.boxes for one in summaries]
    names = [camera.name for camera in recording.rig.cameras]
    assert twin_warnings(names, boxes) == []
    (said,) = twin_warnings(names, [boxes[0], *boxes[:-1]])
    assert said.startswith(f"cameras {names[0]} and {names[1]} have the same boxes")


def test_rigs_in_other_units_are_named(recording: Recording) -> None:
    rig = recording.rig
    assert scene_warnings(rig, HEIGHT) == []
    centimetres = [replace(camera, ground=camera.ground @ np.diag([0.01, 0.01, 1.0])) for camera in rig.cameras]
    centimetres = [replace(camera, vertical=camera.vertical / 100) for camera in centimetres]
    for wrong, named in (
        (replace(rig, cameras=rig.cameras[:1]), "one camera alone"),
        (replace(rig, grid=replace(rig.grid, top=0.2)), "grid.top is 0.2 m"),
        (replace(rig, frame_rate=0.01), "frame_rate is 0.01"),
        (replace(rig, frame_rate=1000.0), "frame_rate is 1000"),
        (replace(rig, cameras=tuple(centimetres)), "in centimetres"),
    ):
        (said,) = scene_warnings(wrong, HEIGHT)
        assert named in said
