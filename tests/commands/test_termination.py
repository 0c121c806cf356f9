"""Signals end a command within two seconds, whatever it is doing."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from checks import cases

from stseg.kernels.accelerate import COMPILED

_PROGRAM = """
import ctypes
import sys
import threading
import time
import numpy as np
import stseg.commands.inspect
from stseg.kernels.accelerate import kernel
from stseg.commands.main import command
from stseg.engine.stopping import stop_asked

@kernel
def spin(count):
    total = 0
    for i in range(count):
        total += i % 7 ^ total
    return total

def in_a_kernel():
    begun()
    spin(1 << 60)

def compiling():
    lines = [f"    x{i % 40} = x{(i * 7) % 40} * {i}.5 + np.sin(x{(i * 3) % 40} + {i})" for i in range(4000)]
    names = ", ".join(f"x{i}" for i in range(40))
    source = f"def long({names}):\\n" + "\\n".join(lines) + f"\\n    return {' + '.join(names.split(', '))}"
    scope = {"np": np}
    exec(source, scope)
    import numba
    begun()
    numba.njit(scope["long"])(*map(float, range(40)))

def ending_slowly():
    try:
        begun()
        time.sleep(60)
    finally:
        time.sleep(60)

def refusing_to_end():
    begun()
    while True:
        try:
            time.sleep(60)
        except KeyboardInterrupt:
            pass

def calling_back():
    callback = ctypes.CFUNCTYPE(None)(lambda: (begun(), time.sleep(60)))
    while True:
        callback()

def going_on_after_a_callback():
    ctypes.CFUNCTYPE(None)(lambda: (begun(), time.sleep(60)))()
    time.sleep(0.5)
    sys.exit()

def failing_of_it():
    ctypes.CFUNCTYPE(None)(lambda: (begun(), time.sleep(60)))()
    raise RuntimeError("the compiler lost its way")

def leaving_a_thread():
    threading.Thread(target=time.sleep, args=(60,)).start()
    begun()
    time.sleep(60)

def writing_a_run(path="part.h5"):
    from pathlib import Path
    from stseg.io.runfile.unfinished.part_file import PartFile
    part = PartFile(Path(path))
    with part.step():
        begun()
        spin(1 << 60)

def following():
    with stop_asked() as halt:
        begun()
        spin(1 << 34)
        time.sleep(60)

def begun():
    print("begun", flush=True)

spin(1)
what = globals()[sys.argv[1]]
stseg.commands.inspect.read_run = lambda _: what()
sys.argv[1:] = ["inspect", "run.h5"]
command()
"""
_SECONDS = 3.0
"""Two, on a machine that is busy."""


@contextmanager
def command(folder: Path, what: str) -> Iterator[subprocess.Popen[str]]:
    """A command that is at work on something."""
    program = folder / "busy.py"
    program.write_text(_PROGRAM, "utf-8")
    with subprocess.Popen(
        [sys.executable, str(program), what], cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        try:
            assert running.stdout is not None and running.stderr is not None
            assert running.stdout.readline() == "begun\n", running.stderr.read()
            yield running
        finally:
            running.kill()


def ended_by(running: subprocess.Popen[str], number: signal.Signals) -> tuple[int, str]:
    """Exit status of a command that a signal ends in time, and the last of its standard error."""
    start = time.monotonic()
    running.send_signal(number)
    status = running.wait(20)
    assert time.monotonic() - start < _SECONDS and running.stderr is not None
    return status, running.stderr.read().strip()


compiled = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")


@cases()
def test_a_signal_ends_a_command_in_time(what: str, sent: str, status: int, line: str, tmp_path: Path) -> None:
    if not COMPILED and what in ("in_a_kernel", "compiling", "writing_a_run"):
        pytest.skip("nothing is compiled")
    with command(tmp_path, what) as running:
        assert ended_by(running, signal.Signals[sent]) == (status, line)


@compiled
def test_a_run_that_goes_on_is_asked_first_and_ended_then(tmp_path: Path) -> None:
    with command(tmp_path, "following") as running:
        start = time.monotonic()
        running.send_signal(signal.SIGINT)
        assert running.stderr is not None
        first = running.stderr.readline()
        assert first == "stseg: finishing; once more to stop at once\n", first + running.stderr.read()
        assert time.monotonic() - start < _SECONDS
        assert ended_by(running, signal.SIGINT) == (130, "stseg: interrupted")
