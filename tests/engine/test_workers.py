"""Workers: the same bits on any number of them, and processes that end."""

import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import active_children, current_process, forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import ModuleType
from typing import Any

import distributed
import pytest
from checks import Captured, Command, cases, compiled_only, refused
from cluster import Cluster, started_cluster
from recordings import ENVIRONMENT, FRAMES, assert_same, process, run_words, track, write_recording
from scenes import corner_cameras, rig_of

import stseg
from stseg import Config, Grid, read_recording
from stseg.engine.memory import ground_note, process_memory
from stseg.engine.workers import worker_processes
from stseg.engine.workers.worker_processes import processes_that_fit
from stseg.engine.workers.workforce import Workforce
from stseg.errors import ConfigError

pytestmark = compiled_only


@pytest.fixture(autouse=True)
def path_for_children(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])


def test_any_number_of_workers_makes_the_same(rig_path: Path, undisturbed: Path, tmp_path: Path) -> None:
    assert track(rig_path, tmp_path / "run.h5", "--workers", "4") == 0  # two are those of which one is killed, below
    assert_same(tmp_path / "run.h5", undisturbed)
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


@contextmanager
def beside(work: Callable[[threading.Event], None]) -> Iterator[None]:
    """Something goes on until the event that what stands below has ended."""
    over = threading.Event()
    thread = threading.Thread(target=work, args=(over,))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_a_worker_that_is_killed_is_replaced(rig_path: Path, undisturbed: Path, tmp_path: Path) -> None:
    killed: list[BaseProcess] = []

    def kill(over: threading.Event) -> None:
        while not killed and not over.wait(0.02):
            for child in active_children()[:1]:
                child.kill()
                killed.append(child)

    with beside(kill):
        assert track(rig_path, tmp_path / "run.h5", "--workers", "2") == 0
    assert len(killed) == 1
    assert_same(tmp_path / "run.h5", undisturbed)


def test_a_camera_that_is_dead_at_borders_stays_excluded(tmp_path: Path) -> None:
    rig, boxes = write_recording(tmp_path, 60), tmp_path / "north.csv"
    boxes.write_text(re.sub(r"(?m)^(1[6-9]|[23]\d|4[0-3]),.*\n", "", boxes.read_text()))
    for workers in "12":
        assert track(rig, tmp_path / f"{workers}.h5", "--workers", workers) == 0
    assert_same(tmp_path / "1.h5", tmp_path / "2.h5")
    reasons = [row["reason"] for row in stseg.read_run(tmp_path / "1.h5").events if row["kind"] == b"blind"]
    assert len(reasons) == 2 and reasons[1] == b"camera north counts again, after 27 frames"


def test_what_a_worker_finds_wrong_is_one_line(tmp_path: Path, refusal: Command) -> None:
    rig = write_recording(tmp_path)
    boxes = tmp_path / "east.csv"
    boxes.write_text(re.sub(rf"(?m)^{FRAMES - 1},.*\n", "", boxes.read_text()))
    rig.write_text(rig.read_text().replace(f"frames = {FRAMES}", f"frames = {FRAMES - 1}", 1))
    refusal(*run_words(rig, tmp_path / "run.h5", "--workers", "2"))


@cases()
def test_workers_that_never_begin_are_not_waited_for(
    script: str, found: str, rig_path: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each first runs the script that is the main module; imports before may take a busy machine 20 s."""
    (tmp_path / "script.py").write_text(script)
    main_module = ModuleType("__main__")
    main_module.__file__ = str(tmp_path / "script.py")
    monkeypatch.setitem(sys.modules, "__main__", main_module)
    assert track(rig_path, tmp_path / "run.h5", "--workers", "2") == 2
    assert found in capsys.readouterr().err


def test_workers_that_cannot_be_started(
    rig_path: Path, tmp_path: Path, refusal: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ends(path: str) -> None:
        raise EOFError(path)  # as where the process that forks them has died

    assert "--workers: found 0" in refusal(*run_words(rig_path, tmp_path / "run.h5", "--workers", "0"))
    monkeypatch.setattr(forkserver, "connect_to_new_process", ends)
    assert "no process that can be started" in refusal(*run_words(rig_path, tmp_path / "run.h5", "--workers", "2"))


def test_a_script_that_a_worker_runs_starts_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(current_process(), "_inheriting", True, raising=False)
    refused(ConfigError, "a script that its workers run as well", Workforce, 2)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with started_cluster(tmp_path) as found:
        yield found


@pytest.mark.slow
def test_a_worker_is_killed_in_a_cluster(rig_path: Path, undisturbed: Path, tmp_path: Path, cluster: Cluster) -> None:
    output = tmp_path / "run.h5"
    folder = tmp_path / "run.h5.segments"

    def kill(over: threading.Event) -> None:
        while not list(folder.glob("segment-*-*.h5")) and not over.wait(0.02):
            pass
        cluster.workers[0].kill()
        cluster.workers[1].send_signal(signal.SIGCONT)

    cluster.workers[1].send_signal(signal.SIGSTOP)  # what the first worker has, no other has

    with beside(kill):
        assert track(rig_path, output, "--scheduler", cluster.address) == 0
    assert cluster.workers[0].wait() == -signal.SIGKILL and cluster.workers[1].poll() is None
    assert_same(output, undisturbed)


def test_no_scheduler_is_there(
    rig_path: Path, tmp_path: Path, refusal: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    client: Any = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: client(address, timeout=timeout and "0.5s"))
    words = run_words(rig_path, tmp_path / "run.h5", "--scheduler", "tcp://127.0.0.1:9")
    assert "no scheduler at tcp://127.0.0.1:9" in refusal(*words)


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """16 cores, 8 GiB of free memory."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(16)), raising=False)
    monkeypatch.setattr(worker_processes, "free_memory", lambda: 8 * 2**30)


@cases()
def test_a_large_ground_leaves_room_for_fewer(ground_side: int, views: int, processes: int) -> None:
    grid = Grid((0.0, ground_side), (0.0, ground_side))
    rig = replace(rig_of(corner_cameras()[:1] * views), grid=grid)
    assert processes_that_fit(process_memory(rig, Config())) == processes
    assert ("in 8 views: about 384 s" in ground_note(rig)) == bool(ground_note(rig)) == (ground_side == 400)


@cases()
def test_a_ground_beyond_the_memory_is_refused(
    side: float, cell: float, key: str, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before any work, with the number, the key and what to do; by a run, a forecast and a tracker in memory alike."""
    monkeypatch.setattr("stseg.engine.memory.free_memory", lambda: 8 * 2**30)
    rig = replace(rig_of(corner_cameras()[:1] * 8), grid=Grid((0.0, side), (0.0, side), cell))
    recording = read_recording(write_recording(tmp_path))
    large = replace(recording, rig=replace(recording.rig, grid=rig.grid, cameras=recording.rig.cameras[:1] * 8))
    large = replace(large, sources=large.sources[:1] * 8)
    calls: list[Callable[[], object]] = [
        lambda: stseg.Tracker(rig),
        lambda: stseg.plan(large),
        lambda: stseg.track(large, tmp_path / "run.h5"),
    ]
    for called in calls:
        said = refused(ConfigError, "8.0 GiB that are free", called)
        assert key in said and remedy in said


def test_nothing_is_imported_for_a_command_that_has_ended() -> None:
    assert process("import stseg.engine.workers.preloaded", STSEG_COMMAND="0").returncode == 1
