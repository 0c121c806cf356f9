"""What is done once for all workers, in the process that they are forked from: imports, and the compiler's start."""

from __future__ import annotations

from stseg.engine import workers
from stseg.engine.first_kernel import start_compiler

__all__ = ["workers"]

start_compiler()
