"""The report: one page that holds everything, its pictures beside it, and a film of what it tells."""

import base64
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import cv2
import h5py
import numpy as np
import pytest
import run_files
from browser import CHROMIUM, chromium
from checks import Captured, Command, cases, refused
from numpy.typing import ArrayLike
from scenes import looking

from stseg.arrays import AnyArray, Bytes, Rows
from stseg.commands.main import main
from stseg.commands.report import report
from stseg.config import BodyConfig
from stseg.errors import ConfigError, FormatError, OutputError, SourceError
from stseg.geometry import Camera, Grid, Rig
from stseg.io.outputs.video_writer import write_film
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.runfile.layout import ghost_type
from stseg.io.runfile.runs import RunWriter
from stseg.records.ghost_reasons import DENIED, OTHERS, TOO_LITTLE, ghost_reasons
from stseg.records.tables import EVENT, RATES, TRAJECTORY, Tracks
from stseg.reporting.figures import RunFilm
from stseg.reporting.pictures.colours import track_colour
from stseg.reporting.pictures.overlay import OverlayView
from stseg.view_health.run_warnings import body_warnings, view_warnings


def page_of(run: Path, output: Path, **options: Any) -> str:
    report(run, output=output, **options)
    return output.read_text("utf-8")


def has(picture: Bytes, colour: tuple[int, int, int]) -> bool:
    return bool((picture == colour).all(axis=-1).any())


def pictures_in(page: str) -> list[Bytes]:
    found = re.findall(r"data:image/png;base64,([^\"$]+)\"", page)
    return [decoded(base64.b64decode(data)) for data in found]


def decoded(png: bytes) -> Bytes:
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def test_the_page_holds_everything_and_opens_no_stream(run_path: Path, tmp_path: Path) -> None:
    page = page_of(run_path, tmp_path / "page.html")
    assert page == page_of(run_path, tmp_path / "again.html")
    words = re.sub(r"data:image/png;base64,[^\"]+", "", page)
    assert not re.search(r"https?:|<link|url\(|src=\"[^\"]|<script[^>]* src|fetch\(|import\(|XMLHttpRequest", words)
    assert "default-src 'none'" in page
    assert len(pictures_in(page)) == 7 + 3 * 2  # plan, space-time and five maps; two cameras at three frames
    for fact in ("hall", "ghosts removed <b>1</b> of 3", "birth <b>2</b>", "entered", "no image from a camera"):
        assert fact in page
    empty = run_files.write_empty_run(tmp_path / "empty.h5")
    assert "<title>hall</title>" in page_of(empty, tmp_path / "empty.html")
    run_path.with_name("left.avi").unlink()
    report(run_path, output=tmp_path / "a.html", frame=(11,))
    refused(SourceError, "left", report, run_path, output=tmp_path / "b.html", camera_images=True)
    assert not (tmp_path / "b.html").exists()


def test_an_encounter_is_one_line_and_says_how_long_it_was(tmp_path: Path) -> None:
    recording, path = run_files.small_recording(tmp_path), tmp_path / "met.h5"
    events = [(11, b"merge", 1, 2, b"their cells touch, for 0.4 s"), (13, b"split", 1, 2, b"their cells part")]
    with RunWriter(path, recording, np.ones((3, 4, 6), np.uint8), "", overwrite=False, kept="tracks") as writer:
        run_files.fill(writer)
        writer.append("events", np.array(events, EVENT))
        writer.finish(Tracks(run_files.small_trajectory()).summary())
    page = page_of(path, tmp_path / "met.html", frame=(11,))
    assert "encounter <b>1</b>" in page and "<td>encounter<" in page and "their cells touch, for 0.4 s" in page
    assert not {"split", "merge"} & set(re.findall(r"\w+", page.split("<h2>Events</h2>")[1].split("</section>")[0]))
    assert "which this run did not keep (--volume tracks)" in page


HOSTILE = "<img src=x onerror=alert(1)>'\"&amp;"


def test_names_from_the_run_cannot_write_html(tmp_path: Path) -> None:
    recording = run_files.small_recording(tmp_path)
    cameras = tuple(replace(camera, name=f"{HOSTILE}{k}") for k, camera in enumerate(recording.rig.cameras))
    evil = replace(recording, rig=replace(recording.rig, name=HOSTILE, cameras=cameras))
    path, names = tmp_path / "evil.h5", tmp_path / "names.csv"
    run_files.write_small_run(path, recording=evil)
    names.write_text("id,name\n1,</script><script>alert(1)</script>\n2,</td><img src=x onerror=alert(1)>\n")
    page = page_of(path, tmp_path / "evil.html", names=names)
    assert page.count("<script") == 2, "the page's data and its own script"
    assert "<img src=x" not in page and "alert(1)</script>" not in page
    assert "&lt;img src=x onerror=alert(1)&gt;" in page and "&lt;script&gt;alert" in page


@pytest.mark.parametrize("name", ["</script><script>alert(1)", "a\nb", ""])
def test_names_that_no_file_can_have_are_refused(tmp_path: Path, name: str) -> None:
    path = run_files.write_small_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["cameras"] = ["left", name]
    refused(FormatError, "names of cameras", report, path, output=tmp_path / "evil.html")
    assert not (tmp_path / "evil.html").exists()


VIVID = (20, 240, 160)


def vivid_sources(folder: Path, rows: int, columns: int) -> tuple[CameraSource, ...]:
    """Two cameras with 16 frames of one vivid colour."""
    folder.mkdir()
    for frame in range(16):
        cv2.imwrite(str(folder / f"{frame:03d}.png"), np.full((rows, columns, 3), VIVID, np.uint8))
    return (CameraSource(Source("images", folder)),) * 2


@pytest.fixture
def filmed_run(tmp_path: Path) -> Path:
    sources = vivid_sources(tmp_path / "frames", 12, 16)
    recording = replace(run_files.small_recording(tmp_path), sources=sources)
    return run_files.write_small_run(tmp_path / "filmed.h5", recording=recording)


def test_camera_pixels_are_shown_only_when_asked_for(filmed_run: Path, tmp_path: Path) -> None:
    darkened = (17, 204, 136)  # a little darker
    found = []
    for flag in (False, True):
        options, folder = {"frame": (11,), "camera_images": flag}, tmp_path / f"pictures_{flag}"
        page = page_of(filmed_run, tmp_path / f"{flag}.html", pictures=folder, **options)
        files = [decoded(path.read_bytes()) for path in sorted(folder.glob("*.png"))]
        found.append([any(has(picture, darkened) for picture in pictures) for pictures in (pictures_in(page), files)])
        assert ("shows images from the cameras" in page) is flag
    assert found == [[False, False], [True, True]]


def test_pictures_stand_beside_the_page(run_path: Path, tmp_path: Path, capsys: Captured) -> None:
    report(run_path, output=tmp_path / "a.html", pictures=tmp_path / "one", frame=(11,))
    maps = {"plan", "spacetime", "density", "dwell", "flow", "ghosts", "blind"}
    plain = maps | {"slices", "marginal", "overlay_left", "overlay_right"}
    assert {path.stem for path in (tmp_path / "one").iterdir()} == plain
    assert "a.html" in capsys.readouterr().out
    (tmp_path / "two").mkdir()
    older = tmp_path / "two" / "plan.png"
    older.write_bytes((tmp_path / "one" / "flow.png").read_bytes())
    report(run_path, output=tmp_path / "a.html", pictures=tmp_path / "two", frame=(10, 13), overwrite=True)
    names = {path.stem for path in (tmp_path / "two").iterdir()}
    assert {"slices_10", "slices_13", "overlay_left_13"} <= names and "slices" not in names
    assert older.read_bytes() == (tmp_path / "one" / "plan.png").read_bytes()


def test_truth_adds_scores_and_errors_are_reported(run_path: Path, tmp_path: Path) -> None:
    rows = [f"{row['frame']},{row['id']},{row['x']},{row['y']}" for row in run_files.small_trajectory()]
    truth = tmp_path / "truth.csv"
    truth.write_text("\n".join(["frame,id,x,y", "3,1,0.1,0.1", *rows, "900,1,0.1,0.1"]))
    page = page_of(run_path, tmp_path / "truth.html", truth=truth, frame=(11,))
    assert "<dt>IDF1</dt><dd>100.0 %</dd>" in page
    refused(ConfigError, r"--frame.*found 99.*10 to 15", report, run_path, output=tmp_path / "a.html", frame=(99,))
    (tmp_path / "old.html").write_text("old, made by stseg")
    assert not page_of(run_path, tmp_path / "old.html", overwrite=True, frame=(11,)).startswith("old")
    refused(OutputError, "found", report, run_path, output=tmp_path / "a.html", pictures=run_path, frame=(11,))


FRAMES = np.arange(100, 400)


def candidates_of(frame: ArrayLike, status: ArrayLike, parts: ArrayLike, evidence: ArrayLike | None = None) -> Rows:
    """Candidates with the given evidence, or the sum of their parts less a price of 3 nats."""
    parts = np.asarray(parts, np.float32)
    weight = parts.sum(axis=1) - 3 if evidence is None else evidence
    table = run_files.table_of(ghost_type(parts.shape[1]), frame=frame, status=status, evidence=weight)
    table["parts"] = parts
    return table


def people_in(frames: AnyArray, *parts: ArrayLike) -> Rows:
    """A person in each frame, with this evidence in each view, nats."""
    evidence = np.stack([np.broadcast_to(np.asarray(part, float), len(frames)) for part in parts], -1)
    return candidates_of(frames, np.ones(len(frames)), evidence)


def test_ghosts_have_the_reason_that_weighed_most() -> None:
    people = people_in(np.arange(5), 3, 3, 3)
    ghosts = candidates_of(
        np.arange(4),
        np.zeros(4),
        np.array([[-2.5, 2, 0], [2, 2, 2], [0.1, 0.2, 0], [-1.2, 3, 3]]),
        [-3.5, -9, -2.7, -20],  # nothing else, evidence of others, nothing else, evidence of others above all
    )
    found = ghost_reasons(np.concatenate([people, ghosts]))
    assert found.reason.tolist() == [DENIED, OTHERS, TOO_LITTLE, OTHERS]
    assert found.denies.tolist() == [[True, False, False], [False] * 3, [False] * 3, [True, False, False]]
    assert found.counts() == [1, 2, 1] and len(found.ghosts) == 4
    none = ghost_reasons(candidates_of([], [], np.zeros((0, 3))))
    assert (none.counts(), none.denies.shape) == ([0, 0, 0], (0, 3))


@cases()
def test_a_view_that_is_wrong_is_named(frames: list[int], nats: list[float], words: str) -> None:
    seen = people_in(FRAMES, 3.0, np.interp(FRAMES, frames, nats))
    (warning,) = view_warnings(("a", "b"), seen, FRAMES, 5.0)
    assert words in warning


def test_wide_and_torn_bodies_are_reported_and_no_sound_views() -> None:
    """Views that agree, frames without people, and little evidence of people who are hidden now and then."""
    noise = np.random.default_rng(1).normal(3, 1, (2, len(FRAMES)))
    hidden = np.where(FRAMES % 3 == 0, 2.5, -0.016)
    for people in (people_in(FRAMES, *noise), people_in(FRAMES[FRAMES < 200], 3, 3), people_in(FRAMES, 3, hidden)):
        assert view_warnings(("a", "b"), people, FRAMES, 5.0) == []
    calm = rates_of(0.1, 0.1)
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.5), calm, BodyConfig()) == []
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.9, number=5), calm, BodyConfig()) == []
    (warning,) = body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig())
    assert "0.62 m wide" in warning and "0.42 m were expected" in warning
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig(width_mean=0.6)) == []
    (warning,) = body_warnings(("a", "b"), bodies_of(1.7, 0.42), rates_of(0.15, 0.38), BodyConfig())
    assert warning.startswith("view b misses 38 %")


def bodies_of(height: float, width: float, number: int = 40) -> Rows:
    return run_files.table_of(TRAJECTORY, height=np.full(number, height), width=width)


def rates_of(*miss: float) -> Rows:
    return run_files.table_of(RATES, view=np.arange(len(miss)), miss=miss)


def front_camera(name: str, x: float) -> Camera:
    """Three metres above y = -4, looking along y and down."""
    return looking(name, (x, -4.0, 3.0), (x, -4.0 + 3.0 / np.tan(0.4), 0.0), (320, 240), 250.0)


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Two cameras with frames of one vivid colour."""
    rig = Rig("hall", 5.0, Grid((0, 4), (-1, 2), 0.5, 1.8, 3), (front_camera("left", 1), front_camera("right", 3)))
    return Recording(tmp_path / "rig.toml", rig, vivid_sources(tmp_path / "frames", 240, 320))


def walk() -> Rows:
    return run_files.table_of(TRAJECTORY, frame=run_files.FRAMES, id=1, x=np.linspace(1.4, 2.6, 6), y=0.5, height=1.7)


@pytest.fixture
def walk_path(recording: Recording, tmp_path: Path) -> Path:
    return run_files.write_run(tmp_path / "run.h5", recording, walk())


def frames_of(path: Path) -> list[Bytes]:
    film = cv2.VideoCapture(str(path))
    return [np.asarray(frame, np.uint8) for _, frame in iter(film.read, (False, None))]


def is_close(pixel: Bytes, colour: tuple[int, int, int], tolerance: float) -> bool:
    return bool(np.abs(pixel.astype(int) - colour).max() <= tolerance)


def test_films_show_pillars_and_the_plan_of_one_or_many_cameras(recording: Recording) -> None:
    rig = recording.rig
    film = RunFilm(rig, np.full(rig.grid.shape, 2, np.uint8), walk())
    pictures = [film.picture(frame, (None, None)) for frame in (10, 15)]
    assert all(picture.shape == (film.size[1], film.size[0], 3) for picture in pictures)
    assert film.size[0] % 2 == film.size[1] % 2 == 0
    for picture, row in zip(pictures, walk()[[0, -1]], strict=True):
        for k, camera in enumerate(rig.cameras):
            u, v = np.rint(OverlayView(camera, 640).pixel(np.array([row["x"], row["y"]]), 0.0)).astype(int)
            assert tuple(picture[v, u + 640 * k].tolist()) == track_colour(1)
    plans = [picture[480:] for picture in pictures]  # below the views: beside them, a screen would show all smaller
    assert film.size[0] == 1280 and (plans[1] == track_colour(1)).all(axis=-1).any()
    assert not np.array_equal(plans[0], plans[1])
    for count, width in ((1, 1680), (7, 1998)):  # the plan is beside the views
        cameras = tuple(replace(front_camera("c", 2), name=f"c{k}") for k in range(count))
        rig = replace(recording.rig, cameras=cameras)
        film = RunFilm(rig, np.zeros(rig.grid.shape, np.uint8), walk()[:0])
        assert film.picture(3, (None,) * count).shape == (film.size[1], width, 3)


def test_the_film_has_the_frames_that_were_asked_for(walk_path: Path, tmp_path: Path, stdout: Command) -> None:
    assert "a.webm: 6 frames" in stdout("report", walk_path, "--video", tmp_path / "a.webm", "--camera-images")
    assert len(whole := frames_of(tmp_path / "a.webm")) == 6
    darkened = tuple(round(0.85 * tone) for tone in VIVID)
    assert is_close(whole[0][400, 20], (darkened[0], darkened[1], darkened[2]), 12)
    row = walk()[0]
    body = np.rint(OverlayView(front_camera("left", 1), 640).pixel(np.array([row["x"], row["y"]]), 0.9)).astype(int)
    assert not is_close(whole[0][body[1], body[0]], (darkened[0], darkened[1], darkened[2]), 30)  # the pillar
    assert not list(tmp_path.glob("*.part*"))
    stdout("report", walk_path, "--video", tmp_path / "a.webm", "--frames", "12:13", "--overwrite")
    assert len(frames_of(tmp_path / "a.webm")) == 1


@cases()
def test_slips_are_told_before_any_work(
    walk_path: Path, monkeypatch: pytest.MonkeyPatch, refusal: Command, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(walk_path.parent)
    before = set(walk_path.parent.iterdir())
    assert message in refusal("report", walk_path, *arguments) and set(walk_path.parent.iterdir()) == before


def test_without_the_flag_a_film_holds_no_camera_pixel(walk_path: Path, tmp_path: Path) -> None:
    for path in (tmp_path / "frames").iterdir():
        path.unlink()
    assert main(["report", str(walk_path), "--video", str(tmp_path / "a.mp4")]) == 0
    darkened = np.array([0.85 * tone for tone in VIVID])
    assert not any((np.abs(frame - darkened).max(axis=-1) < 40).any() for frame in frames_of(tmp_path / "a.mp4"))
    assert main(["report", str(walk_path), "--video", str(tmp_path / "b.mp4"), "--camera-images"]) == 2
    assert not (tmp_path / "b.mp4").exists()


def test_what_goes_wrong_on_the_way_leaves_no_film(tmp_path: Path) -> None:
    broken = Mock(side_effect=OutputError("x", "", "trouble", "none"))
    refused(OutputError, "trouble", write_film, tmp_path / "a.mp4", (broken(k) for k in range(1)), 5.0, False)
    refused(OutputError, "empty", write_film, tmp_path / "a.mp4", [], 5.0, False)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")
@pytest.mark.parametrize("film", ["a.webm", "a.mp4"])
def test_a_browser_plays_the_film(walk_path: Path, tmp_path: Path, film: str) -> None:
    assert main(["report", str(walk_path), "--video", str(tmp_path / film), "--frames", "10:12"]) == 0
    (tmp_path / "film.html").write_text(f"<video src='{film}' muted></video>")
    with chromium(tmp_path / "profile") as page:
        page.open(tmp_path / "film.html")
        page.wait_for("(v => v.error || v.readyState > 1)(document.querySelector('video'))")
        assert page.ask("(v => [v.error && v.error.code, v.duration])(document.querySelector('video'))") == [None, 0.4]
