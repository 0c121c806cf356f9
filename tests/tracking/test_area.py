"""Results within the area: nobody outside it has a row or a label."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import boxes, found, people, room

from stseg import Tracker
from stseg.arrays import Floats, Observation
from stseg.engine.committed_frames import within_area
from stseg.geometry import Grid, Rig
from stseg.records.sparse_volume import SparseVolume
from stseg.records.tables import EVENT, TRAJECTORY, WINDOW
from stseg.trackers import Commit, FusedFrame

FIRST, PLACES = 7, [(0.1, 0.0), (-0.2, 0.5), (1.02, 0.2), (-0.4, -1.01)]
TRIANGLE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)])


def rig_of_area(polygon: Floats | None = None, closed: bool = False) -> Rig:
    grid = Grid(x=(-1.0, 1.0), y=(-1.0, 1.0), planes=2, polygon=polygon)
    return replace(room(), grid=grid, closed=closed)


def commit_of(rig: Rig) -> Commit:
    """Two frames in each of which tracks 1, 2, ... are at PLACES, and have a cell each."""
    rows = np.zeros(2 * len(PLACES), TRAJECTORY)
    rows["frame"] = np.repeat([FIRST, FIRST + 1], len(PLACES))
    rows["id"] = np.tile(np.arange(1, len(PLACES) + 1), 2)
    rows["x"], rows["y"] = np.tile(np.array(PLACES), (2, 1)).T
    rows["x"][-2] = 0.98  # in its second frame the third is back
    label = np.zeros((2, *rig.grid.shape), np.int32)
    label[:, 0, 0, : len(PLACES)] = np.arange(1, len(PLACES) + 1)
    nobody, empty = found(people()), SparseVolume.whole(np.zeros(rig.grid.shape, np.float32))
    frames = [FusedFrame(frame, nobody, nobody, empty) for frame in (FIRST, FIRST + 1)]
    return Commit(frames, label, rows, np.zeros(0, EVENT), np.zeros(0, WINDOW))


@pytest.mark.parametrize(
    ("polygon", "closed", "inside"),
    [
        (None, False, [[1, 2], [1, 2, 3]]),
        (TRIANGLE, False, [[1], [1, 3]]),
        (None, True, [[1, 2, 3, 4], [1, 2, 3, 4]]),
    ],
    ids=["rectangle", "polygon", "closed"],
)
def test_rows_and_labels_are_of_people_inside(polygon: Floats | None, closed: bool, inside: list[list[int]]) -> None:
    rig = rig_of_area(polygon, closed)
    whole = commit_of(rig)
    kept = within_area(whole, rig)
    for k, ids in enumerate(inside):
        rows = kept.trajectory[kept.trajectory["frame"] == FIRST + k]
        assert rows["id"].tolist() == ids
        assert np.setdiff1d(kept.label[k], [0]).tolist() == ids
    assert np.setdiff1d(whole.label, [0]).tolist() == [1, 2, 3, 4]  # what a tracker holds is not changed


def test_who_walks_out_is_tracked_up_to_the_border() -> None:
    rig = replace(room(), frame_rate=10.0)
    edge, tracker, results = rig.grid.x[1], Tracker(rig), []
    places = [np.array([[edge - 0.8 + 0.05 * frame, 0.3, 1.7], [0.2, -0.9, 1.7]]) for frame in range(26)]
    for standing in places:
        views: list[Observation] = [boxes(camera, standing) for camera in rig.cameras]
        results += tracker.add(views)
    results += tracker.finish()
    rows = np.concatenate([result.trajectory for result in results])
    assert rig.grid.contains(np.stack([rows["x"], rows["y"]], -1)).all()
    walker = rows[rows["y"] > 0]
    true = np.array([standing[0, 0] for standing in places])
    assert walker["frame"].tolist() == np.flatnonzero(true < edge - 0.025).tolist()
