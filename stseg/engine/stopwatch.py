"""Seconds of work of each stage, for the run file's table of timings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from stseg.arrays import Rows
from stseg.model.tables import TIMING


@dataclass
class Stopwatch:
    """Seconds of each stage since the last call of `take`."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add the duration of the body to a stage."""
        start = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - start

    def take(self, window: int) -> Rows:
        """TIMING rows of all stages under the number of a window; the sums start anew."""
        rows = np.array([(stage.encode(), window, s) for stage, s in self.seconds.items()], TIMING)
        self.seconds = {}
        return rows
