"""Who is who while a run still goes on: names of the run for the tracks of segments, window by window.

They are those by which the segments are joined at the end (`identity.seams`), as far as they can be known by now; the
run file decides meetings and gaps anew with the whole run (`identity.whole`).
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Rows
from stseg.tracking.stitching import matches

Names = dict[int, int]
"""From a segment's own names to those of the run."""


class LiveIds:
    """Names that have been given.

    Parameters
    ----------
    rows : TRAJECTORY (n,)
        What was said before, under names of the run.
    kept
        For how many frames back it must be known who was where.
    """

    def __init__(self, rows: Rows, kept: int) -> None:
        self._kept = kept
        self._issued = int(rows["id"].max(initial=0))
        self._recent = self._last(rows)

    def begin(self, lead: Rows) -> Names:
        """The names of a segment that begins, from the TRAJECTORY rows of its warm-up."""
        if not len(lead):
            return {}
        recent = self._recent
        return matches(recent[recent["frame"] >= lead["frame"].min()], lead)

    def named(self, rows: Rows, names: Names) -> Rows:
        """Rows of a segment under names of the run; who is new gets one, in `names` too."""
        for own in np.unique(rows["id"]).tolist():
            if own not in names:
                self._issued += 1
                names[own] = self._issued
        told = rows.copy()
        told["id"] = [names[own] for own in rows["id"].tolist()]
        self._recent = self._last(np.concatenate([self._recent, told]))
        return told

    def _last(self, rows: Rows) -> Rows:
        return np.asarray(rows[rows["frame"] > rows["frame"].max(initial=0) - self._kept])
