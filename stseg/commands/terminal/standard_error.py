"""Standard error of commands: progress and notes; libraries that decode pictures write there past every handler."""

import faulthandler
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from threading import Event, Thread

_PATIENCE = 3.0
"""Seconds after which a command without a bar says that it is at work."""
_shown = Event()


@contextmanager
def patience() -> Iterator[None]:
    """A line on a terminal if a command has shown no bar and not ended after some seconds."""

    def note() -> None:
        if not _shown.wait(_PATIENCE):
            print("stseg: at work; Ctrl-C ends it", file=sys.stderr, flush=True)

    _shown.clear()
    if sys.stderr.isatty():
        Thread(target=note, daemon=True).start()
    try:
        yield
    finally:
        _shown.set()


def warn(warnings: Iterable[str]) -> None:
    """Print warnings, a line each."""
    for warning in warnings:
        print(f"stseg: warning: {warning}", file=sys.stderr)


class TerminalReporter:
    """The engine's notes and progress on standard error (`stseg.engine.reporter.Reporter`).

    `warnings` are printed once work on a known number of frames begins: what is refused before is one line.
    """

    def __init__(self, warnings: Sequence[str] = ()) -> None:
        self._warnings = list(warnings)

    @contextmanager
    def progress(self, work: str, total: int | None, done: int = 0) -> Iterator[Callable[[int], None]]:
        """A bar on a terminal; yields a function to call with the number of frames just done."""
        if total is not None:
            warn(self._warnings)
            self._warnings.clear()
        if not sys.stderr.isatty():
            yield lambda more: None  # noqa: ARG005
            return
        from rich.console import Console  # imported where there is a bar
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
        from rich.progress import TimeElapsedColumn as Elapsed
        from rich.progress import TimeRemainingColumn as Remaining

        _shown.set()
        columns = TextColumn(work), BarColumn(), TaskProgressColumn(), Elapsed(), Remaining()
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(work, total=total, completed=done)
            yield lambda more: bar.advance(task, more)

    @staticmethod
    def note(line: str) -> None:
        """A line about the run."""
        print(f"stseg: {line}", file=sys.stderr, flush=True)


DESCRIPTOR = 2


@contextmanager
def without_library_messages() -> Iterator[None]:
    """Meanwhile descriptor 2 leads nowhere, and sys.stderr to where it led before.

    libjpeg and libpng print every fault of a picture, and OpenCV has no switch for it. What cannot be decoded is an
    error of ours. With `python -X faulthandler` libraries are heard.
    """
    try:
        kept = os.dup(DESCRIPTOR)
    except OSError:  # closed by whoever started us
        kept = -1
    if kept < 0 or faulthandler.is_enabled():
        yield
        return
    stream = sys.stderr
    if isinstance(stream, TextIOWrapper) and stream.fileno() == DESCRIPTOR:
        sys.stderr = os.fdopen(kept, "w", 1, stream.encoding, stream.errors, closefd=False)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, DESCRIPTOR)
    os.close(nowhere)
    try:
        yield
    finally:
        sys.stderr.flush()
        sys.stderr = stream
        os.dup2(kept, DESCRIPTOR)
        os.close(kept)
