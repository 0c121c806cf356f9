"""The tools that learn the labels' constants and count right pixels."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from stseg.io.outputs.label_images import LabelImages

sys.path.append(str(Path(__file__).parents[1] / "tools"))

import learn_label_weights
import pixel_accuracy


def test_the_programme_makes_the_truth_better_by_the_margin_wherever_it_can() -> None:
    rows = np.array(
        [
            [0, 1.0, 0.0, -0.5, 1],  # c1 - 0.5 >= 1
            [0, 0.0, 1.0, -2.0, 1],  # c2 - 2 >= 1
            [1, -1.0, 0.0, 3.0, 1],  # 3 - c1 >= 1
        ]
    )
    detection, adjacency = learn_label_weights.programme(rows, np.array([1, 1]), margin=1.0)
    assert 1.5 - 1e-9 <= detection <= 2.0 + 1e-9
    assert adjacency >= 3.0 - 1e-9


def test_where_the_truth_cannot_be_the_best_the_larger_loss_counts() -> None:
    rows = np.array([[0, 1.0, 0.0, 0.0, 1], [1, -1.0, 0.0, 1.0, 1], [1, -4.0, 1.0, 1.0, 1]])
    detection, adjacency = learn_label_weights.programme(rows, np.array([1, 1]), margin=1.0)
    assert detection == pytest.approx(0.0, abs=1.0)
    assert adjacency >= 4 * detection - 1e-9


def test_tracks_are_matched_to_people_one_to_one_for_the_whole_film(tmp_path: Path) -> None:
    film, labels = tmp_path / "film", tmp_path / "labels"
    (film / "west_instances").mkdir(parents=True)
    (film / "truth.csv").write_text("frame,id,x,y,height\n0,5,0,0,1.7\n1,5,0,0,1.7\n1,6,1,0,1.7\n")
    images = LabelImages(labels, ["west"], 9, np.zeros((256, 3), np.uint8), overwrite=False)
    truth = np.array([[[5, 5, 6, 0]], [[5, 5, 6, 0]]])  # in frame 0 the second stands outside the area
    found = np.array([[[9, 9, 9, 9]], [[8, 9, 9, 0]]])
    for frame in range(2):
        path = film / "west_instances" / f"{frame:06d}.png"
        assert cv2.imwrite(str(path), truth[frame].astype(np.uint16))
        images.write("west", frame, found[frame])
    # 5 is 9 in three of four pixels; 6 gets no track, as 8 shares no pixel with it
    assert pixel_accuracy.score(film, labels) == (3 / 5, 3 / 6)
