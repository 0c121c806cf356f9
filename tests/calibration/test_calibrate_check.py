"""The check of a rig by boxes, and the page for clicking points."""

import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import CHROMIUM, Page, chromium
from checks import Captured, cases, data_path, in_ci, refused
from films import write_at_rate
from simulated_people import SIZE, exchanged, moved, ring, shown, walkers

from stseg import Boxes, Camera, Recording, Rig, Source, read_recording, write_rig
from stseg.arrays import Floats
from stseg.calibration.check.blunders import find_swapped_streams, match_frames
from stseg.calibration.check.box_correspondence import isolated_boxes, tables_of
from stseg.calibration.check.leave_one_out import locate
from stseg.calibration.check.rig_check import Check, check_rig, verdict_text
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_fit import fit_points
from stseg.commands.calibrate.app import app
from stseg.commands.main import main
from stseg.config import Config
from stseg.errors import ConfigError, OutputError
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry.sampling import Sampling
from stseg.io.calibrations.point_files import read_points
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource
from stseg.reporting.pictures.overlay import grid_picture
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig
from stseg.tasks.sources import recording_warnings, summarise_sources
from stseg.tasks.warnings import explained_by_swap

RIG = ring()
WALK = walkers(40)
SHOWN = shown(RIG, WALK)


def run(*tokens: str) -> None:
    app(tokens, exit_on_error=False, print_error=False, result_action="return_value")


def judged(rig: Rig, boxes: dict[int, list[Floats]] | None = None) -> tuple[Check, list[str]]:
    check = check_rig(rig, SHOWN if boxes is None else boxes)
    return check, verdict_text(rig, check)


class TestBoxes:
    def test_blobs_are_boxed_by_edges_and_noise_is_not(self) -> None:
        likelihood = np.full((480, 640), 0.02, np.float32)
        likelihood[100:300, 50:110] = 0.99
        likelihood[400:403, 600:603] = 0.99
        np.testing.assert_array_equal(isolated_boxes(likelihood, SIZE), [[49.5, 99.5, 109.5, 299.5]])
        boxes = Boxes(np.array([[10.0, 20.0, 30.0, 90.0]]), np.ones(1))
        np.testing.assert_array_equal(isolated_boxes(boxes, SIZE), [[10, 20, 40, 110]])
        assert isolated_boxes(None, SIZE).shape == (0, 4)


class TestPeople:
    def test_people_are_found_where_they_walk_and_else_nobody(self) -> None:
        tables = tables_of(RIG)
        people = match_frames(RIG, tables, SHOWN, range(0, 40, 4))
        assert 0.8 * 30 <= len(people) <= 33
        placed = locate(people, tables, range(4), 2).ground[:, None]
        off = np.hypot(*np.moveaxis(WALK[people.frame][..., :2] - placed, -1, 0)).min(axis=1)
        assert np.median(off) < 0.03 and np.quantile(off, 0.9) < 0.1
        assert people.has_box.sum(axis=1).mean() > 3
        people = match_frames(RIG, tables_of(RIG), {0: [np.zeros((0, 4))] * 4}, [0])
        assert len(people) == 0 and people.box.shape == (0, 4, 4)


class TestVerdict:
    def test_a_sound_rig_is_sound_and_others_off_by_how_much(self) -> None:
        check, (words,) = judged(RIG)
        assert check.sound and words.startswith("the views agree: none is off by more than a cell (10 cm)")
        check, (words, *_) = judged(moved(RIG, 2, "u", 30.0))
        (view,) = check.verdict.named
        assert view.view == 2 and not check.delays and not check.swapped
        assert view.pixels == pytest.approx(30.0, rel=0.2)
        assert view.right < -0.2, "the rig says further right, so people show to the left"
        assert "to the left" in words and " px" in words

    @cases()
    def test_the_camera_that_is_off_is_named(self, view: int, kind: str, amount: float) -> None:
        check, words = judged(moved(RIG, view, kind, amount))
        assert [one.view for one in check.verdict.named] == [view]
        assert words[0].startswith(f"cam{view + 1} is off: of ") and not check.delays and not check.swapped

    @pytest.mark.parametrize(("spread", "named"), [(0.0, [2]), (10.0, [])])
    def test_heads_that_move_for_a_while_prove_nothing(self, spread: float, named: list[int]) -> None:
        up = {frame: [0.0, 15.0 + spread * np.sin(frame / 3), 0.0, 0.0] for frame in SHOWN}
        check, words = judged(RIG, {t: [*a[:2], a[2] - up[t], a[3]] for t, a in SHOWN.items()})
        assert [one.view for one in check.verdict.named] == named
        assert words[0].startswith("cam3 is off: of " if named else "no view is certainly off by more than a cell (10")

    @pytest.mark.slow
    def test_two_that_are_off_are_named(self) -> None:
        check, _ = judged(moved(moved(ring(6), 1, "u", 35.0), 4, "z", 0.3), shown(ring(6), WALK[:30]))
        assert {one.view for one in check.verdict.named} == {1, 4}

    def test_of_two_or_of_few_people_nobody_is_to_blame(self) -> None:
        rig, boxes = replace(RIG, cameras=RIG.cameras[:2]), {frame: views[:2] for frame, views in SHOWN.items()}
        assert judged(rig, boxes)[0].sound
        check, words = judged(moved(rig, 0, "z", 0.4), boxes)
        assert check.verdict.unresolved is not None and not check.verdict.named
        assert "two views alone do not tell" in words[0]
        _, words = judged(RIG, {frame: SHOWN[frame] for frame in range(4)})
        assert words == ["too few people stand alone before cam1, cam2, cam3, cam4 to judge (fewer than 20)"]


class TestBlunders:
    def test_swapped_and_foreign_streams_are_named(self) -> None:
        check, words = judged(exchanged(RIG, 0, 1))
        assert check.swapped == ((0, 1),)
        assert words[0] == "cam1 and cam2 seem to be swapped: their frames fit far better the other way round"
        alike = ring(step=0.0)
        check, words = judged(exchanged(alike, 1, 3), shown(alike, WALK))
        assert sorted(check.swapped) == [(0, 2), (1, 3)]
        assert "cam2 and cam4" in words[0] and "cam1 and cam3" in words[0] and ", or " in words[0]
        crowd = shown(ring(7), walkers(60, 12))
        assert find_swapped_streams(ring(7), crowd) == ()
        assert find_swapped_streams(exchanged(ring(7), 0, 1), crowd) == ((0, 1),)
        elsewhere = shown(RIG, walkers(40, 3, seed=77))
        boxes = {frame: [*views[:3], elsewhere[frame][3]] for frame, views in SHOWN.items()}
        check, words = judged(RIG, boxes)
        assert 3 in check.lost and any("cam4 shows only" in sentence for sentence in words)

    @pytest.mark.parametrize(("view", "frames"), [(2, -3), *in_ci((0, 2))])
    def test_a_late_stream_is_named(self, view: int, frames: int) -> None:
        late = {frame: SHOWN.get(frame - frames, [np.zeros((0, 4))] * 4)[view] for frame in SHOWN}
        check, words = judged(RIG, {t: [*seen[:view], late[t], *seen[view + 1 :]] for t, seen in SHOWN.items()})
        assert [(one.view, one.frames) for one in check.delays] == [(view, frames)]
        side = "late" if frames > 0 else "early"
        assert words == [f"cam{view + 1} runs {abs(frames)} frames {side}: add {-frames} to its offset in the rig file"]


def test_coverage_counts_views_and_grids_lie_on_the_ground() -> None:
    has_box = Sampling.of(RIG, "point").views()
    assert has_box.shape == RIG.grid.shape and has_box.max() == 4
    camera = RIG.cameras[0]
    alone = Sampling.of(replace(RIG, cameras=(camera,)), "point").views()
    pixel, ahead = camera.project(RIG.grid.ground[10, 20], 0.0)
    assert alone[0, 10, 20] == int(ahead and camera.inside(pixel))
    elsewhere = replace(RIG.grid, x=(90.0, 95.0), y=(90.0, 95.0))
    plain, drawn = (grid_picture(camera, grid, None, 0, 640) for grid in (elsewhere, RIG.grid))
    changed = (plain != drawn).any(axis=-1)
    u, v = camera.project(np.array([2.5, 0.3]), 0.0)[0].round().astype(int)
    assert changed[v - 2 : v + 3, u - 2 : u + 3].any(), "the border of the area"


class TestCommand:
    @pytest.fixture
    def rig_file(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        monkeypatch.chdir(tmp_path)
        sources = []
        for k, camera in enumerate(RIG.cameras):
            boxes = [(frame, *box) for frame, views in SHOWN.items() for box in views[k]]
            lines = [f"{frame},{a:.2f},{b:.2f},{c - a:.2f},{d - b:.2f}" for frame, a, b, c, d in boxes]
            Path(f"{camera.name}.csv").write_text("\n".join(["frame,left,top,width,height", *lines]))
            sources.append(CameraSource(Source("boxes", Path(f"{camera.name}.csv"), frames=40)))
        write_rig("room.toml", Recording(Path("room.toml"), moved(RIG, 2, "u", 30.0), tuple(sources)))
        return Path("room.toml")

    def test_verdict_page_pictures_and_json(self, rig_file: Path, capsys: Captured) -> None:
        run("check", str(rig_file), "-o=check.html", "--pictures=shots")
        printed = capsys.readouterr().out
        assert "cam3 is off: of " in printed and "(without camera frames)" in printed
        shots = {path.name for path in Path("shots").iterdir()}
        assert shots == {"coverage.png", *(f"grid_cam{k}.png" for k in (1, 2, 3, 4))}
        page = Path("check.html").read_text()
        assert "cam3 is off" in page and page.count("<img") == 5
        refused(OutputError, r"check.html: found a file that exists", run, "check", str(rig_file), "-o=check.html")
        run("check", str(rig_file), "--json", "--frames=4:40")
        found = json.loads(capsys.readouterr().out)
        assert (found["off"], found["sound"], [*found["views"]]) == (["cam3"], False, [one.name for one in RIG.cameras])
        refused(ConfigError, r"--frames: found '9'", run, "check", str(rig_file), "--frames=9")

    def test_a_run_blames_the_exchange_for_what_its_views_look_like(
        self, rig_file: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        recording, said = read_recording(rig_file), ["view cam2 denies most people"]
        swapped = replace(recording, rig=exchanged(RIG, 1, 3))
        assert explained_by_swap(recording, (0, 40), said) == said and explained_by_swap(swapped, (0, 40), []) == []
        (warning,) = explained_by_swap(swapped, (0, 40), said)
        assert "cam2 and cam4 seem to be swapped" in warning
        assert explained_by_swap(swapped, (0, 40), [], True) == [warning]
        assert explained_by_swap(swapped, (0, 1), said) == said, "frames that the run has not are not looked at"
        assert recording_warnings(swapped, summarise_sources(swapped)) == [warning]
        for k in range(4):  # people before a wall of each camera's own brightness
            pictures = [np.full((*SIZE[::-1], 3), 40 + 50 * k, np.uint8) for _ in range(50)]
            for picture, views in zip(pictures[10:], SHOWN.values(), strict=True):
                for left, top, right, bottom in np.maximum(views[k], 0).astype(int):
                    picture[top:bottom, left:right] = 250, 20, 20
            write_at_rate(Path(f"empty{k}.avi"), pictures[:10])
            write_at_rate(Path(f"film{k}.avi"), pictures[10:])
        films, scenes = ([Source("video", Path(f"{name}{k}.avi")) for k in range(4)] for name in ("film", "empty"))
        feeds = tuple(CameraSource(films[k], background=scene) for k, scene in zip((0, 3, 2, 1), scenes, strict=True))
        filmed = Recording(rig_file, RIG, feeds)
        (warning,) = explained_by_swap(filmed, (0, 40), said)
        assert warning.startswith("cam2 and cam4"), "their streams are swapped, and not their empty scenes"
        few_rows = replace(Config(), foreground=replace(Config().foreground, body_rows=40.0))
        assert min(filmed.reduced(40.0).factors) > 1
        monkeypatch.setattr("stseg.tasks.calibration.check.Config", lambda: few_rows)
        assert explained_by_swap(filmed, (0, 40), said) == [warning], "by reduced pictures, too"


@pytest.mark.slow
def test_real_rigs_are_right_until_a_camera_is_moved(tmp_path: Path, capsys: Captured) -> None:
    folder, path = data_path("uu4").resolve(), tmp_path / "real.toml"
    names = sorted(str(path) for path in folder.glob("cam?/config.xml"))
    source = (f"--source-pattern={folder}/{{name}}/foreground_cropped.avi", "--source-kind=masks", f"-o={path}")
    run("import", "opencv", *names, "--size=644,486", "--area=-2.5,-4.5,2.5,1.5", "--frame-rate=5", *source)
    recording, boxes = read_recording(path), {}
    with open_frames(recording, 0, 80) as frame_sets:
        for frame_set in frame_sets:
            maps = (ViewForeground().evidence(view) for view in frame_set.views)
            boxes[frame_set.frame] = [isolated_boxes(likelihood, (644, 486)) for likelihood in maps]
    assert judged(recording.rig, boxes)[0].sound
    (named,) = judged(moved(recording.rig, 3, "z", 0.2), boxes)[0].verdict.named
    assert named.view == 3 and capsys.readouterr()
    run("check", str(data_path("laboratory") / "rig.toml"), "--json")
    assert json.loads(capsys.readouterr().out)["sound"], "few people, who turn, are no late camera"


SPEC = SceneSpec("clicked", 1, (6.0, 6.0), 1.0, cameras=2, size=(480, 360), seed=3, distortion=())
CAMERAS = build_rig(SPEC).cameras
PLACES = np.array([[-2.0, -1.0], [2.0, -2.0], [1.5, 1.5], [-1.0, 2.0], [0.0, 0.0], [0.5, -1.5]])
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")


def make(folder: Path, *more: str, area: str = "-3,-3,3,3") -> Path:
    names = [str(folder / f"{camera.name}.png") for camera in CAMERAS]
    for name in names:
        cv2.imwrite(name, np.full((360, 480, 3), 90, np.uint8))
    run("page", *names, f"-o={folder / 'points.html'}", f"--area={area}", *more)
    return folder / "points.html"


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with chromium(tmp_path / "profile") as browser:
        browser.open(make(tmp_path))
        browser.wait_for("[...document.querySelectorAll('canvas')].length === 4")
        browser.picture(1800, 1300)  # a click is a whole pixel of the screen: views are as large as on a desk's
        yield browser


def click(page: Page, canvas: str, share: Floats, more: str = "") -> None:
    """Click where a share of the canvas's width and height is."""
    u, v = share.tolist()
    page.ask(f"""(() => {{ const c = document.getElementById('{canvas}'), b = c.getBoundingClientRect();
      const at = {{ clientX: b.left + {u} * b.width, clientY: b.top + {v} * b.height, button: 0 {more} }};
      c.dispatchEvent(new MouseEvent('mousedown', at)); dispatchEvent(new MouseEvent('mouseup', at));
      return 0; }})()""")


def press(page: Page, key: str, more: str = "") -> None:
    page.ask(f"dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}' {more} }})), 0")


def place(page: Page, ground: Floats, cameras: tuple[Camera, ...] = CAMERAS) -> None:
    press(page, "n")
    click(page, "plan", np.array([(ground[0] + 3) / 6, (3 - ground[1]) / 6]))
    for camera in cameras:
        pixel = camera.project(ground[None], 0.0)[0][0]
        click(page, f"view-{camera.name}", (pixel + 0.5) / camera.size)


@needs_browser
def test_clicked_points_give_the_cameras(page: Page, tmp_path: Path) -> None:
    for ground in PLACES:
        place(page, ground)
    assert page.complaints == [] and page.requests == []
    captions = page.ask("[...document.querySelectorAll('figcaption')].map((one) => one.textContent)")
    assert all("6 points, off by 0." in text for text in captions[1:]), captions
    cells = "[...r.children].map((c) => +c.textContent)"
    rows = page.ask(f"[...document.querySelectorAll('#residuals tr')].map((r) => {cells})")
    assert len(rows) == 12 and max(row[2] for row in rows) < 0.6 and max(row[3] for row in rows) < 3
    points, saved = tmp_path / "points.csv", "document.querySelector('#save').href.split(',').slice(1).join(',')"
    points.write_text(page.ask(f"decodeURIComponent({saved})"))
    for table, camera in zip(read_points(points), CAMERAS, strict=True):
        fit = fit_points(table.camera, camera.size, Points(table.pixel, table.place[:, :2], table.place[:, 2]))
        assert np.linalg.norm(fit.camera.centre - camera.centre) < 0.15
        projected = fit.camera.project(PLACES, 0.0)[0]
        assert np.abs(projected - camera.project(PLACES, 0.0)[0]).max() < 1.0


@needs_browser
def test_everything_fits_one_screen_and_undo_keys_and_places(page: Page) -> None:
    page.picture(1280, 720)
    edges = "[...document.querySelectorAll('{}')].map((one) => one.getBoundingClientRect())"
    low = page.ask(f"Math.max(...{edges.format('figcaption')}.map((one) => one.bottom))")
    assert low < 720 and page.ask(f"{edges.format('.tools')}[0].height") < 45, "one line of tools"
    page.ask("""(() => { const c = document.getElementById('view-cam1'), b = c.getBoundingClientRect();
      c.dispatchEvent(new MouseEvent('mousemove', { clientX: b.left + 9, clientY: b.top + 9 })); return 0; })()""")
    assert page.ask("document.getElementById('lens').getBoundingClientRect().width") == 160
    for ground in PLACES[:5]:
        place(page, ground)
    table = "document.getElementById('csv').value"
    csv = page.ask(table)
    press(page, "ArrowRight", ", shiftKey: true")
    assert page.ask(table) != csv
    press(page, "z", ", ctrlKey: true")
    assert page.ask(table) == csv
    press(page, "p")
    click(page, "view-cam1", np.array([0.5, 0.3]))
    assert page.ask(table).count(",2\n") == 1
    press(page, "Delete")
    assert page.ask(table) == csv
    yellow = """(() => { const c = document.getElementById('plan'), d = c.getContext('2d')
      .getImageData(0, 0, c.width, c.height).data; let n = 0;
      for (let k = 0; k < d.length; k += 4) n += d[k] > 220 && d[k + 1] > 140 && d[k + 1] < 190 && d[k + 2] < 40;
      return n; })()"""
    assert page.ask(yellow) > 30, "a ring where the next point helps most"
    for ground in PLACES[:5]:
        place(page, ground)
    pixel = CAMERAS[0].project(np.array([[1.0, 1.0]]), 0.0)[0][0]
    click(page, "view-cam1", (pixel + 0.5) / CAMERAS[0].size, ", shiftKey: true")
    assert page.ask(table).count(",1.0000,1.0000,0\n") == 1, "a crossing of the grid"
    entry = "(() => {{ const e = document.getElementById('{}'); e.value = '{}'; e.onchange && e.onchange(); }})()"
    for name, value in (("x", 1.234), ("y", -0.5), ("snap", 0.5)):
        page.ask(entry.format(name, value))
    assert page.ask(table).count(",1.2340,-0.5000,0\n") == 1
    press(page, "n")
    click(page, "plan", np.array([0.52, 0.26]))
    assert page.ask("[document.getElementById('x').value, document.getElementById('y').value]") == ["0", "1.5"]


@needs_browser
def test_the_next_command_makes_the_rig(page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for ground in PLACES:
        place(page, ground)
    monkeypatch.chdir(tmp_path)
    Path("points.csv").write_text(page.ask("document.getElementById('csv').value"))
    command = page.ask("document.querySelector('code').textContent").replace("FRAMES_PER_SECOND", "25")
    assert main(shlex.split(command)[1:]) == 0
    assert read_recording(Path("rig.toml")).sources[0].source.path == tmp_path / "cam1.png"


def test_wrong_options_are_named(tmp_path: Path) -> None:
    refused(ConfigError, "x0 below x1", make, tmp_path, area="3,0,-3,1")
    cv2.imwrite(str(tmp_path / "plan.png"), np.zeros((100, 200, 3), np.uint8))
    refused(ConfigError, "picture that spans --area", make, tmp_path, f"--plan={tmp_path / 'plan.png'}", "--overwrite")
