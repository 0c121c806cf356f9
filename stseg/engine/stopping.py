"""A run that has no end of its own stops when it is asked to: by Ctrl-C or SIGTERM, and finishes what it has begun."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def stop_asked() -> Iterator[threading.Event]:
    """An event that the first interrupt or SIGTERM sets; the next does what it did before."""
    halt = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def handle(number: int, frame: FrameType | None) -> None:
        ending = before[signal.Signals(number)]
        if not halt.is_set():
            halt.set()
            # Not print: the signal may have come in the middle of one.
            os.write(sys.stderr.fileno(), b"stseg: finishing; once more to stop at once\n")
        elif callable(ending):
            ending(number, frame)

    ours = [number for number, ending in before.items() if callable(ending)]
    if threading.current_thread() is not threading.main_thread():
        ours = []
    for number in ours:
        signal.signal(number, handle)
    try:
        yield halt
    finally:
        for number in ours:
            signal.signal(number, before[number])
