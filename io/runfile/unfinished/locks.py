"""File locks: one writer at a time."""

from __future__ import annotations

from typing import IO

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows has no such locks: two runs into one file go unnoticed there

    def lock(file: IO[bytes]) -> None:
        """Hold a file until it is closed; BlockingIOError where another process holds it."""
else:

    def lock(file: IO[bytes]) -> None:
        """Hold a file until it is closed; BlockingIOError where another process holds it."""
        try:
            flock(file, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks
