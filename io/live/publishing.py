"""Rows of the live table, and corrections of its ids, sent on as JSON lines.

A thread sends what a queue holds, so a slow or missing receiver never delays tracking. While it cannot be reached the
newest messages wait, as many as `_WAITING`; older ones are dropped, and the live table has them still.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, Full, Queue
from threading import Event, Thread
from types import TracebackType
from typing import Any, Self

from stseg.arrays import Rows
from stseg.io.live.correction_table import COLUMNS
from stseg.io.live.receivers import Receiver
from stseg.io.recording.recording import mask_passwords

_WAITING = 1000
"""Messages that wait for a receiver, one a window."""
_RETRY = 2.0
"""Time between attempts, seconds."""
_ENDING = 10.0
"""Longest time in which the last messages are sent after the run, seconds."""


class Publisher:
    """Sends rows of tracks to a receiver while it is open.

    Parameters
    ----------
    receiver
    frame_rate
        Frames per second.
    report
        Receives a line when the receiver stops to answer, when it is back, and of what was dropped.
    """

    def __init__(self, receiver: Receiver, frame_rate: float, report: Callable[[str], None]) -> None:
        self._receiver, self._frame_rate, self._report = receiver, frame_rate, report
        self._messages: Queue[bytes] = Queue(_WAITING)
        self._dropped, self._ending, self._leaving = 0, Event(), Event()
        self._thread = Thread(target=self._run, name="publisher", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        self._thread.join(_ENDING)
        self._leaving.set()
        left = self._dropped + self._messages.qsize()
        if left:
            self._report(f"{left} messages were not published; the live table has their rows")

    def append(self, rows: Rows) -> None:
        """Send TRAJECTORY rows as one message, a JSON object a line; returns at once."""
        if not len(rows):
            return
        self._send([self._object(row) for row in rows])

    def correct(self, corrections: Rows) -> None:
        """Send CORRECTION rows as one message likewise."""
        if len(corrections):
            self._send([dict(zip(COLUMNS, one, strict=True)) for one in corrections.tolist()])

    def _send(self, objects: Sequence[dict[str, object]]) -> None:
        message = "".join(f"{json.dumps(one)}\n" for one in objects).encode()
        while True:
            try:
                self._messages.put_nowait(message)
                return
            except Full:
                with suppress(Empty):
                    self._messages.get_nowait()
                    self._dropped += 1

    def _object(self, row: Any) -> dict[str, object]:
        frame, numbers = int(row["frame"]), ("x", "y", "height", "score")
        about: dict[str, object] = {"frame": frame, "time": round(frame / self._frame_rate, 3), "id": int(row["id"])}
        return about | {name: round(float(row[name]), 3) for name in numbers}

    def _run(self) -> None:
        while not (self._ending.is_set() and self._messages.empty()):
            try:
                message = self._messages.get(timeout=0.1)
            except Empty:
                continue
            if not self._deliver(message):
                self._dropped += 1
                break
        with suppress(OSError):
            self._receiver.close()

    def _deliver(self, message: bytes) -> bool:
        """Send a message, again and again until it is received; whether it was before the end."""
        is_failing = False
        while True:
            try:
                self._receiver.send(message)
            except OSError as error:
                if not is_failing:
                    self._report(f"publishing waits for its receiver ({mask_passwords(str(error))})")
                is_failing = True
                if self._leaving.wait(_RETRY) or self._ending.is_set():
                    return False
            else:
                if is_failing:
                    self._report("publishing goes on")
                return True
