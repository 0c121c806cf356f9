"""Runs targets on mutated files, each target in a process of its own that may crash, hang or grow."""

import mmap
import os
import resource
import signal
import struct
import tempfile
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fuzz.targets import Target, answer

SECONDS = 10.0
"""Longest CPU time that one file may take."""
WAIT = 120.0
"""Longest time that one file may take where nothing is computed: the machine may have other work."""
MEBI = 2048
"""Most memory that a process may hold."""


@dataclass(frozen=True)
class Failure:
    """A file that a target did not answer rightly."""

    target: str
    seed: int
    reason: str


def content(target: Target, valid: bytes, seed: int) -> bytes:
    """The mutated file of a seed."""
    return target.mutate(valid, np.random.default_rng((seed, len(target.name), *target.name.encode())))


def fuzz(target: Target, first: int, until: float, most: int, ends: bool = False) -> tuple[int, list[Failure]]:
    """Seeds from `first` on, until a time or number, or a failure where it `ends`; how many, and what failed."""
    failures: list[Failure] = []
    seed, stop = first, first + most
    while seed < stop and time.monotonic() < until and not (ends and failures):
        seed, failure = until_failure(target, seed, until, stop)
        if failure is not None:
            failures.append(failure)
            seed += 1
    return seed - first, failures


def until_failure(target: Target, first: int, until: float, stop: int) -> tuple[int, Failure | None]:
    """A child process works on seeds until one fails; the seed that it came to."""
    shared = mmap.mmap(-1, 4096)
    shared[:16] = struct.pack("<qd", first, time.monotonic())
    child = os.fork()
    if child == 0:
        os._exit(_work(target, first, until, stop, shared))
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        seed, since = struct.unpack("<qd", shared[:16])
        if done:
            if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGPROF:
                return seed, Failure(target.name, seed, f"more than {SECONDS:g} s")
            if os.WIFSIGNALED(status):
                return seed, Failure(target.name, seed, f"signal {os.WTERMSIG(status)}")
            if os.WEXITSTATUS(status):
                return seed, Failure(target.name, seed, bytes(shared[16:]).rstrip(b"\0").decode(errors="replace"))
            return seed, None
        if time.monotonic() - since > WAIT:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return seed, Failure(target.name, seed, f"nothing for {WAIT:g} s")
        time.sleep(0.01)


def _work(target: Target, first: int, until: float, stop: int, shared: mmap.mmap) -> int:
    """What the child does; its status."""
    try:
        with tempfile.TemporaryDirectory() as name:
            valid = target.valid(Path(name))
            _one(target, Path(name) / f"valid{target.suffix}", valid)
            for seed in range(first, stop):
                shared[:16] = struct.pack("<qd", seed, time.monotonic())
                if time.monotonic() > until:
                    return 0
                if "FUZZ_ANSWERS" in os.environ:  # `tools/mutants.py` notes it
                    os.environ["PYTEST_CURRENT_TEST"] = f"{target.name} {seed}"
                signal.setitimer(signal.ITIMER_PROF, SECONDS)
                _one(target, Path(name) / f"fuzzed{target.suffix}", content(target, valid, seed), valid)
            shared[:8] = struct.pack("<q", stop)
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {str(error)[:300]} at {place.filename}:{place.lineno}"
        shared[16 : 16 + len(text.encode())] = text.encode()
        return 1
    return 0


def _one(target: Target, path: Path, data: bytes, valid: bytes | None = None) -> None:
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = answer(target, path, valid or data)
    if answers := os.environ.get("FUZZ_ANSWERS"):
        with Path(answers).open("a") as file:
            print(os.environ.get("PYTEST_CURRENT_TEST"), bool(found), file=file)
    assert valid is not None or not found, found
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    assert held <= MEBI, f"{held} MiB of memory"
