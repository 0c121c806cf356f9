"""The check of a run's views, knocks found in residuals, and signs of nonsense: none in what is right."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from checks import Captured, compiled_only, data_path
from recordings import track, write_recording
from scenes import detector_of, evidence_of, people, room
from simulated_people import moved

from stseg import Camera, Recording, Rig, read_recording, read_run, write_rig
from stseg.arrays import Bytes, Floats
from stseg.commands.main import main
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig, pixel_rays
from stseg.simulation.rendering.room import render_room
from stseg.tasks.overview import summarise_run
from stseg.tasks.sources import SourceSummary, recording_warnings, summarise_sources
from stseg.view_health.image_shifts import background_shift
from stseg.view_health.knock_detection import find_knocks, find_residual_step, views_off
from stseg.view_health.plausibility import pace_warnings, scene_warnings, twin_warnings

CELL = 0.1


def residuals(rig: Rig, kind: str, standing: Floats) -> Floats:
    """Residual of each view of a rig, of people as the room's own cameras show them."""
    return detector_of(rig, kind).explain(evidence_of(kind, room().cameras, standing), None).residual


@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_views_of_a_sound_rig_are_not_aside(kind: str) -> None:
    assert np.abs(residuals(room(), kind, people((-0.4, 0.1)))).max() < 0.03


@pytest.mark.parametrize("kind", ["pixels", "boxes"])
@pytest.mark.parametrize("pixels", [6.0, -6.0])
def test_the_wrong_view_is_the_one_aside_and_to_which_side(kind: str, pixels: float) -> None:
    aside = residuals(moved(room(), 1, "u", pixels), kind, people((-0.4, 0.1)))
    assert np.nanargmax(np.abs(aside)) == 1
    # The rig says that people appear further right than they do: the view sees them to the left.
    assert aside[1] * pixels < 0


def windows(seed: int, count: int = 60) -> Floats:
    return np.random.default_rng(seed).normal(0, 0.03, (count, 4))


def test_views_are_named_beyond_a_cell_and_by_who_is_open() -> None:
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
    assert views_off(aside, CELL) == [] and views_off(np.full((40, 3), np.nan), CELL) == []
    camera = room().cameras[0]
    place = np.array([-0.6, -0.6])
    away = place - camera.centre[:2]
    behind = place + 1.6 * away / np.hypot(*away)
    aside = residuals(room(), "pixels", people(tuple(place), tuple(behind)))
    assert np.isnan(aside[0]) and np.isfinite(aside[1:]).any()


@pytest.mark.parametrize("side", [1, -1])
def test_a_knock_is_found_with_its_window(side: int) -> None:
    aside = windows(2)
    assert find_residual_step(aside, CELL) is None
    aside[35:, 3] += side * 0.15
    knock = find_residual_step(aside, CELL)
    assert knock is not None and knock.view == 3
    assert abs(knock.frame - 35) <= 1 and knock.after - knock.before == pytest.approx(side * 0.15, abs=0.04)


@pytest.mark.slow
@compiled_only
def test_a_run_says_which_view_disagrees(tmp_path: Path, capsys: Captured) -> None:
    path = write_recording(tmp_path, 40)
    recording = read_recording(path)
    assert track(path, tmp_path / "sound.h5") == 0
    assert "calibrate check" not in capsys.readouterr().err
    write_rig(tmp_path / "wrong.toml", replace(recording, rig=moved(recording.rig, 1, "u", 9.0)))
    assert track(tmp_path / "wrong.toml", tmp_path / "wrong.h5") == 0
    warned = capsys.readouterr().err
    assert "view east sees people" in warned and "to the left of where the views put them" in warned
    assert any("view east sees people" in line for line in summarise_run(read_run(tmp_path / "wrong.h5")).warnings)


def correlated(frames: int, views: int, seed: int, correlation: float = 0.6) -> Floats:
    """Noise of standard deviation 1 whose neighbours are alike."""
    noise = np.random.default_rng(seed).normal(size=(frames, views))
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


@pytest.mark.parametrize(
    "agreement",
    [
        4.0 + correlated(400, 4, 1) - np.where(np.arange(400) < 200, 0.0, 5.0)[:, None],
        4.0 + correlated(400, 4, 2) + np.outer(np.arange(400) >= 200, [0.0, 5.0, 0.0, 0.0]),
        np.array([4.0] * 15 + [-4.0] * 15)[:, None] * [1.0, 0.0],
    ],
    ids=["all views suffer", "a view gets better", "too few frames"],
)
def test_other_steps_are_no_knocks(agreement: Floats) -> None:
    assert find_knocks(agreement) == []


def test_two_cameras_by_time_harmless_steps_and_wild_frames() -> None:
    agreement = 4.0 + correlated(900, 5, 4)
    agreement[300:, 0] -= 5.0
    agreement[600:, 3] -= 5.0
    assert [(knock.view, round(knock.frame, -2)) for knock in find_knocks(agreement)] == [(0, 300), (3, 600)]
    (knock,) = find_knocks(np.where(np.arange(100) < 70, 0.0, -5.0)[:, None] * [1.0, 0.0, 0.0])
    assert (knock.view, knock.frame) == (0, 70)
    agreement = 0.01 * correlated(400, 3, 5)
    agreement[200:, 1] -= 0.2
    assert len(find_knocks(agreement)) == 1 and find_knocks(agreement, least=0.5) == []
    agreement = 4.0 + correlated(600, 3, 3)
    agreement[100:180] = np.nan
    agreement[::50, 0] = -1e6
    agreement[400:, 1] -= 4.0
    (knock,) = find_knocks(agreement)
    assert knock.view == 1 and abs(knock.frame - 400) <= 3


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


def test_knocks_are_reported_and_background_shifts_measured() -> None:
    lots = np.random.default_rng(1)
    shifts = np.array(
        [
            [-np.hypot(*background_shift(room, filmed(room, k, 2 * (view == 1 and k >= 47), lots))) for k in range(80)]
            for view, room in enumerate(rooms())
        ]
    ).T
    (knock,) = find_knocks(shifts, least=0.5)
    assert (knock.view, knock.frame) == (1, 47) and knock.after == pytest.approx(-2.0, abs=0.4)
    room, lots = rooms()[0], np.random.default_rng(0)
    for shift in (-7, 0, 2):
        np.testing.assert_allclose(background_shift(room, filmed(room, 5, shift, lots)), [shift, 0], atol=0.3)


HEIGHT = 1.7


@pytest.fixture(scope="module", params=["walkers", "laboratory", "cmc1"])
def recording(request: pytest.FixtureRequest, rig_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    if request.param == "walkers":
        return read_recording(rig_path)
    if request.param == "laboratory":
        return read_recording(data_path("laboratory/rig.toml"))
    files, rig = sorted(data_path("cmc").glob("cam?_cam_mat.mat")), tmp_path_factory.mktemp("cmc1") / "rig.toml"
    where = ["--names", "Cam1,Cam2,Cam3,Cam4", "--size", "1920,1024", "--unit", "m", "--area=0,-0.4,7.67,3.6"]
    boxes = [f"--source-pattern={data_path('cmc')}/DET_CMC1_{{name}}.txt", "--source-kind=boxes", "--first-frame=1"]
    imported = ["calibrate", "import", "matrix", *map(str, files), "-o", str(rig), *where, "--frame-rate", "4", *boxes]
    assert main(imported) == 0
    return read_recording(rig)


@pytest.fixture(scope="module")
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


def test_what_is_right_is_not_doubted_but_a_pace_of_nobody(
    recording: Recording, summaries: list[SourceSummary]
) -> None:
    assert recording_warnings(recording, summaries) == []
    chance = np.random.default_rng(5)
    assert not warnings_of(recording, summaries, lambda boxes, _: boxes + chance.normal(0, 2, boxes.shape))
    kept = replace(recording, rig=replace(recording.rig, frame_rate=1.3 * recording.rig.frame_rate))
    assert not warnings_of(kept, summaries, lambda boxes, _: boxes * chance.normal(1, 0.03, boxes.shape))
    for one in summaries:
        assert "are frame_rate and" in pace_warnings(1000 * recording.rig.frame_rate, *one.feet(), HEIGHT)[0]


def test_feet_that_jump_from_frame_to_frame_are_no_pace() -> None:
    frame = np.repeat(np.arange(90), 3)
    standing = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 6.0]])[np.arange(270) % 3]
    walking = standing + (1.2 * frame / 30)[:, None] + np.random.default_rng(6).normal(0, 0.4, (270, 2))
    assert pace_warnings(30.0, frame, walking, HEIGHT) == []


SHIFTED = "people stand where other cameras see them hardly more often than by chance"
CENTRES = SHIFTED + ": are left and top the centres of its boxes?"


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        (lambda boxes, camera: boxes / np.tile(camera.size, 2), "shares of the image"),
        (lambda boxes, _: np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), "corners x1, y1, x2, y2"),
        (lambda boxes, _: boxes / 2, "an image half as large"),
        (lambda boxes, _: 2 * boxes, "boxes begin beyond the image"),
        (lambda boxes, _: np.hstack([boxes[:, :2] + boxes[:, 2:] / 2, boxes[:, 2:]]), CENTRES),
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


def test_cameras_that_never_agree_and_one_file_are_named(recording: Recording, summaries: list[SourceSummary]) -> None:
    first, *others = summaries
    assert first.detections is not None
    late = with_boxes(first, first.boxes, later=first.detections.frames // 2)
    (said,) = (words for words in recording_warnings(recording, [late, *others]) if SHIFTED in words)
    assert said.startswith(first.camera.name)
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
        (replace(rig, grid=replace(rig.grid, cell=1.0)), "grid.cell is 1 m"),
        (replace(rig, frame_rate=0.01), "frame_rate is 0.01"),
        (replace(rig, frame_rate=1000.0), "frame_rate is 1000"),
        (replace(rig, cameras=tuple(centimetres)), "in centimetres"),
    ):
        (said,) = scene_warnings(wrong, HEIGHT)
        assert named in said
