"""Signals are answered within two seconds, also while a kernel is at work."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stseg.accelerate import COMPILED

_BUSY = """
import sys
import numpy as np
import stseg.commands.inspect
from stseg.accelerate import kernel
from stseg.commands.main import main

@kernel
def spin(count):
    total = 0
    for i in range(count):
        total += i % 7 ^ total
    return total

spin(1)
def busy(_):
    print("busy", flush=True)
    spin(1 << 60)
stseg.commands.inspect.read_run = busy
sys.exit(main(["inspect", "run.h5"]))
"""


@pytest.mark.skipif(not COMPILED, reason="Python without a compiler comes to its handlers by itself")
@pytest.mark.parametrize(
    ("number", "status", "line"),
    [(signal.SIGTERM, 143, "stseg: terminated"), (signal.SIGINT, 130, "stseg: interrupted")],
)
def test_a_kernel_does_not_delay_an_end(number: signal.Signals, status: int, line: str, tmp_path: Path) -> None:
    program = tmp_path / "busy.py"
    program.write_text(_BUSY, "utf-8")
    command = [sys.executable, str(program)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None and running.stderr is not None
        assert running.stdout.readline() == "busy\n", running.stderr.read()
        start = time.monotonic()
        running.send_signal(number)
        try:
            assert running.wait(20) == status
        finally:
            running.kill()
        assert time.monotonic() - start < 4.0  # two seconds, on a machine that is busy
        assert running.stderr.read().strip() == line
