"""Progress of long work: a bar on a terminal, silence in a log."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def frame_bar(work: str, total: int | None, done: int = 0) -> Iterator[Callable[[int], None]]:
    """A bar on standard error; yields a function to call with the number of frames just done.

    Parameters
    ----------
    work
        Name of the work, one word.
    total, done
        Frames in all, None if unknown, and those done before.
    """
    if not sys.stderr.isatty():
        yield lambda more: None  # noqa: ARG005
        return
    from rich.console import Console  # imported where there is a bar
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
    from rich.progress import TimeElapsedColumn as Elapsed
    from rich.progress import TimeRemainingColumn as Remaining

    columns = TextColumn(work), BarColumn(), TaskProgressColumn(), Elapsed(), Remaining()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(work, total=total, completed=done)
        yield lambda more: bar.advance(task, more)


class TerminalReporter:
    """The engine's notes and progress on standard error (`stseg.engine.reporter.Reporter`)."""

    progress = staticmethod(frame_bar)

    @staticmethod
    def note(line: str) -> None:
        """A line about the run."""
        print(f"stseg: {line}", file=sys.stderr, flush=True)
