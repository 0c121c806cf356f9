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
"""Time for an orderly end, seconds."""


class Termination:
    """SIGTERM acts as an interrupt: output is finished or withdrawn, and the command ends.

    Python runs no handler while a kernel is at work in the main thread, and a kernel may take long. So a thread learns
    of every signal as well, and ends the process where the command has not ended in time. Files are written so that an
    end at any moment loses nothing. The first signal for which a command has a handler of its own (`run --follow`)
    is left to that.
    """

    def __init__(self) -> None:
        self.asked = False
        self._watch: _Watch | None = None
        self._before: Any = signal.SIG_DFL
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGTERM, self._ask)
            self._watch = _Watch((self._ask, signal.default_int_handler))

    @property
    def line(self) -> str:
        """What there is to say of it."""
        return f"stseg: {'terminated' if self.asked else 'interrupted'}"

    @property
    def status(self) -> int:
        """Exit status."""
        return TERMINATED if self.asked else INTERRUPTED

    def forget(self) -> None:
        """Restore the previous handler of SIGTERM."""
        if self._watch is not None:
            self._watch.close()
            self._watch = None
            signal.signal(signal.SIGTERM, self._before)

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True
        raise KeyboardInterrupt


class _Watch:
    """A thread that waits for signals.

    Parameters
    ----------
    orderly
        Handlers that end the command.
    """

    def __init__(self, orderly: tuple[Any, ...]) -> None:
        self._orderly, self._ended = orderly, threading.Event()
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
                elif not self._ended.wait(_PATIENCE):
                    _end(number)


def _end(number: int) -> None:
    """End this process and those that it has started, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
    said, status = ("terminated", TERMINATED) if number == signal.SIGTERM else ("interrupted", INTERRUPTED)
    with suppress(OSError):
        cursor = "\x1b[?25h" if os.isatty(2) else ""  # a progress bar has hidden it
        os.write(2, f"{cursor}stseg: {said}\n".encode())
    os._exit(status)
