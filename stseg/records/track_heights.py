"""Heights of tracks by the rows that measured one: a row that was not measured has the height nan."""

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.geometry.rig import BODY_HEIGHT


def median_measured(size: Floats) -> float:
    """Median of the sizes that are finite; nan without."""
    finite = size[np.isfinite(size)]
    return float(np.median(finite)) if len(finite) else np.nan


def with_heights(trajectory: Rows) -> Rows:
    """A copy to draw bodies by: a row without a height has its track's median, or that of a standing person.

    `trajectory` is TRAJECTORY (n,), in any order.
    """
    rows, unknown = trajectory.copy(), ~np.isfinite(trajectory["height"])
    order = np.argsort(rows["id"], kind="stable")
    for of_track in np.split(order, np.flatnonzero(np.diff(rows["id"][order])) + 1):
        height = median_measured(trajectory["height"][of_track])
        rows["height"][of_track[unknown[of_track]]] = height if np.isfinite(height) else BODY_HEIGHT
    return rows
