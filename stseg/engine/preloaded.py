"""What is done once for all workers, in the process that they are forked from: imports."""

from __future__ import annotations

from stseg.engine import assembly, workers

__all__ = ["assembly", "workers"]
