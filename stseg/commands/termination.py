"""Answers to SIGINT and SIGTERM: an orderly end where Python comes to its handlers, else an end without them."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress
from types import FrameType
from typing import Any

INTERRUPTED, TERMINATED = 130, 143
"""Exit status after SIGINT and SIGTERM."""

_PATIENCE = 1.5
"""Time in which Python must come to its handlers, seconds."""
_ORDERLY = 10.0
"""Time for an orderly end once it has, seconds: output is withdrawn, workers are ended."""


class Termination:
    """SIGTERM acts as an interrupt: output is finished or withdrawn, and the command ends.

    Python runs no handler while a kernel is at work in the main thread, and a kernel may take long. So a thread learns
    of every signal as well, and ends the process where the command has not ended in time. Files are written so that an
    end at any moment loses nothing. The first signal for which a command has a handler of its own (`run --follow`)
    is left to that.
    """

    def __init__(self) -> None:
        self.asked = False
        self._answered = threading.Event()
        self._watch: _Watch | None = None
        self._before: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            self._before[signal.SIGTERM] = signal.signal(signal.SIGTERM, self._ask)
            if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
                self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._interrupt)
            self._watch = _Watch((self._ask, self._interrupt, signal.default_int_handler), self._answered)

    @property
    def line(self) -> str:
        """What there is to say of it."""
        return f"stseg: {'terminated' if self.asked else 'interrupted'}"

    @property
    def status(self) -> int:
        """Exit status."""
        return TERMINATED if self.asked else INTERRUPTED

    def forget(self) -> None:
        """Restore the previous handlers."""
        if self._watch is not None:
            self._watch.close()
            self._watch = None
            for number, handler in self._before.items():
                signal.signal(number, handler)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        self._interrupt(number, frame)

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        self._answered.set()
        raise KeyboardInterrupt


class _Watch:
    """A thread that waits for signals.

    Parameters
    ----------
    orderly
        Handlers that end the command.
    answered
        Set by these handlers.
    """

    def __init__(self, orderly: tuple[Any, ...], answered: threading.Event) -> None:
        self._orderly, self._answered, self._ended = orderly, answered, threading.Event()
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._before = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._wait, name="signals", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """The command has ended."""
        self._ended.set()
        signal.set_wakeup_fd(self._before)
        os.close(self._writer)
        self._thread.join()
        os.close(self._reader)

    def _wait(self) -> None:
        left_alone = False
        while numbers := os.read(self._reader, 64):
            for number in numbers:
                if number not in (signal.SIGINT, signal.SIGTERM):
                    continue
                if signal.getsignal(number) not in self._orderly and not left_alone:
                    left_alone = True
                elif not self._ended_in_time():
                    _end(number)

    def _ended_in_time(self) -> bool:
        return self._ended.wait(_PATIENCE) or (self._answered.is_set() and self._ended.wait(_ORDERLY))


def _end(number: int) -> None:
    """End this process and those that it has started, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
    said, status = ("terminated", TERMINATED) if number == signal.SIGTERM else ("interrupted", INTERRUPTED)
    with suppress(OSError, ValueError):
        error = sys.stderr.fileno()  # not the stream, in which a lock may be held
        cursor = "\x1b[?25h" if os.isatty(error) else ""  # a progress bar has hidden it
        os.write(error, f"{cursor}stseg: {said}\n".encode())
    os._exit(status)
