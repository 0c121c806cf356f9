"""Hand-over of excluded views: a camera that has failed before a segment begins is not used in it until it is sound.

A row has what was usual of a view before it failed. That stands while the view is excluded, so one that stays excluded
is handed over by the same row, bit for bit. Of a view that never showed more the next segment knows as much by itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stseg.arrays import Rows
from stseg.records.tables import EXCLUDED_VIEW
from stseg.view_health.view_failures import ViewFailures

NO_EXCLUDED_VIEWS = np.zeros(0, EXCLUDED_VIEW)
_RECENT_TIME = 1.0
"""Time of one person for which a failed view is taken to have shown nothing before a segment, seconds."""


class SegmentStart(NamedTuple):
    """Where a segment continues the one before."""

    first: int = 0
    """First frame of the segment after its warm-up."""
    excluded: Rows = NO_EXCLUDED_VIEWS
    """EXCLUDED_VIEW (n,): after the frame before."""


NOTHING_BEFORE = SegmentStart()


def excluded_rows(frame: int, failures: ViewFailures, since: Sequence[int | None]) -> Rows:
    """EXCLUDED_VIEW (n,) after a frame, by the first frame from which each view is excluded, None where it counts."""
    knocked = failures.knocks.knocked
    failed = knocked | failures.unproven
    views = np.flatnonzero(failed | np.array([first is not None for first in since]))
    rows = np.zeros(len(views), EXCLUDED_VIEW)
    if len(views):
        deviation = np.stack([span.sums for span in failures.deviation], 1)
        rows["frame"], rows["view"], rows["knocked"] = frame, views, knocked[views]
        rows["since"] = [-1 if (first := since[k]) is None else first for k in views.tolist()]
        rows["informedness"] = failures.usual.sums[views] * failed[views, None]
        rows["deviation"] = deviation[views] * failed[views, None, None]
        rows["share"] = failures.knocks.usual.sums[views] * knocked[views, None]
    return rows


def take_over(failures: ViewFailures, excluded: Rows) -> None:
    """Begin with the views excluded that have failed before: EXCLUDED_VIEW (n,)."""
    for row in excluded:
        k = row["view"]
        failures.usual.sums[k], failures.knocks.usual.sums[k] = row["informedness"], row["share"]
        for span, sums in zip(failures.deviation, row["deviation"], strict=True):
            span.sums[k] = sums
        failures.knocks.knocked[k] = row["knocked"]
        failures.failing[k] = failures.unproven[k] = not row["knocked"] and row["informedness"][0] > 0
        failures.recent[0].sums[k, 0] = _RECENT_TIME * failures.failing[k]
