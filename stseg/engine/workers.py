"""Segments made by several processes of this machine; what they write is the same as if one had made them all.

Each worker has a pipe of its own and one segment at a time, so a worker that dies takes nothing with it but that
segment, which is given to another.
"""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from stseg.accelerate import compilation_noted
from stseg.engine.job import Job
from stseg.engine.segment_worker import SegmentWorker
from stseg.engine.segments import Segment
from stseg.errors import StsegError, WorkerError

_TRIES = 3
"""How often a segment is given to a worker before it is taken to be what kills them."""
_SPAWN = get_context("spawn")


@dataclass
class _Worker:
    """A process, and the segment that it is at."""

    process: SpawnProcess
    pipe: Connection
    segment: Segment | None = None


def make_by_workers(
    job: Job,
    missing: Sequence[Segment],
    draft: Callable[[int], Path],
    workers: int,
    advance: Callable[[int], None],
    note: Callable[[str], None],
) -> Iterator[tuple[Segment, Path]]:
    """Segments and their files, as they are done.

    Parameters
    ----------
    job, missing
        What is run, and the segments that are to be made.
    draft
        Where a segment is to be written.
    workers
        Number of processes.
    advance
        Called with the number of further frames that were fused.
    note
        Called with lines about the work, each once.

    Raises
    ------
    StsegError
        What a worker raised; WorkerError where a segment's workers die again and again.
    """
    todo, tries, notes = list(missing)[::-1], Counter[int](), set[str]()
    with _pool(job, min(workers, len(missing))) as pool:
        while todo or any(worker.segment for worker in pool):
            for worker in pool:
                if worker.segment is None and todo:
                    worker.segment = todo.pop()
                    with suppress(OSError):  # it has died; seen below
                        worker.pipe.send((worker.segment, draft(worker.segment.index)))
            for worker in _heard(pool):
                message = _receive(worker)
                segment = worker.segment
                if isinstance(message, int):
                    advance(message)
                elif isinstance(message, str):
                    if message not in notes:
                        note(message)
                    notes.add(message)
                elif isinstance(message, Path) and segment is not None:
                    worker.segment = None
                    yield segment, message
                elif isinstance(message, BaseException):
                    raise message
                else:
                    pool[pool.index(worker)] = _hired(job)
                    if segment is not None:
                        tries[segment.index] += 1
                        _require_life(segment, tries[segment.index], worker.process)
                        todo.append(segment)


def _heard(pool: list[_Worker]) -> list[_Worker]:
    """Workers that have something to say, or have died."""
    ready = wait([worker.pipe for worker in pool])
    return [worker for worker in pool if worker.pipe in ready]


def _receive(worker: _Worker) -> object:
    """Frames done, the file of a segment, or an error; None from a worker that has died."""
    try:
        return worker.pipe.recv()
    except (EOFError, OSError):
        worker.process.join()
        return None


def _require_life(segment: Segment, tries: int, process: SpawnProcess) -> None:
    if tries == _TRIES:
        frames = f"segment {segment.index}, frames {segment.first} to {segment.stop - 1}"
        found = f"{tries} workers that died of it, the last with status {process.exitcode}"
        raise WorkerError("--workers", frames, found, "memory enough for each of them, or fewer workers")


@contextmanager
def _pool(job: Job, number: int) -> Iterator[list[_Worker]]:
    """Processes that wait for segments; none is left at the end."""
    pool: list[_Worker] = []
    try:
        pool += [_hired(job) for _ in range(number)]
        yield pool
    finally:
        for worker in pool:
            worker.process.kill()
        for worker in pool:
            worker.process.join()
            worker.pipe.close()


def _hired(job: Job) -> _Worker:
    own, other = _SPAWN.Pipe()
    process = _SPAWN.Process(target=_work, args=(job, other), daemon=True)
    process.start()
    other.close()
    return _Worker(process, own)


def _work(job: Job, pipe: Connection) -> None:
    """What a worker process does; the process that hired it decides when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work: SegmentWorker | None = None
    with suppress(EOFError, BrokenPipeError):  # nobody is there any more
        while True:
            segment, draft = pipe.recv()
            try:
                with compilation_noted(pipe.send):
                    work = work or SegmentWorker(job)
                    pipe.send(work.make(segment, draft, pipe.send))
            except StsegError as error:
                pipe.send(error)
