"""Parallel processing of segments by worker processes of this machine, with the same results as by one process.

Each worker has a pipe of its own and one segment at a time. Thus a worker that dies loses only that segment, which is
assigned to another. The last to work share the cores of those that have nothing left to do.
"""

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from stseg.engine.offline.due_segments import DueSegments
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_worker import SegmentWorker
from stseg.engine.offline.segments import Segment
from stseg.engine.reporter import Advance, Note
from stseg.engine.workers.worker_processes import CONTEXT, GUARD, started_process
from stseg.errors import StsegError, WorkerError
from stseg.io.machine import free_cores
from stseg.kernels.accelerate import compilation_noted

_TRIES = 3
"""Number of workers lost by the same segment at which the run fails."""


@dataclass
class _Worker:
    """A worker process, its pipe, its processor cores, and its current segment."""

    process: BaseProcess
    pipe: Connection
    cores: int
    segment: Segment | None = None
    has_begun: bool = False

    def send(self, order: object) -> None:
        """Send it a segment and the path of its file, or a number of cores."""
        with suppress(OSError):  # a dead worker is replaced once it is found
            self.pipe.send(order)


def make_by_workers(
    job: Job, due: DueSegments, draft: Callable[[int], Path], workers: int, advance: Advance, note: Note
) -> None:
    """`Workforce.make` by that many worker processes.

    Raises
    ------
    WorkerError
        Where the workers of a segment die repeatedly, or one ends before it begins.
    StsegError
        An error raised by a worker.
    """
    tries, notes = Counter[int](), set[str]()
    with _pool(job, workers) as pool:
        while busy := _busy(pool, due, draft, advance):
            _share_cores(busy)
            for worker in _ready(pool):
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
                    due.keep(segment, message)
                elif isinstance(message, BaseException):
                    raise message
                else:
                    pool.remove(worker)
                    if segment is not None:
                        tries[segment.index] += 1
                        _limit_tries(segment, tries[segment.index], worker)
                        due.lose(segment)
                        pool.append(_start(job, worker.cores))


def _busy(pool: list[_Worker], due: DueSegments, draft: Callable[[int], Path], advance: Advance) -> list[_Worker]:
    """Give the workers that have none a segment each, as far as some are due; the workers that have one."""
    for worker in pool:
        if worker.segment is None and (segment := due.next(advance)):
            worker.segment = segment
            worker.send((segment, draft(segment.index)))
    return [worker for worker in pool if worker.segment]


def _share_cores(busy: list[_Worker]) -> None:
    """Give the workers that have a segment all cores of this machine."""
    for worker in busy:
        cores = _share(len(busy))
        if worker.cores != cores:
            worker.cores = cores
            worker.send(cores)


def _share(workers: int) -> int:
    """Cores of each of some workers."""
    return -(-free_cores() // workers)


def _ready(pool: list[_Worker]) -> list[_Worker]:
    """Wait for messages; workers that have sent one, or have died."""
    ready = wait([worker.pipe for worker in pool])
    return [worker for worker in pool if worker.pipe in ready]


def _receive(worker: _Worker) -> object:
    """Number of fused frames, a note, the file of a segment, or an error; None from a worker that has died."""
    try:
        message: object = worker.pipe.recv()
        worker.has_begun = True
        return message
    except (EOFError, OSError):
        worker.process.join()
        return None


def _limit_tries(segment: Segment, tries: int, worker: _Worker) -> None:
    """Raise WorkerError where a segment has lost as many workers as are allowed, or no worker will ever begin."""
    status = worker.process.exitcode or 0
    if not worker.has_begun and status >= 0:  # it was not killed, which may happen to any
        found = f"a worker that ended with status {status} before it began"
        raise WorkerError("--workers", "", found, f"a script file with {GUARD} around its calls, or 1 process")
    if tries == _TRIES:
        frames = f"segment {segment.index}, frames {segment.first} to {segment.stop - 1}"
        found = f"{tries} workers died while processing it, the last with status {status}"
        raise WorkerError("--workers", frames, found, "enough memory for each worker, or fewer workers")


@contextmanager
def _pool(job: Job, number: int) -> Iterator[list[_Worker]]:
    """Worker processes waiting for segments; killed on exit."""
    pool: list[_Worker] = []
    try:
        pool += [_start(job, _share(number)) for _ in range(number)]
        yield pool
    finally:
        for worker in pool:
            worker.process.kill()
        for worker in pool:
            worker.process.join()
            worker.pipe.close()


def _start(job: Job, cores: int) -> _Worker:
    """Start a worker process."""
    pipe, other = CONTEXT.Pipe()
    process = started_process(_main, job, cores, other)
    other.close()
    return _Worker(process, pipe, cores)


class _Orders:
    """Orders of a worker, by its pipe: segments, and between them or meanwhile the number of its cores."""

    def __init__(self, pipe: Connection, cores: int) -> None:
        self._pipe, self._cores = pipe, cores

    def cores(self) -> int:
        """The number of cores by now, while a segment is made."""
        while self._pipe.poll():
            self._cores = self._pipe.recv()
        return self._cores

    def segment(self) -> tuple[Segment, Path]:
        """The next segment, and the path of its file."""
        while isinstance(order := self._pipe.recv(), int):
            self._cores = order
        segment, draft = order
        return segment, draft


def _main(job: Job, cores: int, pipe: Connection) -> None:
    """Main loop of a worker process, which ends when its parent closes the pipe or kills it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    orders, worker = _Orders(pipe, cores), None
    with suppress(EOFError, BrokenPipeError):  # the parent process has ended
        pipe.send(0)
        while True:
            segment, draft = orders.segment()
            try:
                with compilation_noted(pipe.send):
                    worker = worker or SegmentWorker(job, orders.cores)
                    pipe.send(worker.make(segment, draft, pipe.send))
            except StsegError as error:
                pipe.send(error)
            except MemoryError:
                os._exit(1)  # as if the system had killed it, without waiting for its threads: another tries
