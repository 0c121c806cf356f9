"""The processes that make segments: this one, several of this machine, or the workers of a Dask scheduler."""

from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import current_process
from pathlib import Path

from stseg.engine.memory import process_memory
from stseg.engine.offline.due_segments import DueSegments
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_worker import SegmentWorker
from stseg.engine.reporter import Advance, Note
from stseg.engine.workers.cluster import make_by_cluster
from stseg.engine.workers.local_workers import make_by_workers
from stseg.engine.workers.worker_processes import GUARD, prepare_workers, processes_that_fit
from stseg.errors import ConfigError
from stseg.io.machine import free_cores


@dataclass(frozen=True)
class Workforce:
    """Number of processes of this machine, None for as many as it has room for; or the address of a Dask scheduler.

    Raises
    ------
    ConfigError
        Where there is not one process at least, or several are asked for while a worker runs the script.
    """

    workers: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise ConfigError("--workers", "", self.workers, "1 or more processes")
        if self.workers != 1 and getattr(current_process(), "_inheriting", False):
            raise ConfigError("--workers", "", "a script that its workers run as well", f"{GUARD} around its calls")

    def processes(self, job: Job) -> int:
        """Number of processes of this machine."""
        if self.workers is not None:
            return self.workers
        return processes_that_fit(process_memory(job.recording.rig, job.config))

    def prepare(self) -> None:
        """Make ready what takes time, while the recording is counted."""
        if self.scheduler is None:
            prepare_workers(self.workers)

    def make(self, job: Job, due: DueSegments, draft: Callable[[int], Path], advance: Advance, note: Note) -> None:
        """Make segments until none is due.

        Parameters
        ----------
        job, due
            The run, and its segments that are to be made.
        draft
            Gives the path of a segment's unfinished file from its index.
        advance
            Called with the number of further frames that were fused.
        note
            Called with lines about the work.
        """
        if not (number := len(due)):
            return
        workers = min(number, self.processes(job))
        if self.scheduler is not None:
            make_by_cluster(job, due, draft, self.scheduler, advance)
        elif workers > 1:
            make_by_workers(job, due, draft, workers, advance, note)
        else:
            worker = SegmentWorker(job, free_cores)
            while segment := due.next(advance):
                due.keep(segment, worker.make(segment, draft(segment.index), advance))
