"""Distributed processing of segments by the workers of a Dask scheduler, on machines with a shared file system.

Recording, rig and output have the same paths on all machines. A worker writes its segment file into the work folder and
returns only the path; the segment of a worker that dies is assigned to another.
"""

import pickle
from collections.abc import Callable
from concurrent.futures import CancelledError
from functools import lru_cache
from itertools import count
from pathlib import Path

from stseg.engine.offline.due_segments import DueSegments
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_worker import SegmentWorker
from stseg.engine.offline.segments import Segment
from stseg.engine.reporter import Advance
from stseg.errors import ConfigError, WorkerError


def make_by_cluster(job: Job, due: DueSegments, draft: Callable[[int], Path], address: str, advance: Advance) -> None:
    """`Workforce.make` by the workers of the scheduler at an address, such as tcp://10.0.0.5:8786.

    The folder of the drafts is shared by all of them.

    Raises
    ------
    ConfigError
        Where the package `distributed` or the scheduler is missing.
    WorkerError
        Where the workers of a segment die repeatedly, or the scheduler gives it up.
    StsegError
        An error raised by a worker.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as error:
        raise ConfigError("--scheduler", "", "no package distributed", "pip install 'stseg[cluster]'") from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise ConfigError(
            "--scheduler", "", f"no scheduler at {address} ({error})", "its address, tcp://HOST:PORT"
        ) from error
    with client:
        name = job.recording.rig.name  # the dashboard shows the part of a key before the first dash as the stage
        shared = client.submit(bytes, pickle.dumps(job), pure=False)  # a result is made anew, scattered bytes are not
        futures, waiting, number = {}, as_completed(), count()

        def submit() -> None:
            while segment := due.next(advance):
                path, key = draft(segment.index).absolute(), f"segment-{name}-{segment.index:05}-{next(number)}"
                future = client.submit(make_segment, shared, segment, path, key=key, pure=False)
                futures[future] = segment
                waiting.add(future)

        submit()
        for future in waiting:
            segment = futures.pop(future)  # released: its file exists, so it is not recomputed if its worker dies
            try:
                path = future.result()
            except (KilledWorker, CancelledError) as error:
                frames = f"segment {segment.index}, frames {segment.first} to {segment.stop - 1}"
                raise WorkerError("--scheduler", frames, str(error), "workers that stay alive") from error
            advance(segment.stop - segment.first)
            due.keep(segment, path)
            submit()


def make_segment(job: bytes, segment: Segment, draft: Path) -> Path:
    """Task of a worker: process a segment of a pickled job; the path of its file."""
    return _worker(job).make(segment, draft, lambda _: None)


@lru_cache(1)
def _worker(job: bytes) -> SegmentWorker:
    """The worker of a job, kept between its segments."""
    return SegmentWorker(pickle.loads(job))
