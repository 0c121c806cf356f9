"""What is done once for all workers, in the process that they are forked from: imports, and the compiler's start."""

from __future__ import annotations

from stseg.accelerate import kernel
from stseg.engine import workers

__all__ = ["start_compiler", "workers"]


@kernel
def start_compiler() -> None:
    """The least kernel: the first one of a process takes a fifth of a second more than the others."""


start_compiler()
