"""Kernels: compiled with all that they call, kept in the cache, with named tuples passed by address."""

import os
import pickle
import shutil
import stat
import sys
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from checks import cases, refused
from numba.core.caching import NullCache
from recordings import process, started

from stseg.arrays import Floats, Ints
from stseg.kernels import accelerate
from stseg.kernels.accelerate import FAST, kernel
from stseg.kernels.cache import folder, locked
from stseg.kernels.pointed_tuples import pointed

PROGRAM = """
import sys
import numpy as np
from stseg.kernels.accelerate import compilation_noted
from stseg.geometry.summed_area import fill_summed_area
with compilation_noted(print):
    print(fill_summed_area(np.array([[0.4, 0.2]], np.float32), 0, 0, sums := np.empty((2, 3), np.uint32)), *sums[1])
print("numba.cpython.unicode" in sys.modules)
"""
"""Prints notes, the result of a kernel that calls another kernel, and whether what compiling needs was imported."""
AHEAD = """
from stseg.kernels.accelerate import load_cached_kernels
from stseg.geometry.summed_area import fill_summed_area
load_cached_kernels()
print(len(fill_summed_area.signatures))
"""
"""Prints how many forms of a kernel were taken from the cache before it was called."""


@kernel
def half(values: Floats, k: int) -> float:
    if k >= len(values):
        raise IndexError("beyond")
    return 0.5 * float(values[k])


@kernel
def sum_of_halves(values: Floats, number: int) -> float:
    total = 0.0
    for k in range(number):
        total += half(values, k)
    return total


@kernel
def halves_of_two(values: Floats) -> float:
    return half(values, 0) + half(values, 1)


COMPILED = pytest.mark.skipif(not accelerate.COMPILED, reason="kernels are not compiled")


def test_python_and_kernels_call_the_same_kernel() -> None:
    values = np.array([1.0, 2.0, 4.0])
    assert sum_of_halves(values, 3) == 3.5 and half(values, 2) == 2.0
    for called in (half, sum_of_halves):
        refused(IndexError, "beyond", called, values, 4)


@COMPILED
@pytest.mark.skipif(not FAST, reason="compiled by numba alone")
def test_a_kernel_is_not_made_anew_for_each_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(halves_of_two, "_disk", NullCache())  # an earlier run of the tests may have left its code
    assert halves_of_two(np.array([1.0, 2.0])) == 1.5
    assert len(half._inner.overloads) == 1  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def cached(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A folder that holds the kernels of the program, and what the program printed that compiled them."""
    path = tmp_path_factory.mktemp("cached")
    return path, process(PROGRAM, NUMBA_CACHE_DIR=str(path)).stdout.splitlines()


def test_the_cache_holds_the_kernels_that_python_calls(cached: tuple[Path, list[str]], tmp_path: Path) -> None:
    path, first = cached
    runs = ((AHEAD, tmp_path), (PROGRAM, path), (AHEAD, path))
    empty, second, ahead = (process(words, NUMBA_CACHE_DIR=str(at)).stdout.splitlines() for words, at in runs)
    assert first == ["compiling kernels, once on this machine, about a minute of work", "819 0 1638 2457", "True"]
    assert second == ["819 0 1638 2457", "False"]
    assert (empty, ahead) == (["0"], ["1"])
    assert {file.name.split("-")[0] for file in path.rglob("*.nbi")} == {"summed_area.fill_summed_area"}


@COMPILED
@pytest.mark.skipif(sys.platform == "win32", reason="no locks of folders")
def test_of_processes_that_start_together_one_compiles(tmp_path: Path) -> None:
    both = [started(PROGRAM, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    printed = [running.communicate()[0].splitlines() for running in both]
    assert sorted(len(lines) for lines in printed) == [2, 3]
    assert sum("compiling" in lines[0] for lines in printed) == 1
    assert [lines[-2] for lines in printed] == ["819 0 1638 2457", "819 0 1638 2457"]


class Payload:
    """Makes a file where it is unpickled."""

    def __reduce__(self) -> tuple[object, ...]:
        return open, ("executed", "w")


def damaged(file: Path, kind: str) -> None:
    content = file.read_bytes()
    if kind == "empty":
        file.write_bytes(b"")
    elif kind == "flipped":
        file.write_bytes(content[:-200] + bytes([content[-200] ^ 1]) + content[-199:])
    elif kind == "forged":
        file.write_bytes(pickle.dumps(Payload()) + content)
    elif kind == "writable":
        file.write_bytes(blake2b(forged := pickle.dumps(Payload())).digest() + forged)
        file.chmod(0o666)
    else:
        os.chown(file, 12345, -1)


@COMPILED
@pytest.mark.skipif(sys.platform == "win32", reason="no owners and modes of files")
@cases()
def test_foreign_cached_files_are_unused(cached: tuple[Path, list[str]], tmp_path: Path, kind: str, files: str) -> None:
    if kind == "owned" and os.geteuid():
        pytest.skip("only root gives files away")
    shutil.copytree(cached[0], tmp_path, dirs_exist_ok=True)
    for file in tmp_path.rglob(f"*.{files}"):
        damaged(file, kind)
    anew, known = (process(PROGRAM, cwd=tmp_path, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2))
    assert anew.stdout.splitlines()[1:] == ["819 0 1638 2457", "True"] and not anew.stderr
    assert known.stdout.splitlines() == ["819 0 1638 2457", "False"] and not known.stderr
    assert not (tmp_path / "executed").exists()


@COMPILED
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's length")
def test_kernels_need_no_room_on_the_disk(tmp_path: Path) -> None:
    full = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n{PROGRAM}"
    ended = process(full, NUMBA_CACHE_DIR=str(tmp_path), PYTHONDONTWRITEBYTECODE="1")
    assert ended.stdout.splitlines()[1:] == ["819 0 1638 2457", "True"] and not ended.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="no locks of folders")
def test_a_lock_of_others_is_not_waited_for_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stseg.kernels.cache._PATIENCE", 0.1)
    with locked(str(tmp_path)), locked(str(tmp_path)):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="no owners and modes of files")
def test_the_folder_of_kernels_is_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (tmp_path / "stseg").mkdir()
    (tmp_path / "stseg").chmod(0o777)
    assert folder.__wrapped__() == tmp_path / "stseg"
    assert stat.S_IMODE((tmp_path / "stseg").stat().st_mode) == 0o700
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert tmp_path not in folder.__wrapped__().parents


class Walk(NamedTuple):
    """Steps of a walk."""

    step: Floats
    number: int


class Walker(NamedTuple):
    """A walk within a tuple, beside other fields."""

    name: Ints
    walk: Walk
    pace: float


@kernel
def distance(walker: Walker) -> float:
    """The length of the way; marks the walker as done."""
    walker.name[0] = -1
    total = 0.0
    for k in range(walker.walk.number):
        total += walker.pace * walker.walk.step[k]
    return total


@kernel
def distance_by_address(walker: Walker) -> float:
    return distance(pointed(walker))


@kernel
def farthest_of_own_walks(number: int, steps: int) -> float:
    """Kernels may make tuples themselves, and pass them to the one that asks for the address."""
    farthest = 0.0
    for k in range(number):
        walk = Walk(np.full(steps, float(k)), steps)
        farthest = max(farthest, distance_by_address(Walker(np.zeros(1, np.int64), walk, 0.5)))
    return farthest


def test_fields_of_inner_tuples_and_what_a_kernel_makes() -> None:
    walker = Walker(np.array([7]), Walk(np.array([1.0, 2.0, 4.0]), 2), 0.5)
    assert distance_by_address(walker) == distance(walker) == 1.5
    np.testing.assert_array_equal(walker.name, [-1])  # arrays are not copied
    assert farthest_of_own_walks(200, 1000) == 199 * 0.5 * 1000
