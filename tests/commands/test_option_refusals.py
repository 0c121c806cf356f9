"""What commands refuse before they begin: the option, what was found, what was expected, in one line."""

from html import unescape
from pathlib import Path

import numpy as np
import pytest
from attacks import RIG, film, write_rig
from refusals import Command, refused
from run_files import write_empty_run, write_small_run

import stseg
from stseg.arrays import Floats
from stseg.commands.main import main
from stseg.errors import CalibrationError, OutputError
from stseg.geometry import Grid, Lens, Rig
from stseg.geometry.lens import LensModel

POINTS = "camera,u,v,x,y\ncam1,10,40,0,0\ncam1,50,40,1,0\ncam1,30,30,0,1\n"
SCENE = "--size=64,48 --area=0,0,1,1 --frame-rate=5 -o q.toml"


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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (f"calibrate import opencvv a.txt {SCENE}", "FORMAT: found 'opencvv', expected one of"),
        ("calibrate page film.avi film.avi --area=0,0,1,1 -o q.html", "VIDEO: found film.avi, film.avi"),
        ("calibrate page film.avi --frame 99 --area=0,0,1,1 -o q.html", "--frame: found 99, expected a frame of the"),
        ("calibrate align rig.toml points.csv -o q.toml --metres-per-pixel 0", "--metres-per-pixel: found 0"),
        ("calibrate align rig.toml points.csv -o q.toml --metres-per-pixel nan", "--metres-per-pixel: found nan"),
        ("calibrate align rig.toml other/rig.toml -o q.toml", "camera: found cam9, expected a camera of the same name"),
        ("calibrate auto film.avi b.avi --background cam1.xml -o cam1.xml --frame-rate=5 --overwrite", "file that is"),
        ("calibrate check rig.toml", "rig.toml: camera: found one camera, expected two or more"),
        ("calibrate check rig.toml --frames 5:3", "--frames: found '5:3'"),
        ("calibrate check rig.toml --frames 4:9", "--frames: found 4:9, expected a part of the recording"),
        ("calibrate check rig.toml -o boxes.csv --overwrite", "boxes.csv: found a file that is read here"),
        (f"calibrate points points.csv --lens {{name}}.xml {SCENE[:-6]}cam1.xml --overwrite", "a file that is read"),
        ("detect rig.toml -o other --score 2", "--score: found 2, expected a number of 0..1"),
        ("inspect rig.toml --json", "--json: found rig.toml, expected a run file"),
        ("inspect rig.toml --slice z=1", "--slice: found rig.toml, expected a run file"),
        ("inspect other/empty.h5 --slice frame=1,plane=all -o q.png", "expected a run with frames"),
        ("review run.h5 -o q.html --most 0", "--most: found 0, expected 1 or more questions"),
        ("run rig.toml -o q.h5 --publish http://127.0.0.1:1", "--publish: found that alone"),
        ("run rig.toml -o q.h5 --follow --publish ftp://u:word@h", "--publish: found 'ftp://u:***@h', expected"),
        ("\x1b[31m", r"command line: found '\x1b[31m', expected one of"),
        ("plan rig.toml --set kalman.patience=3", "kalman.patience: found a value without effect: 3.0"),
    ],
)  # fmt: skip
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
    found.write_page(Path("check.html"))
    text = (folder / "check.html").read_text()
    assert (
        "&lt;b&gt;" in text and "&lt;i&gt;" in text and not {"<b>", "<i>"} & {text[k : k + 3] for k in range(len(text))}
    )
    refused(OutputError, "a file that is read", found.write_page, Path("boxes.csv"), overwrite=True)


@pytest.mark.parametrize(
    ("ground", "vertical", "message"),
    [
        (np.zeros((1, 3, 3)), np.zeros((2, 3)), r"found arrays of \(1, 3, 3\) and \(2, 3\) for 2 cameras"),
        (np.zeros((2, 3, 3)), np.zeros((2, 4)), r"found arrays of \(2, 3, 3\) and \(2, 4\) for 2 cameras"),
    ],
)
def test_arrays_of_rigs_are_refused(ground: Floats, vertical: Floats, message: str) -> None:
    sizes, grid = [(64, 48)] * 2, Grid((0, 1), (0, 1))
    refused(CalibrationError, message, Rig.from_homographies, ground, vertical, sizes, grid, 5.0)


@pytest.mark.parametrize(
    ("model", "focal", "distortion", "message"),
    [
        ("fish", 50.0, [0.1], "lens: model: found 'fish', expected one of pinhole, fisheye"),
        ("fisheye", 50.0, [0.1, 0.1, 0.1, 0.1, 0.1], "distortion: found 5 coefficients, expected at most 4"),
        ("pinhole", 50.0, [np.nan], r"distortion: found \[nan\], expected at most 8, finite"),
        ("pinhole", np.nan, [], "matrix: found .*, expected a camera matrix"),
    ],
)
def test_lenses_are_refused(model: LensModel, focal: float, distortion: list[float], message: str) -> None:
    refused(CalibrationError, message, Lens, np.diag([focal, focal, 1.0]), np.array(distortion), model)
