"""Garbage collection of this program's own processes.

Reference counts free all that a frame makes; the collector of cycles finds nothing in hours, and visits imports,
tables and tracks for it: 3 % of a run's time with Python's thresholds.
"""

import gc

_THRESHOLDS = 100_000, 20, 100
"""Objects made and not freed at which the youngest are visited, and how many such visits lead to one of the older."""


def collect_rarely() -> None:
    """Visit the living objects of this process rarely."""
    gc.set_threshold(*_THRESHOLDS)
