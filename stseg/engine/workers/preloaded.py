"""Imports and kernels from the cache, loaded once in the process from which all workers are forked."""

from __future__ import annotations

from stseg.engine.offline import assembly
from stseg.engine.workers import local_workers
from stseg.engine.workers.garbage import collect_rarely
from stseg.kernels.accelerate import load_cached_kernels

__all__ = ["assembly", "local_workers"]

collect_rarely()
load_cached_kernels()
