"""Nonsense leaves signs: each kind is named on several sets, and none is seen in what is right, perturbed as well."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import data_path, write_recording

from stseg.arrays import Floats
from stseg.commands.main import main
from stseg.geometry import Camera
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_recording
from stseg.tasks.sources import SourceSummary, recording_warnings, summarise_sources
from stseg.view_health.plausibility import pace_warnings, scene_warnings, twin_warnings

HEIGHT = 1.7


@pytest.fixture(params=["walkers", "laboratory", "cmc1"])
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> Recording:
    if request.param == "walkers":
        return read_recording(write_recording(tmp_path))
    if request.param == "laboratory":
        return read_recording(data_path("laboratory/rig.toml"))
    files, rig = sorted(data_path("cmc").glob("cam?_cam_mat.mat")), tmp_path / "rig.toml"
    where = ["--names", "Cam1,Cam2,Cam3,Cam4", "--size", "1920,1024", "--unit", "m", "--area=0,-0.4,7.67,3.6"]
    boxes = [f"--source-pattern={data_path('cmc')}/DET_CMC1_{{name}}.txt", "--source-kind=boxes", "--first-frame=1"]
    imported = ["calibrate", "import", "matrix", *map(str, files), "-o", str(rig), *where, "--frame-rate", "4", *boxes]
    assert main(imported) == 0
    return read_recording(rig)


@pytest.fixture
def summaries(recording: Recording) -> list[SourceSummary]:
    return summarise_sources(recording)


def warnings_of(
    recording: Recording,
    summaries: list[SourceSummary],
    changed: Callable[[Floats, Camera], Floats],
    cameras: int = 256,
) -> str:
    """The warnings where the boxes of the first cameras are changed."""
    return "\n".join(
        recording_warnings(
            recording,
            [with_boxes(one, changed(one.boxes, one.camera)) for one in summaries[:cameras]] + summaries[cameras:],
        )
    )


def with_boxes(one: SourceSummary, pixel: Floats, later: int = 0) -> SourceSummary:
    assert one.detections is not None
    kept = one.detections.kept
    kept = replace(kept, pixel=pixel, frame=kept.frame + later)
    return replace(one, detections=replace(one.detections, kept=kept))


def test_what_is_right_is_not_doubted(recording: Recording, summaries: list[SourceSummary]) -> None:
    assert recording_warnings(recording, summaries) == []
    chance = np.random.default_rng(5)
    assert not warnings_of(recording, summaries, lambda boxes, _: boxes + chance.normal(0, 2, boxes.shape))
    kept = replace(recording, rig=replace(recording.rig, frame_rate=1.3 * recording.rig.frame_rate))
    assert not warnings_of(kept, summaries, lambda boxes, _: boxes * chance.normal(1, 0.03, boxes.shape))


SHIFTED = "people stand where other cameras see them no more often than by chance"


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        (lambda boxes, camera: boxes / np.tile(camera.size, 2), "shares of the image"),
        (lambda boxes, _: np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), "corners x1, y1, x2, y2"),
        (lambda boxes, _: boxes / 2, "an image half as large"),
        (lambda boxes, _: 2 * boxes, "boxes begin beyond the image"),
        (lambda boxes, _: np.hstack([boxes[:, :2] + boxes[:, 2:] / 2, boxes[:, 2:]]), SHIFTED),
        (lambda boxes, _: np.hstack([boxes[:, :2] - 3 * boxes[:, 2:], boxes[:, 2:]]), "project outside the area"),
        (lambda boxes, _: boxes * [1, 1, 0, 1], "less than a pixel wide"),
        (lambda boxes, _: boxes * [1, 1, 1, 1 / 4] + boxes[:, 3:] * [0, 3 / 4, 0, 0], "fit a body on the ground: are"),
    ],
    ids=["shares", "corners", "half", "double", "centres", "beside", "flat", "short"],
)
def test_boxes_in_another_form_are_named(
    recording: Recording, summaries: list[SourceSummary], changed: Callable[[Floats, Camera], Floats], named: str
) -> None:
    assert named in warnings_of(recording, summaries, changed)


def test_cameras_that_never_agree_are_named(recording: Recording, summaries: list[SourceSummary]) -> None:
    first, *others = summaries
    assert first.detections is not None
    late = with_boxes(first, first.boxes, later=first.detections.frames // 2)
    (said,) = (words for words in recording_warnings(recording, [late, *others]) if SHIFTED in words)
    assert said.startswith(first.camera.name)


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
