"""Faults of the system: file-system calls of a run fail, or are the last before a kill; `tools/faults.py` tries all.

The run is a real one in a child process. A wrapper counts its calls of the system that write (open, write, fsync,
rename, link, mkdir, unlink) and makes the n-th fail, write half, or kill the process. Afterwards the old output stands,
or the new one whole; and the same command without faults gives the same datasets, bit for bit.
"""

import errno
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from checks import compiled_only
from fault_driver import Driver
from recordings import assert_same, write_recording

pytestmark = [pytest.mark.skipif(sys.platform != "linux", reason="needs /proc"), compiled_only]


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    folder = tmp_path_factory.mktemp("recording")
    own = Driver(write_recording(folder), folder)
    yield own
    own.close()


@pytest.fixture(scope="module")
def whole(driver: Driver, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[str, ...]]:
    """The file of a run without faults, and the calls that it made."""
    output = tmp_path_factory.mktemp("whole") / "out" / "run.h5"
    output.parent.mkdir()
    done = driver.run(output)
    assert done.status == 0, done.messages
    return output, done.calls


def places(calls: tuple[str, ...], fault: str) -> list[int]:
    """Calls to fail: each kind's first and last; killed, every step from the last write on."""
    chosen = set()
    for kind in dict.fromkeys(calls):
        own = [place for place, call in enumerate(calls) if call == kind]
        chosen |= {own[0], own[-1]}
    if fault == "kill":
        chosen |= set(range(max(place for place, call in enumerate(calls) if call == "write"), len(calls)))
    if fault == "short":
        chosen = {place for place in chosen if calls[place] == "write"}
    return sorted(chosen)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["kill", "short", str(errno.ENOSPC), str(errno.EACCES)])
def test_a_fault_loses_nothing(driver: Driver, whole: tuple[Path, tuple[str, ...]], tmp_path: Path, fault: str) -> None:
    expected, calls = whole
    for at in places(calls, fault):
        output, call = tmp_path / str(at) / "run.h5", f"call {at}, {calls[at]}"
        output.parent.mkdir()
        faulty = driver.run(output, fault, at)
        assert "Traceback" not in faulty.messages, f"{call}: {faulty.messages}"
        if faulty.status > 0:
            assert (faulty.status, "stseg: error: " in faulty.messages) == (2, True), f"{call}: {faulty.messages}"
        if output.exists():
            assert_same(output, expected)
        if faulty.status != 0:
            finished = output.exists() and not Path(f"{output}.segments").exists()
            again = driver.run(output)  # a run that was finished is refused as any other output that exists
            assert again.status == (2 if finished else 0), f"{call}: {again.messages}"
            assert_same(output, expected)
            left = {path.name for path in output.parent.iterdir()}
            assert left == {"run.h5"}, f"{call}: {left}"
