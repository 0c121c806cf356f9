"""A run that has no end of its own stops when it is asked to: by Ctrl-C or SIGTERM, and finishes what it has begun."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Stopping:
    """A run that goes on until a signal: the first asks it to finish, the next does what it did before."""

    def __init__(self) -> None:
        self.asked = threading.Event()
        self._first = threading.Lock()
        self._signals = 0
        self._before: dict[int, Any] = {}

    def ask(self) -> None:
        """Ask it to finish, and say so once; from any thread."""
        if self._first.acquire(blocking=False):
            self.asked.set()
            # Not print: the signal may have come in the middle of one.
            os.write(sys.stderr.fileno(), b"stseg: finishing; once more to stop at once\n")

    def begin(self) -> None:
        """Handle signals."""
        if threading.current_thread() is threading.main_thread():
            handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
            self._before = {number: before for number, before in handlers.items() if callable(before)}
            for number in self._before:
                signal.signal(number, self._handle)

    def end(self) -> None:
        """Handle signals as before."""
        for number, before in self._before.items():
            signal.signal(number, before)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self._signals += 1
        if self._signals == 1:
            self.ask()
        else:
            self._before[number](number, frame)


_going_on: list[Stopping] = []


def stopping() -> Stopping | None:
    """The run of this process that goes on until a signal, if there is one."""
    return _going_on[-1] if _going_on else None


@contextmanager
def stop_asked() -> Iterator[threading.Event]:
    """An event that the first interrupt or SIGTERM sets; the next does what it did before."""
    run = Stopping()
    _going_on.append(run)
    run.begin()
    try:
        yield run.asked
    finally:
        run.end()
        _going_on.remove(run)
