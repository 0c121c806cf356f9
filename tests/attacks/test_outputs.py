"""Outputs replace neither inputs nor what stseg did not make: every command, with each of its files as its output."""

import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import Captured, Command, tables
from run_files import small_recording, write_small_run

from stseg.commands.main import main
from stseg.commands.terminal import standard_error
from stseg.io.exports.archive import ARCHIVES
from stseg.io.exports.formats import FORMATS
from stseg.io.recording.rig_text import format_rig
from stseg.io.runfile.reading.run_reader import Run

TABLES = tables(Path(__file__).with_suffix(".toml"))
COMMANDS = TABLES["commands"]
"""Commands without their output, and their inputs."""


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run file, in the current folder."""
    monkeypatch.chdir(tmp_path)
    write_small_run(tmp_path / "run.h5")
    return tmp_path


@pytest.fixture
def folder(run_folder: Path, rig_path: Path) -> Path:
    """Inputs of all commands."""
    shutil.copytree(rig_path.parent, run_folder, dirs_exist_ok=True)
    write_small_run(run_folder / "more.h5")
    Path("truth.csv").write_text("frame,id,x,y\n11,1,0.2,0.2\n")
    Path("names.csv").write_text("id,name\n1,Ada\n")
    Path("answers.csv").write_text("action,track,other,frame,name\nname,1,,,Ada\n")
    for name in ("right.avi", "points.csv", "lens.xml"):
        Path(name).write_text("precious")
    for name in ("photo.png", "plan.png"):
        cv2.imwrite(name, np.zeros((48, 64, 3), np.uint8))
    return run_folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_keep_inputs(folder: Path, refusal: Command, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """By name, by another name of the same file, and through a link; be it ours or not."""
    monkeypatch.setattr("stseg.io.outputs.whole_files._is_ours", lambda *_: True)
    for name in COMMANDS[command]:
        os.link(name, "hard.mp4")
        Path("soft.mp4").symlink_to(name)
        before = contents(folder)
        for output in (name, "hard.mp4", "soft.mp4"):
            if "--video" not in command or output != name:
                said = refusal(*command.split(), output, "--overwrite")
                assert output in said and "a file that is read here" in said
        assert contents(folder) == before
        Path("hard.mp4").unlink()
        Path("soft.mp4").unlink()


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.usefixtures("folder")
def test_commands_keep_what_stseg_did_not_make(refusal: Command, command: str) -> None:
    Path("old.mp4").write_text("precious")
    assert "a file that exists, expected a new name, or --over" in refusal(*command.split(), "old.mp4")
    assert "a file that stseg did not make" in refusal(*command.split(), "old.mp4", "--overwrite")
    assert Path("old.mp4").read_text() == "precious"


def test_pictures_and_tables_replace_nothing_foreign(folder: Path, refusal: Command) -> None:
    Path("west.png").write_bytes(Path("photo.png").read_bytes())
    Path("zones.csv").write_text("zone,mine\n")
    Path("plan.png").write_bytes(b"precious")
    before = contents(folder)
    for command in TABLES["pictures_and_tables"]:
        refusal(*command.split(), "--overwrite")
    Path("small.toml").write_text(format_rig(small_recording(folder), folder / "small.toml"))
    assert ".: found files in it" in refusal(*["run", "small.toml", "-o", "new.h5", "--labels", "."])
    assert before.items() <= contents(folder).items() and not Path("new.h5").exists()


@pytest.mark.parametrize("to", [*FORMATS, *ARCHIVES])
@pytest.mark.usefixtures("run_folder")
def test_an_export_is_replaced_by_its_like_alone(refusal: Command, to: str) -> None:
    command = ("export", "run.h5", "--to", to, "-o", "out")
    Path("out").write_text("frame,left,top,width,height\n0,1,2,3,4\n")
    assert "did not make" in refusal(*command, "--overwrite")
    Path("out").unlink()
    assert main([*command]) == main([*command, "--overwrite"]) == 0


@pytest.mark.parametrize("to", [*FORMATS, *ARCHIVES])
@pytest.mark.usefixtures("run_folder")
@pytest.mark.parametrize("lost", [120, 1 << 30])
def test_an_export_that_lost_rows_is_not_published(
    refusal: Command, monkeypatch: pytest.MonkeyPatch, to: str, lost: int
) -> None:
    """As by a disk that is full and says nothing."""

    def cut(path: Path | str) -> None:
        Path(path).write_bytes(Path(path).read_bytes()[:-lost])

    if to in ARCHIVES:
        library, before = pytest.importorskip({"sqlite": "sqlite3"}.get(to, to)), iter((Path, cut))  # written, read
        opened = library.connect
        monkeypatch.setattr(library, "connect", lambda path, **keys: [next(before)(path), opened(path, **keys)][1])
    else:
        form = FORMATS[to]

        def write(path: Path, run: Run) -> None:
            form.write(path, run)
            cut(path)

        monkeypatch.setitem(FORMATS, to, replace(form, write=write))
    assert "out" in refusal("export", "run.h5", "--to", to, "-o", "out")
    assert not Path("out").exists()


@pytest.mark.parametrize("words", ["evaluate tracks.csv tracks.csv", "inspect run.h5", "report run.h5 -o page.html"])
def test_work_shows_on_a_terminal(folder: Path, words: str, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "tracks.csv").write_text("frame,id,x,y\n11,1,0.2,0.2\n")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(standard_error, "_PATIENCE", 0.0)
    main(words.split())
    assert "at work" in capsys.readouterr().err
