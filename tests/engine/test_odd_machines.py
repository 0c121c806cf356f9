"""Machines that are not as usual: no locks, little memory, a home that cannot be written, other users."""

import errno
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest
from attacks import write_rig
from checks import Captured, Command, compiled_only, in_ci
from recordings import COMMAND, OPTIONS, assert_same, process, track, write_recording
from run_files import write_small_run

from stseg import read_recording, read_run
from stseg.commands.main import main
from stseg.errors import printable
from stseg.io.outputs.whole_files import create_part, replacing
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.unfinished import part_file

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="a limit or a user of Linux")
pytestmark = compiled_only
AS_NOBODY = """
import codecs, json, os, sys
import stseg.commands.export, stseg.commands.inspect
from stseg.commands.main import main
for name in ("ascii", "latin-1", "utf-8-sig"):
    codecs.lookup(name)
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
for arguments in json.loads(sys.argv[1]):
    print("status", main(arguments), file=sys.stderr)
"""
"""Several commands. Imports come first: this user need not be able to read the libraries."""


@LINUX
def test_a_path_that_is_no_utf8_serves(tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9:1")
    folder.mkdir()
    rig, run = write_recording(folder), str(folder / "run.h5")
    assert main(["run", str(rig), "-o", run, *OPTIONS]) == 0
    assert read_run(Path(run)).provenance.rig_path == rig
    for to in ("csv", "parquet", "sqlite"):
        assert main(["export", run, "--to", to, "-o", f"{run}.{to}"]) == 0
    assert main(["export", run, "--to", "sqlite", "-o", str(tmp_path / "archive.sqlite")]) == 0
    assert main(["inspect", run]) == 0 and main(["report", run, "-o", f"{run}.html"]) == 0
    assert main(["export", run, "--to", "duckdb", "-o", f"{run}.duckdb"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"stseg: error: {printable(run)}.duckdb: found a path that is no UTF-8, expected one that is, for DuckDB"
    ]


@pytest.mark.parametrize("code", [errno.ENOLCK, *in_ci(errno.ENOSYS)])
def test_no_locks_are_no_harm(rig_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    assert track(rig_path, tmp_path / "locked.h5", "--frames", "0:8") == 0
    opened = h5py.File.__init__

    def without_locks(file: h5py.File, *arguments: Any, locking: bool | None = None, **options: Any) -> None:
        if locking is not False and isinstance(arguments[0], (str, Path)):
            raise OSError(code, "Unable to synchronously open file (unable to lock file)")
        opened(file, *arguments, locking=locking, **options)

    def refused(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(h5py.File, "__init__", without_locks)
    monkeypatch.setattr(part_file, "flock", refused)
    assert track(rig_path, tmp_path / "run.h5", "--frames", "0:8") == 0
    (tmp_path / "answers.csv").write_text("action,frame,id,other,name\nname,,1,,Ann\n")
    for arguments in (("export", "--to", "csv"), ("correct", str(tmp_path / "answers.csv"))):
        command, *more = arguments
        assert main([command, str(tmp_path / "run.h5"), *more, "-o", str(tmp_path / command)]) == 0
    monkeypatch.undo()
    assert_same(tmp_path / "run.h5", tmp_path / "locked.h5")


@LINUX
@pytest.mark.parametrize("mebibytes", [200, 1000])
def test_too_little_address_space_is_one_line(tmp_path: Path, mebibytes: int) -> None:
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({mebibytes << 20},) * 2);"
    done = process(limit + COMMAND, "run", write_rig(tmp_path), "-o", tmp_path / "run.h5")
    said = f"stseg: error: limit of address space (ulimit -v): found {mebibytes} MiB, expected 2048 MiB or more\n"
    assert (done.returncode, done.stderr) == (2, said)


@pytest.mark.slow
@LINUX
def test_a_home_that_cannot_be_written_serves(tmp_path: Path) -> None:
    run = write_small_run(tmp_path / "run.h5")
    for arguments in (("export", run, "--to", "csv", "-o", tmp_path / "t.csv"), ("report", run, "-o", tmp_path / "r")):
        done = process(COMMAND, *arguments, HOME="/proc/nowhere", XDG_CACHE_HOME="", NUMBA_CACHE_DIR="")
        assert (done.returncode, done.stderr) == (0, "")


@pytest.fixture
def shared() -> Iterator[Path]:
    """A folder that everybody may enter, and in which everybody may write into `open`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "open").mkdir()
        folder.chmod(0o755)
        (folder / "open").chmod(0o1777)
        yield folder


def content_of(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {str(path): (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()}


@LINUX
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can become another user")
def test_files_of_another_user_are_left_alone(shared: Path, stdout: Command) -> None:
    run = write_small_run(shared / "run.h5")
    stdout("export", run, "--to", "csv", "-o", shared / "open" / "t.csv")
    secret = write_small_run(shared / "secret.h5")
    secret.chmod(0o600)
    before = content_of(shared)
    tried = {
        f"export {run} --to csv -o {shared}/t.csv": "Permission denied",
        f"export {run} --to csv -o {shared}/open/t.csv --overwrite": "not permitted",
        f"inspect {secret}": f"{secret}: found a file that this user may not read",
    }
    lines = process(AS_NOBODY, json.dumps([command.split() for command in tried])).stderr.splitlines()
    assert lines[1::2] == ["status 2"] * len(tried), "\n".join(lines)
    assert all(what in line for line, what in zip(lines[::2], tried.values(), strict=True)), "\n".join(lines)
    assert content_of(shared) == before


@pytest.mark.parametrize("seconds", [-1e11, 0.0, 4e9, 253402300800.0, 1e12])
def test_any_time_of_change_is_told(tmp_path: Path, seconds: float) -> None:
    recording = read_recording(write_rig(tmp_path))
    provenance = gather_provenance(recording, "")
    provenance.sources["modified"] = seconds
    assert all("bytes in all, written" in text for text in run_request(recording, provenance)["source"].values())


def test_parts_of_a_later_clock_are_removed(tmp_path: Path) -> None:
    parts = []
    for hours in (-2, 0, 2):
        part, descriptor = create_part(tmp_path / "t.csv")
        os.close(descriptor)
        os.utime(part, (time.time() + 3600 * hours,) * 2)
        parts.append(part)
    with replacing(tmp_path / "t.csv", overwrite=False) as written:
        written.write_text("new")
    assert [part.exists() for part in parts] == [False, True, False]
