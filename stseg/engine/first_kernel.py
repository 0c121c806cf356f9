"""The compiler's start: the first kernel of a process takes a fifth of a second more than the others."""

from __future__ import annotations

from stseg.accelerate import kernel


@kernel
def start_compiler() -> None:
    """The least kernel."""
