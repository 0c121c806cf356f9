"""Short tracks are dropped (Huang and Wang 2012, section V.E)."""

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import TrackingConfig
from stseg.records.tables import EVENT


def drop_short(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> tuple[Ints, Rows]:
    """Drop tracks shorter than `tracking.minimum_duration`.

    Returns
    -------
    int64 (k,), EVENT
        Ids of the tracks that stay; one event for each dropped track.
    """
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    least = max(2, round(config.minimum_duration * frame_rate))
    short = counts < least
    first = np.full(len(ids), np.iinfo(np.int64).max)
    np.minimum.at(first, where, trajectory["frame"])
    events = np.zeros(int(short.sum()), EVENT)
    events["frame"], events["kind"], events["id"] = first[short], b"dropped", ids[short]
    events["reason"] = [f"{count} frames, shorter than {least}" for count in counts[short]]
    return ids[~short], events
