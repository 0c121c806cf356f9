"""Answers to SIGINT and SIGTERM: an orderly end where it comes in time, else an end at once."""

import _thread
import os
import signal
import sys
import threading
from contextlib import suppress
from types import FrameType
from typing import Any

from stseg.engine.stopping import Stopping, stopping

INTERRUPTED, TERMINATED = 130, 143
"""Exit status after SIGINT and SIGTERM."""

_PATIENCE = 1.5
"""Time for an orderly end, seconds: output is withdrawn, workers are ended."""
_AGAIN = 0.02
"""Time after which a dropped interrupt is repeated, seconds."""


class Termination:
    """SIGTERM acts as an interrupt: output is finished or withdrawn, and the command ends.

    Python runs no handler while a kernel is at work or compiled in the main thread, and an orderly end may be slow. So
    a thread learns of every signal as well, and ends the process where the command has not ended in time. Files are
    written so that an end at any moment loses nothing. The first signal to a run that goes on (`run --follow`) only
    asks it to finish. `advice` follows the word that says how the command ended.
    """

    def __init__(self, advice: str = "") -> None:
        self._advice = advice
        self._number: int | None = None
        self._watch: _Watch | None = None
        self._before: dict[int, Any] = {}
        self._unraisable = sys.unraisablehook
        if threading.current_thread() is threading.main_thread():
            self._before[signal.SIGTERM] = signal.signal(signal.SIGTERM, self._interrupt)
            if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
                self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._interrupt)
            self._watch = _Watch(advice)
            sys.unraisablehook = self._repeat_interrupt

    @property
    def end_requested(self) -> bool:
        """Whether the command was asked to end."""
        return self._number is not None

    @property
    def line(self) -> str:
        """Message for standard error."""
        return f"stseg: {'terminated' if self._number == signal.SIGTERM else 'interrupted'}{self._advice}"

    @property
    def status(self) -> int:
        """Exit status."""
        return TERMINATED if self._number == signal.SIGTERM else INTERRUPTED

    def forget(self) -> None:
        """Restore the previous handlers."""
        if self._watch is not None:
            self._watch.close()
            self._watch = None
            sys.unraisablehook = self._unraisable
            for number, handler in self._before.items():
                signal.signal(number, handler)

    def _repeat_interrupt(self, unraisable: Any) -> None:
        """Repeat an interrupt that came while C code called Python, which cannot raise it, instead of reporting it."""
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            self._unraisable(unraisable)
        elif self._number is not None:
            again = threading.Timer(_AGAIN, _thread.interrupt_main, (self._number,))
            again.daemon = True
            again.start()

    def _interrupt(self, number: int, _frame: FrameType | None) -> None:
        self._number = number
        raise KeyboardInterrupt


class _Watch:
    """A thread that waits for signals, and for the end of the command after one."""

    def __init__(self, advice: str) -> None:
        self._advice = advice
        self._ended = threading.Event()
        self._reader, self._writer = os.pipe()
        if hasattr(os, "set_blocking"):  # not in Python 3.11 on Windows
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
        left_to: Stopping | None = None
        while numbers := os.read(self._reader, 64):
            for number in numbers:
                if number not in (signal.SIGINT, signal.SIGTERM):
                    continue
                if (going_on := stopping()) is not None and going_on is not left_to:
                    left_to = going_on
                    going_on.ask()
                elif not self._ended.wait(_PATIENCE):
                    _end(number, self._advice)


def _end(number: int, advice: str) -> None:
    """End this process and those that it has started, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
    word, status = ("terminated", TERMINATED) if number == signal.SIGTERM else ("interrupted", INTERRUPTED)
    with suppress(OSError, ValueError):
        error = sys.stderr.fileno()  # not the stream, in which a lock may be held
        cursor = "\x1b[?25h" if os.isatty(error) else ""  # a progress bar has hidden it
        os.write(error, f"{cursor}stseg: {word}{advice}\n".encode())
    os._exit(status)
