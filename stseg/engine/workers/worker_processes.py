"""Number of worker processes of a run, and the process that they are forked from.

Both are known here without importing any stage: what forks the workers imports the stages (`preloaded`)
at the same time as the process of the command does.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING

from stseg.errors import WorkerError
from stseg.import_path import SafeChildren
from stseg.io.machine import free_cores, free_memory

if TYPE_CHECKING:  # Windows has no contexts that fork
    from multiprocessing.context import ForkServerContext, SpawnContext

FORKED = "forkserver" in multiprocessing.get_all_start_methods()
"""Whether a further process starts at once, with all imports."""
CONTEXT: ForkServerContext | SpawnContext = (
    multiprocessing.get_context("forkserver") if FORKED else multiprocessing.get_context("spawn")
)
"""Workers are forked from a process that has imported everything and has no threads, where the system can do that."""

GUARD = '`if __name__ == "__main__":`'
_PRELOADED = "stseg.engine.workers.preloaded"
PROCESS_MEMORY = 650 * 2**20
"""Memory that a process of a run is taken to need on a small ground, bytes."""


def processes_that_fit(memory: int = PROCESS_MEMORY) -> int:
    """Number of processes of a run for which this machine has cores and free memory, bytes each, 1 at least."""
    return max(1, min(free_cores(), free_memory() // memory))


def prepare_workers(workers: int | None) -> None:
    """Begin the imports of workers, where there are several (None: as many as fit), while this process does others."""
    if FORKED and (processes_that_fit() if workers is None else workers) > 1:
        from multiprocessing import forkserver

        CONTEXT.set_forkserver_preload([_PRELOADED])
        os.environ["STSEG_COMMAND"] = str(os.getpid())
        with SafeChildren():
            forkserver.ensure_running()


def started_process(target: Callable[..., None], *arguments: object) -> BaseProcess:
    """A further process, started; it is killed at the latest with this one. WorkerError where none can be started."""
    process = CONTEXT.Process(target=target, args=arguments, daemon=True)
    try:
        with SafeChildren():
            process.start()
    except (OSError, EOFError) as error:
        expected = "1 process; a script calls stseg below `if __name__ == '__main__':`"
        raise WorkerError("--workers", "", f"no process that can be started ({error})", expected) from error
    return process
