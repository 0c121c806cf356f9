"""The experiment that counts correctly labelled pixels."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from stseg.io.outputs.label_images import LabelImages

sys.path.append(str(Path(__file__).parents[2] / "tools"))

from experiments import pixels


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
    assert pixels.score(film, labels) == (3 / 5, 3 / 6)
