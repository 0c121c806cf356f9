"""The film of a run: as many frames as asked, pillars where people are, camera pixels only when asked for."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
import run_files
from browser import CHROMIUM, chromium
from cases import cases
from refusals import Command, refused
from scenes import looking

from stseg.arrays import Bytes, Rows
from stseg.commands.main import main
from stseg.errors import OutputError
from stseg.geometry import Camera, Grid, Rig
from stseg.io.outputs.video_writer import write_film
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.records.tables import TRAJECTORY
from stseg.reporting.figures import RunFilm
from stseg.reporting.pictures.colours import track_colour
from stseg.reporting.pictures.overlay import OverlayView

VIVID = (20, 240, 160)


def front_camera(name: str, x: float) -> Camera:
    """Three metres above y = -4, looking along y and down."""
    return looking(name, (x, -4.0, 3.0), (x, -4.0 + 3.0 / np.tan(0.4), 0.0), (320, 240), 250.0)


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Two cameras with frames of one vivid colour."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for frame in range(16):
        cv2.imwrite(str(folder / f"{frame:03d}.png"), np.full((240, 320, 3), VIVID, np.uint8))
    rig = Rig("hall", 5.0, Grid((0, 4), (-1, 2), 0.5, 1.8, 3), (front_camera("left", 1), front_camera("right", 3)))
    return Recording(tmp_path / "rig.toml", rig, (CameraSource(Source("images", folder)),) * 2)


def walk() -> Rows:
    """One person who crosses the ground in frames 10 to 15."""
    return run_files.table_of(TRAJECTORY, frame=run_files.FRAMES, id=1, x=np.linspace(1.4, 2.6, 6), y=0.5, height=1.7)


@pytest.fixture
def run_path(recording: Recording, tmp_path: Path) -> Path:
    return run_files.write_run(tmp_path / "run.h5", recording, walk())


def frames_of(path: Path) -> list[Bytes]:
    film = cv2.VideoCapture(str(path))
    return [np.asarray(frame, np.uint8) for _, frame in iter(film.read, (False, None))]


def is_close(pixel: Bytes, colour: tuple[int, int, int], tolerance: float) -> bool:
    return bool(np.abs(pixel.astype(int) - colour).max() <= tolerance)


def test_pillars_and_the_plan_are_drawn_where_people_are(recording: Recording) -> None:
    rig = recording.rig
    film = RunFilm(rig, np.full(rig.grid.shape, 2, np.uint8), walk())
    pictures = [film.picture(frame, (None, None)) for frame in (10, 15)]
    assert all(picture.shape == (film.size[1], film.size[0], 3) for picture in pictures)
    assert film.size[0] % 2 == film.size[1] % 2 == 0
    for picture, row in zip(pictures, walk()[[0, -1]], strict=True):
        for k, camera in enumerate(rig.cameras):
            u, v = np.rint(OverlayView(camera, 640).pixel(np.array([row["x"], row["y"]]), 0.0)).astype(int)
            assert tuple(picture[v, u + 640 * k].tolist()) == track_colour(1)
    assert not np.array_equal(pictures[0][:, 1280:], pictures[1][:, 1280:])
    assert (pictures[1][:, 1280:] == track_colour(1)).all(axis=-1).any()


def test_the_film_has_the_frames_that_were_asked_for(run_path: Path, tmp_path: Path, stdout: Command) -> None:
    assert "a.mp4: 6 frames" in stdout("report", run_path, "--video", tmp_path / "a.mp4", "--camera-images")
    whole = frames_of(tmp_path / "a.mp4")
    assert len(whole) == 6
    darkened = tuple(round(0.85 * tone) for tone in VIVID)
    assert is_close(whole[0][400, 20], (darkened[0], darkened[1], darkened[2]), 12)
    row = walk()[0]
    body = np.rint(OverlayView(front_camera("left", 1), 640).pixel(np.array([row["x"], row["y"]]), 0.9)).astype(int)
    assert not is_close(whole[0][body[1], body[0]], (darkened[0], darkened[1], darkened[2]), 30)  # the pillar
    assert not list(tmp_path.glob("*.part*"))


def test_without_the_flag_a_film_holds_no_camera_pixel(run_path: Path, tmp_path: Path) -> None:
    for path in (tmp_path / "frames").iterdir():
        path.unlink()
    assert main(["report", str(run_path), "--video", str(tmp_path / "a.mp4")]) == 0
    darkened = np.array([0.85 * tone for tone in VIVID])
    assert not any((np.abs(frame - darkened).max(axis=-1) < 40).any() for frame in frames_of(tmp_path / "a.mp4"))
    assert main(["report", str(run_path), "--video", str(tmp_path / "b.mp4"), "--camera-images"]) == 2
    assert not (tmp_path / "b.mp4").exists()


@cases()
def test_slips_are_told_before_any_work(
    run_path: Path, monkeypatch: pytest.MonkeyPatch, refusal: Command, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(run_path.parent)
    before = set(run_path.parent.iterdir())
    assert message in refusal("report", run_path, *arguments)
    assert set(run_path.parent.iterdir()) == before


def test_an_older_film_is_kept_unless_it_may_go(run_path: Path, tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_text("precious")
    assert main(["report", str(run_path), "--video", str(tmp_path / "a.mp4")]) == 2
    assert main(["report", str(run_path), "--video", str(tmp_path / "a.mp4"), "--overwrite"]) == 2
    assert (tmp_path / "a.mp4").read_text() == "precious"
    (tmp_path / "a.mp4").unlink()
    for frames in ("12:14", "12:13"):
        assert (
            main(["report", str(run_path), "--video", str(tmp_path / "a.mp4"), "--frames", frames, "--overwrite"]) == 0
        )
        assert len(frames_of(tmp_path / "a.mp4")) == int(frames[-1]) - 2


def test_what_goes_wrong_on_the_way_leaves_no_film(tmp_path: Path) -> None:
    broken = Mock(side_effect=OutputError("x", "", "trouble", "none"))
    refused(OutputError, "trouble", write_film, tmp_path / "a.mp4", (broken(k) for k in range(1)), 5.0, False)
    refused(OutputError, "empty", write_film, tmp_path / "a.mp4", [], 5.0, False)
    assert not list(tmp_path.iterdir())


def test_a_rig_of_one_camera_and_of_many_have_films(recording: Recording) -> None:
    sizes = []
    for count in (1, 7):
        cameras = tuple(replace(front_camera("c", 2), name=f"c{k}") for k in range(count))
        rig = replace(recording.rig, cameras=cameras)
        film = RunFilm(rig, np.zeros(rig.grid.shape, np.uint8), walk()[:0])
        assert film.picture(3, (None,) * count).shape == (film.size[1], film.size[0], 3)
        sizes.append(film.size)
    assert sizes[0][0] < sizes[1][0] and sizes[1][0] < 3000


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")
def test_a_browser_plays_the_film(run_path: Path, tmp_path: Path) -> None:
    assert main(["report", str(run_path), "--video", str(tmp_path / "a.mp4"), "--frames", "10:12"]) == 0
    (tmp_path / "film.html").write_text("<video src='a.mp4' muted></video>")
    with chromium(tmp_path / "profile") as page:
        page.open(tmp_path / "film.html")
        page.wait_for("(v => v.error || v.readyState > 1)(document.querySelector('video'))")
        assert page.ask("(v => [v.error && v.error.code, v.duration])(document.querySelector('video'))") == [None, 0.4]
