"""Heights of tracks by the rows that measured one: a row that was not measured has the height nan."""

import numpy as np

from stseg.arrays import Floats, Rows, Singles
from stseg.geometry.rig import BODY_HEIGHT


def median_measured(size: Floats) -> float:
    """Median of the sizes that are finite; nan without."""
    finite = size[np.isfinite(size)]
    return float(np.median(finite)) if len(finite) else np.nan


def heights(trajectory: Rows) -> Singles:
    """Height to draw the body of each row by, float32 (n,), metres.

    A row without one has its track's median, or that of a standing person. `trajectory` is TRAJECTORY (n,), in any
    order.
    """
    tall, unknown = trajectory["height"].copy(), ~np.isfinite(trajectory["height"])
    order = np.argsort(trajectory["id"], kind="stable")
    for of_track in np.split(order, np.flatnonzero(np.diff(trajectory["id"][order])) + 1):
        height = median_measured(trajectory["height"][of_track])
        tall[of_track[unknown[of_track]]] = height if np.isfinite(height) else BODY_HEIGHT
    return tall


def with_heights(trajectory: Rows) -> Rows:
    """A copy to draw bodies by, in which every row has its height."""
    rows = trajectory.copy()
    rows["height"] = heights(trajectory)
    return rows
