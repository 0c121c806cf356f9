"""Results within the area alone: people who cross its border are followed a little beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stseg.geometry import Rig
from stseg.trackers import Commit


def within_area(commit: Commit, rig: Rig) -> Commit:
    """A commit without the rows, and labels, of people outside the area; in closed rooms nobody is outside."""
    rows = commit.trajectory
    inside = rig.grid.contains(np.stack([rows["x"], rows["y"]], -1))
    if rig.closed or inside.all():
        return commit
    label, outside = commit.label.copy(), rows[~inside]
    for fused, cells in zip(commit.frames, label, strict=True):
        cells[np.isin(cells, outside["id"][outside["frame"] == fused.frame])] = 0
    return replace(commit, label=label, trajectory=rows[inside])
