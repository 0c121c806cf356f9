"""No file of others is deleted, overwritten or trusted (findings F2, F3, F14 and F20)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from attacks import RIG, refusal, write_rig
from run_files import write_small_run

from stseg.commands.main import main
from stseg.errors import InputError
from stseg.io.recording.rigs import parse_rig, read_recording
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.io.untrusted.values import is_name


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return write_small_run(tmp_path / "run" / "night.h5")


@pytest.mark.parametrize("name", ["..", ".", "a/b", "a\\b", "a\0b", "", " a", "x" * 200, "\x1b[31m", "\u202e", "a\nb"])
def test_names_that_are_no_names_of_files_are_refused(name: str) -> None:
    assert not is_name(name)
    with pytest.raises(InputError):
        parse_rig(RIG.replace('"cam1"', json.dumps(name)), Path("rig.toml"))


@pytest.mark.parametrize("name", ["cam 1", "Ω", "2026-01-01T10:30:00", "<script>", "a.b"])
def test_unusual_names_work(name: str) -> None:
    assert parse_rig(RIG.replace('"cam1"', json.dumps(name)), Path("rig.toml")).rig.cameras[0].name == name


def test_a_foreign_folder_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig, folder = write_rig(tmp_path), tmp_path / "q.h5.segments"
    folder.mkdir()
    for name in ("thesis.txt", "begun.json", "segment-00000.h5"):
        (folder / name).write_text("precious")
    for more in ((), ("--frames", "5:3"), ("--overwrite",)):
        assert "did not make" in refusal(capsys, "run", rig, "-o", tmp_path / "q.h5", *more)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(
        ("thesis.txt", "begun.json", "segment-00000.h5"), "precious"
    )


def test_a_work_folder_that_is_a_link_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "else").mkdir()
    with WorkFolder(tmp_path / "else" / "q.h5", {}) as work:
        (tmp_path / "q.h5.segments").symlink_to(work.path)
        refusal(capsys, "run", write_rig(tmp_path), "-o", tmp_path / "q.h5")
        assert work.begun


def test_our_folder_keeps_files_that_are_not_ours(tmp_path: Path) -> None:
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").write_text("precious")
        work.remove()
    assert (tmp_path / "q.h5.segments" / "thesis.txt").read_text() == "precious"
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").unlink()
        work.remove()
    assert not (tmp_path / "q.h5.segments").exists()


def test_links_and_files_beside_an_output_are_not_written_to(run_file: Path) -> None:
    target, link, plain = (run_file.with_name(name) for name in ("target", "t.csv.part", "u.csv.part"))
    target.write_text("precious")
    plain.write_text("precious")
    link.symlink_to(target)
    for name in ("t.csv", "u.csv"):
        assert main(["export", str(run_file), "--to", "csv", "-o", str(run_file.with_name(name))]) == 0
    assert (target.read_text(), plain.read_text(), link.is_symlink()) == ("precious", "precious", True)
    assert not run_file.with_name("t.csv").is_symlink()


@pytest.mark.parametrize("content", ["", "[]", "1", "null", "[" * 100_000, '{"config": []}', "\xff"])
def test_notes_of_another_form_are_refused(tmp_path: Path, content: str) -> None:
    with WorkFolder(tmp_path / "q.h5", {"config": {"a": 1}}) as work:
        (work.path / "begun.json").write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match="delete the folder"), WorkFolder(tmp_path / "q.h5", {"config": {"a": 1}}):
        pass


def test_damaged_time_stamps_are_made_anew(tmp_path: Path) -> None:
    recording = read_recording(write_rig(tmp_path))
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        from stseg.io.recording.aligned_stream import index_streams

        work.keep_streams(index_streams(recording))
        path = work.path / "streams.npz"
        whole = path.read_bytes()
        kept = work.streams(recording)
        assert kept is not None
        assert kept.length == 4
        path.write_bytes(b"")
        assert work.streams(recording) is None
        for place in range(0, len(whole), 3):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << place % 8
            path.write_bytes(damaged)
            found = work.streams(recording)
            assert found is None or found.length == 4


def test_a_recording_that_changed_in_place_is_noticed(tmp_path: Path) -> None:
    from stseg.io.runfile.provenance import gather_provenance, run_request

    recording, path = read_recording(write_rig(tmp_path)), tmp_path / "boxes.csv"
    before, state = run_request(recording, gather_provenance(recording, "")), path.stat()
    path.write_text(path.read_text().replace("3,11", "3,12"))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert run_request(recording, gather_provenance(recording, "")) != before


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of file sizes that can be set")
@pytest.mark.parametrize("to", ["sqlite", "duckdb", "jupedsim", "csv"])
def test_a_limit_of_file_sizes_is_one_line(run_file: Path, to: str) -> None:
    """F19: SQLite reports a disk error of its own kind."""
    if to == "duckdb":
        pytest.importorskip("duckdb")
    program = (
        "import resource, signal, sys; from stseg.commands.main import main;"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100));"
        f"sys.exit(main(['export', {str(run_file)!r}, '--to', {to!r}, '-o', {str(run_file.with_name('out'))!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert done.stderr.startswith("stseg: error: ")
    assert sorted(path.name for path in run_file.parent.iterdir()) == ["left.avi", "night.h5"]
