"""What the tool that measures heights matches."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.records.tables import TRAJECTORY

sys.path.append(str(Path(__file__).parents[2] / "tools"))

from experiments import sizes

TRUTH = np.dtype([("frame", "<f8"), ("id", "<f8"), ("x", "<f8"), ("y", "<f8"), ("height", "<f8")])


def test_people_are_matched_to_the_nearest_track_within_the_gate() -> None:
    frames = np.arange(sizes.LEAST)
    truth, found = np.zeros((2, len(frames)), TRUTH), np.zeros((2, len(frames)), TRAJECTORY)
    truth["frame"] = found["frame"] = frames
    truth["id"], found["id"] = [[1], [2]], [[7], [9]]
    truth["x"], found["x"] = [[0.0], [3.0]], [[2.9], [0.2]]
    found["x"][0, -1] = 4.0  # beyond the gate once: too few frames to tell
    people = sizes.matched(found.ravel(), truth.ravel(), 0.5)
    assert list(people) == [1]
    rows, own = people[1]
    np.testing.assert_array_equal(rows["id"], 9)
    np.testing.assert_array_equal(rows["frame"], own["frame"])
