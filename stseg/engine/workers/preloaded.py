"""Imports and kernels from the cache, loaded once in the process from which all workers are forked."""

import os
import signal

_PARENT = int(os.environ.get("STSEG_COMMAND", os.getppid()))
signal.signal(signal.SIGALRM, lambda *_: None if os.getppid() == _PARENT else os._exit(1))
signal.setitimer(signal.ITIMER_REAL, 0.001, 0.5)  # imports take seconds; meanwhile the command may end

from stseg.engine.workers import local_workers  # noqa: E402
from stseg.io.machine import collect_rarely  # noqa: E402
from stseg.kernels.accelerate import load_cached_kernels  # noqa: E402

__all__ = ["local_workers"]

collect_rarely()
load_cached_kernels()
signal.setitimer(signal.ITIMER_REAL, 0)
