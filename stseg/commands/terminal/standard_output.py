"""Tables on standard output: as wide as the terminal, and whole where a pipe or a file takes them."""

from __future__ import annotations

from rich.console import Console

_WHOLE = 10_000
"""Columns of what no terminal shows."""


def output_console() -> Console:
    """Standard output as a console without markup."""
    console = Console(highlight=False, markup=False)
    return console if console.is_terminal else Console(highlight=False, markup=False, width=_WHOLE)
