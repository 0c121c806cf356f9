"""Faults of the system: every file-system call of a run fails once, or is the last before a kill; nothing is lost.

The run is a real one in a child process. A wrapper counts its calls of the system that write (open, write, fsync,
rename, link, mkdir, unlink) and makes the n-th fail, write half, or kill the process. Afterwards the old output stands,
or the new one whole; and the same command without faults gives the same datasets, bit for bit.
"""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from recordings import OPTIONS, assert_same, write_recording

from stseg.accelerate import python_form
from stseg.detection.scoring import set_score

ROOT = Path(__file__).parents[1]
SHORT = ("--frames", "0:12", "--set", "segments.length=0.6", "--set", "segments.warm_up=0.2")
"""Two segments."""
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="needs /proc"),
    pytest.mark.skipif(python_form(set_score) is set_score, reason="too slow without a compiler"),
]

DRIVER = """
import io, json, os, signal, sys
from stseg.commands.main import main
import stseg.commands.run, stseg.engine.track, h5py, cv2

def ours(arguments):
    for one in arguments:
        if isinstance(one, (str, bytes, os.PathLike)):
            if os.path.abspath(os.fsdecode(one)).startswith(folder):
                return True
        elif isinstance(one, int) and one > 2:
            try:
                return os.readlink(f"/proc/self/fd/{one}").startswith(folder)
            except OSError:
                return False
    return False

def strike(name, before, half):
    calls.append(name)
    if len(calls) - 1 != at:
        return before()
    if fault == "kill after":
        (half or before)()
    if fault.startswith("kill"):
        os.kill(os.getpid(), signal.SIGKILL)
    if fault.isdigit():
        raise OSError(int(fault), os.strerror(int(fault)))
    return half() if half and fault == "short" else before()

def wrapped(name, call):
    def stand_in(*arguments, **options):
        if not ours(arguments[:2]):
            return call(*arguments, **options)
        return strike(name, lambda: call(*arguments, **options), None)
    return stand_in

class File(io.FileIO):
    def write(self, data):
        whole = super().write
        if not ours((self.fileno(),)):
            return whole(data)
        return strike("write", lambda: whole(data), lambda: whole(memoryview(data)[: (len(data) + 1) // 2]))

def fdopen(descriptor, mode="r", buffering=-1, *rest, **options):
    if buffering == 0:
        return File(descriptor, mode.replace("b", ""))
    return real_fdopen(descriptor, mode, buffering, *rest, **options)

real_fdopen = os.fdopen
for line in sys.stdin:
    fault, at, folder, log, arguments = json.loads(line)
    calls, child = [], os.fork()
    if child == 0:
        os.fdopen = fdopen
        os.dup2(os.open(log + ".err", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        os.dup2(2, 1)
        for name in ("open", "fsync", "rename", "replace", "link", "mkdir", "unlink", "rmdir"):
            setattr(os, name, wrapped(name, getattr(os, name)))
        status = main(arguments)
        with io.open(log, "w") as file:
            json.dump(calls, file)
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@dataclass(frozen=True)
class Trial:
    """A finished run: its status, what it printed, and the calls of the system that it made."""

    status: int
    messages: str
    calls: tuple[str, ...]


class Driver:
    """A process that has everything imported, and forks a run for each trial."""

    def __init__(self, rig: Path, scratch: Path) -> None:
        self._rig, self._log = rig, scratch / "calls.json"
        self._process = subprocess.Popen(
            [sys.executable, "-c", DRIVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )  # fmt: skip

    def run(self, output: Path, fault: str = "none", at: int = -1, *more: str) -> Trial:
        """A run whose call number `at` fails."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._log.unlink(missing_ok=True)
        arguments = ["run", str(self._rig), "-o", str(output), *OPTIONS, *SHORT, *more]
        self._process.stdin.write(json.dumps([fault, at, str(output.parent), str(self._log), arguments]) + "\n")
        self._process.stdin.flush()
        status = int(self._process.stdout.readline())
        calls = json.loads(self._log.read_text()) if self._log.exists() else []
        return Trial(status, Path(f"{self._log}.err").read_text(), tuple(calls))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    folder = tmp_path_factory.mktemp("recording")
    own = Driver(write_recording(folder), folder)
    yield own
    own.close()


@dataclass(frozen=True)
class Whole:
    """A run without faults: its file, and the calls that it made."""

    output: Path
    calls: tuple[str, ...]


@pytest.fixture(scope="module")
def whole(driver: Driver, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    output = tmp_path_factory.mktemp("whole") / "out" / "run.h5"
    output.parent.mkdir()
    done = driver.run(output)
    assert done.status == 0, done.messages
    return Whole(output, done.calls)


def places(calls: tuple[str, ...], fault: str) -> list[int]:
    """Calls to fail: each kind's first and last; killed, every step from the last write on."""
    chosen = set()
    for kind in dict.fromkeys(calls):
        own = [place for place, call in enumerate(calls) if call == kind]
        chosen |= {own[0], own[-1]}
    if fault.startswith("kill"):
        chosen |= set(range(max(place for place, call in enumerate(calls) if call == "write"), len(calls)))
    if fault == "short":
        chosen = {place for place in chosen if calls[place] == "write"}
    return sorted(chosen)


@pytest.mark.parametrize("fault", ["kill", "kill after", "short", *map(str, (errno.ENOSPC, errno.EIO, errno.EACCES))])
def test_no_fault_loses_anything(driver: Driver, whole: Whole, tmp_path: Path, fault: str) -> None:
    for at in places(whole.calls, fault):
        output, call = tmp_path / str(at) / "run.h5", f"call {at}, {whole.calls[at]}"
        output.parent.mkdir()
        faulty = driver.run(output, fault, at)
        assert "Traceback" not in faulty.messages, f"{call}: {faulty.messages}"
        if faulty.status > 0:
            assert (faulty.status, "stseg: error: " in faulty.messages) == (2, True), f"{call}: {faulty.messages}"
        if output.exists():
            assert_same(output, whole.output)
        if faulty.status != 0:
            finished = output.exists() and not Path(f"{output}.segments").exists()
            again = driver.run(output)  # a run that was finished is refused as any other output that exists
            assert again.status == (2 if finished else 0), f"{call}: {again.messages}"
            assert_same(output, whole.output)
            left = {path.name for path in output.parent.iterdir()}
            assert left == {"run.h5"}, f"{call}: {left}"
