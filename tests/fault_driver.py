"""A run in a child process whose calls of the system fail, write half, or are its last.

A wrapper counts the calls that write (open, write, fsync, rename, link, mkdir, unlink) and lets one of them fail, or
kills the process. `tests/attacks/test_faults.py` tries some calls, `tools/faults.py` all.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from recordings import ALONE, OPTIONS

ROOT = Path(__file__).parents[1]
SHORT = ("--frames", "0:12", "--set", "segments.length=0.6", "--set", "segments.warm_up=0.2")
"""Two segments."""

DRIVER = """
import io, json, os, signal, sys, threading
from stseg.commands.main import main
import stseg.commands.calibrate.app, stseg.commands.correct, stseg.commands.export, stseg.commands.labels
import stseg.commands.report, stseg.commands.run, stseg.engine.live.following, stseg.engine.track, h5py, cv2

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
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
for line in sys.stdin:
    fault, at, folder, log, arguments, after = json.loads(line)
    calls = []
    if fault == "warm":
        print(main(arguments), flush=True, file=answers)
        continue
    child = os.fork()
    if child == 0:
        if after is not None:
            threading.Timer(after, os.kill, (os.getpid(), signal.SIGKILL)).start()
        os.fdopen = fdopen
        os.environ["STSEG_TRIAL"] = folder
        os.dup2(os.open(log + ".err", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        os.dup2(2, 1)
        for name in ("open", "fsync", "rename", "replace", "link", "mkdir", "unlink", "rmdir"):
            setattr(os, name, wrapped(name, getattr(os, name)))
        status = main(arguments)
        with io.open(log, "w") as file:
            json.dump(calls, file)
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True, file=answers)
"""


@dataclass(frozen=True)
class Trial:
    """A finished run: its status, what it printed, and the calls of the system that it made."""

    status: int
    messages: str
    calls: tuple[str, ...]


class Driver:
    """A process that has everything imported and all kernels loaded, and forks a run for each trial."""

    def __init__(self, rig: Path, scratch: Path) -> None:
        self._rig, self._log = rig, scratch / "calls.json"
        self._process = subprocess.Popen(
            [sys.executable, "-c", DRIVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        (scratch / "warm").mkdir()
        self.run(scratch / "warm" / "run.h5", "warm")

    def run(
        self, output: Path, fault: str = "none", at: int = -1, after: float | None = None, words: Sequence[str] = ()
    ) -> Trial:
        """A run, or another command, whose call number `at` fails, or that is killed after some seconds."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._log.unlink(missing_ok=True)
        Path(f"{self._log}.err").touch()
        arguments = [*(words or ["run", str(self._rig), *OPTIONS, *SHORT, *ALONE]), "-o", str(output)]
        self._process.stdin.write(json.dumps([fault, at, str(output.parent), str(self._log), arguments, after]) + "\n")
        self._process.stdin.flush()
        status = int(self._process.stdout.readline())
        calls = json.loads(self._log.read_text()) if status >= 0 and self._log.exists() else []
        return Trial(status, Path(f"{self._log}.err").read_text(), tuple(calls))

    def close(self) -> None:
        self._process.communicate()
