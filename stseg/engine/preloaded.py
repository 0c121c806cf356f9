"""What is done once for all workers, in the process that they are forked from: imports, and kernels from the cache."""

from __future__ import annotations

from stseg.accelerate import take_kept_kernels
from stseg.engine import assembly, workers
from stseg.engine.garbage import collect_rarely

__all__ = ["assembly", "workers"]

collect_rarely()
take_kept_kernels()
