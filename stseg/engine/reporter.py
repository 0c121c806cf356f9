"""Notes and progress of long work, as the engine reports them; printing is the caller's."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol


class Reporter(Protocol):
    """Receives notes and progress."""

    def note(self, line: str) -> None:
        """A line about the run."""

    def progress(self, work: str, total: int | None, done: int = 0) -> AbstractContextManager[Callable[[int], None]]:
        """Progress of one kind of work, in frames; the context's value is called with each number of further frames.

        Parameters
        ----------
        work
            One word.
        total, done
            Frames in all, None where not known, and those finished before.
        """
