"""Segments made by the workers of a Dask scheduler, on any number of machines that share a folder.

The recording, the rig and the output stand under the same paths on all of them. A worker writes its segment into the
work folder itself and sends back the name, so what travels is small; a segment whose worker dies is given to another.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from stseg.engine.job import Job
from stseg.engine.segment_worker import SegmentWorker
from stseg.engine.segments import Segment
from stseg.errors import ConfigError, WorkerError

_TRIES = 3


def make_by_cluster(
    job: Job, missing: Sequence[Segment], draft: Callable[[int], Path], address: str, advance: Callable[[int], None]
) -> Iterator[tuple[Segment, Path]]:
    """Segments and their files, as they are done.

    Parameters
    ----------
    job, missing
        What is run, and the segments that are to be made.
    draft
        Where a segment is to be written: in a folder that all workers share.
    address
        Of the scheduler, such as tcp://10.0.0.5:8786.
    advance
        Called with the number of frames fused since the last call.

    Raises
    ------
    StsegError
        What a worker raised; ConfigError where there is no scheduler, WorkerError where a segment's workers die.
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
        shared = client.scatter(pickle.dumps(job), broadcast=True)
        futures = {
            client.submit(
                make_segment, shared, segment, draft(segment.index).absolute(), key=_key(job, segment), pure=False,
            ): segment
            for segment in missing
        }  # fmt: skip
        for future in as_completed(futures):
            segment = futures.pop(future)  # its file stands: who made it may die, and nobody makes it again
            try:
                path = future.result()
            except KilledWorker as error:
                frames = f"segment {segment.index}, frames {segment.first} to {segment.stop - 1}"
                raise WorkerError("--scheduler", frames, str(error), "workers that live") from error
            advance(segment.stop - segment.first)
            yield segment, path


def make_segment(job: bytes, segment: Segment, draft: Path) -> Path:
    """What a worker does: a segment's file, by its name."""
    return _work(job).make(segment, draft, lambda _: None)


@lru_cache(1)
def _work(job: bytes) -> SegmentWorker:
    return SegmentWorker(pickle.loads(job))


def _key(job: Job, segment: Segment) -> str:
    """What the scheduler's dashboard calls it: the name before the first dash is the stage."""
    return f"segment-{job.recording.rig.name}-{segment.index:05}"
