"""Statistics of a run: people a minute, ground by number of views."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Bytes, Flags, Floats, Ints, Rows


def people_per_minute(frames: Ints, trajectory: Rows, frame_rate: float) -> Floats:
    """Mean number of people in each minute of the run that has frames, the last one perhaps shorter.

    Parameters
    ----------
    frames : int64 (time,)
        The run's frames.
    trajectory : TRAJECTORY (n,)
    frame_rate
        Frames per second.

    Returns
    -------
    float64 (minute,)
    """
    if not len(frames):
        return np.zeros(0)
    length = max(1, round(60 * frame_rate))
    minute, rows = (frames - frames[0]) // length, (trajectory["frame"] - frames[0]) // length
    frame_count = np.bincount(minute)
    people = np.bincount(rows, minlength=len(frame_count))[: len(frame_count)]
    return np.asarray(people[frame_count > 0] / frame_count[frame_count > 0], float)


def ground_by_views(views: Bytes, inside: Flags, cameras: int) -> Floats:
    """Share of the area of interest that 0, 1, 2, ... views see at some height, float64 (cameras + 1,).

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    inside : bool (y, x)
        Cells of the area of interest.
    cameras
        Number of cameras.
    """
    view_count = views.max(axis=0)[inside]
    return np.asarray(np.bincount(view_count, minlength=cameras + 1) / max(len(view_count), 1), float)
