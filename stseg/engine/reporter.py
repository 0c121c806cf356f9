"""Notes and progress of long work, as the engine reports them; printing is the caller's."""

import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Protocol

Progress = Callable[[str, int, int | None], None]
"""Called with the kind of work in one word, frames done, and frames in all (None where not known)."""
Advance = Callable[[int], None]
"""Called with a number of further frames."""
Note = Callable[[str], None]
"""Called with a line about the work."""


class Reporter(Protocol):
    """Receives notes and progress."""

    def note(self, line: str) -> None:
        """A line about the run."""

    def progress(self, work: str, total: int | None, done: int = 0) -> AbstractContextManager[Advance]:
        """Progress of one kind of work, in frames; the context's value is called with each number of further frames.

        Parameters
        ----------
        work
            One word.
        total, done
            Frames in all, None where not known, and those finished before.
        """


@dataclass(frozen=True)
class LogReporter:
    """Notes to the logger `stseg`, progress to a function, if there is one."""

    function: Progress | None = None

    def note(self, line: str) -> None:
        """A line about the run."""
        logging.getLogger("stseg").info("%s", line)

    @contextmanager
    def progress(self, work: str, total: int | None, done: int = 0) -> Iterator[Advance]:
        """Progress of one kind of work (`Reporter.progress`)."""
        count = done

        def advance(more: int) -> None:
            nonlocal count
            count += more
            if more and self.function is not None:
                self.function(work, count, total)

        yield advance


AnyReporter = Progress | Reporter | None
"""A reporter, a function that is called with progress alone, or neither."""


def reporter_of(progress: AnyReporter) -> Reporter:
    """A reporter as it is; or one that logs notes, and reports progress to a function, if there is one."""
    return LogReporter(progress) if progress is None or callable(progress) else progress
