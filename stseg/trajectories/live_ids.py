"""Provisional identities of a live run: run-wide names for the tracks of segments, window by window.

They follow the stitching of segments (`stitching`) as far as it is known by now; the run file decides
encounters and gaps again with the whole run (`stseg.trajectories.final_tracks`).
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Rows
from stseg.tracking.segment_stitching import matches
from stseg.trajectories.live_corrections import corrected

Names = dict[int, int]
"""Track of a segment to track of the run."""


class LiveIds:
    """The names given so far.

    Parameters
    ----------
    rows : TRAJECTORY (n,), corrections : CORRECTION (k,)
        Rows committed before, under names of the run, and what was corrected in them.
    kept
        Number of latest frames with rows for stitching.
    """

    def __init__(self, rows: Rows, corrections: Rows, kept: int) -> None:
        self._kept = kept
        self._issued = max(
            int(ids.max(initial=0)) for ids in (rows["id"], corrections["id"], corrections["corrected_id"])
        )
        self._recent = self._last(corrected(rows, corrections))

    def begin(self, lead: Rows) -> Names:
        """Names for a new segment, from the TRAJECTORY rows of its warm-up."""
        if not len(lead):
            return {}
        recent = self._recent
        return matches(recent[recent["frame"] >= lead["frame"].min()], lead)

    def named(self, rows: Rows, names: Names) -> Rows:
        """Rows of a segment under names of the run; `names` gains one for each new track, and for one of two alike."""
        used = set[int]()
        for track in np.unique(rows["id"]).tolist():
            if track not in names or names[track] in used:
                names[track] = self.new_id()
            used.add(names[track])
        named = rows.copy()
        named["id"] = [names[track] for track in rows["id"].tolist()]
        self._recent = self._last(np.concatenate([self._recent, named]))
        return named

    def new_id(self) -> int:
        """A name that was never given."""
        self._issued += 1
        return self._issued

    def correct(self, corrections: Rows) -> None:
        """Take CORRECTION rows into account."""
        self._recent = corrected(self._recent, corrections)

    def _last(self, rows: Rows) -> Rows:
        return np.asarray(rows[rows["frame"] > rows["frame"].max(initial=0) - self._kept])
