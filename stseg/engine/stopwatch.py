"""Seconds of work of each stage, for the run file's table of timings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock
from time import perf_counter

import numpy as np

from stseg.arrays import Rows
from stseg.records.tables import TIMING


@dataclass
class Stopwatch:
    """Seconds of each stage since the last call of `take`; stages may run in threads of their own."""

    seconds: dict[str, float] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add the duration of the body to a stage."""
        start = perf_counter()
        try:
            yield
        finally:
            with self._lock:
                self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - start

    def take(self, window: int) -> Rows:
        """TIMING rows of all stages under the number of a window; the sums start anew."""
        with self._lock:
            seconds, self.seconds = self.seconds, {}
        return np.array([(stage.encode(), window, s) for stage, s in seconds.items()], TIMING)
