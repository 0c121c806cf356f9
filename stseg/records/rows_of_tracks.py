"""Rows of each track of a run, found at once: a day has thousands of tracks, too many to search all rows for each."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints


def rows_of_tracks(ids: Ints) -> list[Ints]:
    """Rows of each track (`ids` int64 (n,) of all rows), by rising id; each in the order of the rows."""
    order = np.argsort(ids, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(ids[order])) + 1) if len(order) else []
