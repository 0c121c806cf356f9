"""Progress of long work: a bar on a terminal, silence in a log."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def frame_bar(work: str, total: int | None, done: int = 0) -> Iterator[Callable[[int], None]]:
    """A bar on standard error; what it yields is told how many more frames are done.

    Parameters
    ----------
    work
        What is being done, one word.
    total, done
        Frames in all, None where nobody knows, and those that were done before.
    """
    console = Console(stderr=True)
    columns = TextColumn(work), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(work, total=total, completed=done)
        yield lambda more: bar.advance(task, more)


class TerminalReporter:
    """The engine's notes and progress on standard error (`stseg.engine.reporter.Reporter`)."""

    progress = staticmethod(frame_bar)

    @staticmethod
    def note(line: str) -> None:
        """A line about the run."""
        print(f"stseg: {line}", file=sys.stderr, flush=True)
