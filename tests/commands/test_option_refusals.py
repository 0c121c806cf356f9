"""What commands refuse before they begin: the option, what was found, what was expected, in one line."""

from html import unescape
from pathlib import Path

import numpy as np
import pytest
from attacks import RIG, film, write_rig
from cases import cases
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


@cases()
def test_lenses_are_refused(model: LensModel, focal: float, distortion: list[float], message: str) -> None:
    refused(CalibrationError, message, Lens, np.diag([focal, focal, 1.0]), np.array(distortion), model)
