"""Commands, what they refuse before they begin, and the demo that the README begins with."""

import io
import json
import os
import re
import subprocess
import sys
from contextlib import redirect_stdout
from html import unescape
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from attacks import RIG, film, write_rig
from checks import Captured, Command, cases, refused
from recordings import COMMAND, ENVIRONMENT, process
from run_files import small_recording, small_trajectory, trajectory_of, write_empty_run, write_run, write_small_run

import stseg
from stseg import Grid, Lens, Rig, read_run, read_tracks_csv
from stseg.commands.inspect import event_counts_text
from stseg.commands.main import COMMANDS, main
from stseg.errors import CalibrationError, OutputError
from stseg.geometry.lens import LensModel
from stseg.tasks.overview import summarise_run


def test_version_and_help_name_every_command_and_import_none(stdout: Command) -> None:
    program = (
        "import sys; from stseg.commands.main import main; main(['--help']);"
        "print(*(name for name in ('numba', 'cv2', 'h5py', 'scipy') if name in sys.modules), file=sys.stderr)"
    )
    found = process(program)
    assert (found.returncode, found.stderr.strip()) == (0, "")
    assert all(f" {command} " in found.stdout for command in COMMANDS)
    assert stdout("--version") == f"{stseg.__version__}\n"
    assert "MOTChallenge" in stdout("export", "--help")  # the long text, not the line of the list


def test_exit_statuses_of_the_program(run_path: Path, tmp_path: Path) -> None:
    good = process(COMMAND, "inspect", run_path)
    assert (good.returncode, good.stderr) == (0, "")
    bad = process(COMMAND, "inspect", tmp_path / "none.h5")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr == f"stseg: error: {tmp_path / 'none.h5'}: found no such file, expected a run file\n"


@cases()
def test_slips_on_the_command_line_are_one_line(arguments: list[str], told: str, refusal: Command) -> None:
    assert told in refusal(*arguments)


def test_an_interrupt_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    def interrupted(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("stseg.commands.inspect.read_run", interrupted)
    assert main(["inspect", "x.h5"]) == 130
    assert capsys.readouterr().err == "stseg: interrupted\n"
    monkeypatch.setattr("stseg.commands.run.prepare_workers", interrupted)
    assert main(["run", "x.toml", "-o", "x.h5"]) == 130
    assert capsys.readouterr().err.startswith("stseg: interrupted; the same command goes on after the last finished")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_commands_and_options(shell: str, stdout: Command) -> None:
    text = stdout("completion", shell)
    assert "calibrate" in text and "measure" in text and "camera-images" in text


@pytest.mark.skipif(os.name == "nt", reason="needs a shell's pipe")
def test_a_reader_that_has_seen_enough_is_no_error(run_path: Path) -> None:
    command = [sys.executable, "-c", COMMAND, "inspect", "--json", str(run_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT) as running:
        assert running.stdout is not None and running.stderr is not None
        running.stdout.close()
        assert running.stderr.read() == b""
    assert running.returncode == 0


def test_inspect_sums_up_a_run_its_people_and_ghosts(run_path: Path) -> None:
    overview = summarise_run(read_run(run_path))
    assert (overview.frames, overview.first_frame, overview.last_frame, overview.seconds) == (6, 10, 15, 1.2)
    assert (overview.people_mean, overview.people_most) == (1.5, 2)
    assert [track["id"] for track in overview.tracks] == [1, 2] and overview.events == {"birth": 2}
    assert (overview.candidates_per_frame, overview.ghosts_per_frame) == (3 / 6, 1 / 6)
    assert overview.seconds_by_stage == {"cut": 3.0, "volume": 1.0}
    assert list(overview.seconds_by_stage) == ["cut", "volume"]
    assert (overview.windows, overview.frames_per_window) == (2, 3.0)
    assert list(overview.rates) == ["left", "right"]
    assert overview.rates["left"] == pytest.approx({"miss": 0.2, "clutter": 0.025, "person_clutter": 0.4})
    assert overview.bytes == run_path.stat().st_size
    brief, blind = overview.warnings
    assert brief.startswith("left, right: the background was learned from 1 s: people who hardly moved may be part")
    assert blind == "view right has no evidence on any candidate: is it blind, or its calibration wrong?"
    assert overview.people_per_minute == [1.5]
    assert overview.track_seconds == pytest.approx({"shortest": 0.6, "median": 0.9, "longest": 1.2})
    assert overview.ground_by_views == [0, 0, 1]
    assert overview.ghost_reasons["a view sees nobody there"] == 1 == sum(overview.ghost_reasons.values())
    assert overview.ghosts_denied_by == {"left": 1, "right": 0}


def test_inspect_as_json_and_on_a_screen_warns_of_empty_runs(run_path: Path, stdout: Command, tmp_path: Path) -> None:
    found = json.loads(stdout("inspect", run_path, "--json"))
    assert (found["cameras"], found["tracks"][0]["frames"]) == (["left", "right"], 6)
    page = (Path(__file__).parents[2] / "docs" / "outputs.md").read_text("utf-8")
    _, _, listed = page.partition("## Keys of `stseg inspect --json`")
    cells = re.findall(r"^\| (`.*?`) \|", listed, re.MULTILINE)
    assert re.findall(r"`(\w+)`", " ".join(cells)) == list(found)
    assert event_counts_text({"birth": 3, "merge": 2, "split": 1}) == "3 birth, 2 encounter"
    screen = stdout("inspect", run_path)
    for said in ("hall", "10 to 15", "2 birth", "cut 3.0 s (75 %)", "warning: view right", "x 0 to 0.6 m"):
        assert said in screen
    assert re.search(r"left +20\.0 +2\.5 +40\.0 +1 *\n", screen)  # of each view, how it errs and what it denies
    path = write_run(tmp_path / "silent.h5", small_recording(tmp_path), trajectory_of(), np.array([0]), views=0)
    assert read_run(path).warnings[:2] == ["no person was found", "no view sees any cell"]
    assert "learned from 0 s" in read_run(path).warnings[2]
    assert "warning: no person was found" in stdout("inspect", path)


def test_inspect_writes_a_slice_to_a_file(run_path: Path, tmp_path: Path, stdout: Command, refusal: Command) -> None:
    texts = ("t=2.2,plane=0.9", "frame=11,plane=0.85", "t=2.4,plane=0.9", "t=2.2,plane=0", "frame=11,plane=all")
    said = [stdout("inspect", run_path, "--slice", text, "-o", tmp_path / f"{k}.png") for k, text in enumerate(texts)]
    pictures = [(tmp_path / f"{k}.png").read_bytes() for k in range(5)]
    assert pictures[0] == pictures[1] and len(set(pictures)) == 4
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
    assert "0.png: frame 11 (2.20 s), 0.90 m" in said[0]
    command = ("inspect", run_path, "--slice", "t=2,plane=0")
    assert "-o SLICE.png with it" in refusal(*command)
    refusal("inspect", run_path, "-o", tmp_path / "a.png")


@cases()
def test_slices_out_of_range(run_path: Path, tmp_path: Path, refusal: Command, arguments: list[str], told: str) -> None:
    assert told in refusal("inspect", run_path, *arguments, "-o", tmp_path / "slice.png")
    assert not (tmp_path / "slice.png").exists()


def test_export_and_evaluate_take_a_run_file(run_path: Path, tmp_path: Path, stdout: Command) -> None:
    assert main(["export", str(run_path), "--to", "pedpy", "-o", str(tmp_path / "tracks.txt")]) == 0
    lines = (tmp_path / "tracks.txt").read_text().splitlines()
    assert lines[:3] == ["# framerate: 5.00", "# id frame x/m y/m z/m", "1 10 0.1500 0.2000 0.0000"]
    assert len(lines) == 2 + len(small_trajectory())
    assert main(["export", str(run_path), "--to", "mot", "-o", str(tmp_path / "mot.txt")]) == 0
    lines = (tmp_path / "mot.txt").read_text().splitlines()
    assert lines[0] == "11,1,-1,-1,-1,-1,1,0.1500,0.2000,0.0000" and len(lines) == len(small_trajectory())
    truth = tmp_path / "truth.csv"
    stdout("export", run_path, "--to", "csv", "-o", truth)
    assert json.loads(stdout("evaluate", run_path, truth, "--json"))["MODA"] == 100


ROOT = Path(__file__).parents[2]
GOLDEN = json.loads((ROOT / "tests" / "golden" / "scores.json").read_text("utf-8"))["demo"]
"""Scores of the demo, percent."""


class Demo(NamedTuple):
    """A demo that was run: its folder, and what it printed."""

    folder: Path
    said: str


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    if "STSEG_DEMO" in os.environ:  # CI has made it
        folder = Path(os.environ["STSEG_DEMO"])
        return Demo(folder, folder.with_suffix(".txt").read_text("utf-8"))
    folder = tmp_path_factory.mktemp("demo") / "shown"
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["demo", str(folder)]) == 0
    return Demo(folder, printed.getvalue())


@pytest.mark.slow
def test_people_are_tracked_scored_and_shown(demo: Demo, stdout: Command) -> None:
    truth = demo.folder / "scene" / "truth.csv"
    scores = json.loads(stdout("evaluate", demo.folder / "run.h5", truth, "--json"))
    assert all(scores[name] >= golden - 1.0 for name, golden in GOLDEN.items())
    run = read_run(demo.folder / "run.h5")
    assert set(run.frames) >= set(read_tracks_csv(truth)["frame"])
    assert all(source.source.kind == "video" and source.background for source in run.recording.sources)
    cameras = read_run(demo.folder / "run.h5").cameras
    for name in ("plan", "spacetime", "slices", "marginal", *(f"overlay_{camera}" for camera in cameras)):
        assert (demo.folder / "pictures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert (demo.folder / "report.html").read_text("utf-8").lstrip().lower().startswith("<!doctype html>")
    assert re.search(r"MODA \d+\.\d %", demo.said)
    listed = re.findall(r"^  (\S+) ", demo.said.partition("\nOpen\n")[2], re.MULTILINE)
    assert str(demo.folder / "report.html") in listed and all(Path(name).is_file() for name in listed)


def test_a_folder_with_files_in_it_is_left_alone(tmp_path: Path, refusal: Command) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    assert "--overwrite" in refusal("demo", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    assert main(["demo", str(tmp_path / "mine.txt")]) == 2
    assert (tmp_path / "mine.txt").read_text() == "precious"


@pytest.mark.slow
@pytest.mark.parametrize("model", ["chromatic", "codebook"])
def test_every_background_model_can_be_asked_for(demo: Demo, tmp_path: Path, model: str) -> None:
    rig, output = demo.folder / "scene" / "rig.toml", tmp_path / "run.h5"
    chosen = f"foreground.model={model}"
    assert main(["run", str(rig), "-o", str(output), "--frames", "0:12", "--set", chosen]) == 0
    assert len(read_run(output).trajectory) > 0


def test_tables_are_whole_in_a_pipe(run_path: Path, stdout: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    lines = stdout("inspect", run_path).splitlines()
    assert "run of 20" in next(line for line in lines if line.startswith("scene"))
    assert not any(line.endswith(" ") for line in lines)


def test_an_option_that_was_left_out_is_missing(refusal: Command) -> None:
    assert "command line: -o is missing; see stseg run --help" in refusal("run", "rig.toml")
    assert "found the name of a folder, 'pics/'" in refusal("report", "run.h5", "-o", "pics/")
    assert "--ouput is no option, and -o is missing" in refusal("run", "rig.toml", "--ouput", "run.h5")
    assert "-o needs a value" in refusal("run", "rig.toml", "-o")


POINTS = "camera,u,v,x,y\ncam1,10,40,0,0\ncam1,50,40,1,0\ncam1,30,30,0,1\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the command is called: a rig, a run, an empty run, a film and points."""
    (tmp_path / "other").mkdir()
    write_rig(tmp_path)
    write_rig(tmp_path / "other", "cam1", "cam9")
    write_small_run(tmp_path / "run.h5")
    write_empty_run(tmp_path / "other" / "empty.h5")
    for name in ("film.avi", "b.avi"):
        film(tmp_path / name, tmp_path / "plain.avi")
    (tmp_path / "points.csv").write_text(POINTS)
    (tmp_path / "cam1.xml").write_text("<!-- made by stseg -->")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@cases()
def test_options_are_refused(folder: Path, words: str, message: str, refusal: Command) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert message in refusal(*words.split())
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_pages_and_their_commands_hold_names_as_text(folder: Path) -> None:
    """Names of files are quoted for a shell, names of cameras for HTML; no page replaces what it shows."""
    (folder / "film.avi").rename(folder / "a film.avi")
    assert main(["calibrate", "page", "a film.avi", "--area", "0, 0,1,1", "-o", "page.html"]) == 0
    text = unescape((folder / "page.html").read_text())
    assert "'--area=0, 0,1,1'" in text and "--sources 'a film.avi'" in text
    write_rig(folder, 'name = "yard"', "name = '<b>'")
    with (folder / "rig.toml").open("a") as rig:
        rig.write(RIG[RIG.index("[[camera]]") :].replace("cam1", "<i>"))
    found = stseg.check_rig("rig.toml")
    assert found.frame == 2 and [len(view.pixel) for view in found.views if isinstance(view, stseg.Boxes)] == [0, 0]
    found.write_page(Path("check.html"))
    text = (folder / "check.html").read_text()
    assert "&lt;b&gt;" in text and "&lt;i&gt;" in text and "<b>" not in text and "<i>" not in text
    refused(OutputError, "a file that is read", found.write_page, Path("boxes.csv"), overwrite=True)


@cases()
def test_arrays_of_rigs_are_refused(ground: list[int], vertical: list[int], message: str) -> None:
    sizes, grid, arrays = [(64, 48)] * 2, Grid((0, 1), (0, 1)), (np.zeros(ground), np.zeros(vertical))
    refused(CalibrationError, message, Rig.from_homographies, *arrays, sizes, grid, 5.0)


@cases()
def test_lenses_are_refused(model: LensModel, focal: float, distortion: list[float], message: str) -> None:
    refused(CalibrationError, message, Lens, np.diag([focal, focal, 1.0]), np.array(distortion), model)
