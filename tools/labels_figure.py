"""Label images of all cameras in one picture: python tools/labels_figure.py LABELS FRAME PICTURE.png [RIG]

The cameras of the folder LABELS, two in a row, in the tracks' colours. With RIG, each above its camera's frame; of
recordings of people, that shows them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_rig

_COLUMNS = 2


def label_pictures(folder: Path, frame: int) -> list[Bytes]:
    """The cameras' label images, uint8 (v, u, 3)."""
    paths = [camera / f"{frame:06d}.png" for camera in sorted(folder.iterdir())]
    pictures = [cv2.imread(str(path), cv2.IMREAD_COLOR) for path in paths]
    return [np.asarray(picture, np.uint8) for picture in pictures if picture is not None]


def camera_frames(rig: Path, frame: int) -> list[Bytes]:
    """What the cameras of a rig saw at a frame, in the order of their names."""
    recording = read_rig(rig)
    names = [camera.name for camera in recording.rig.cameras]
    with open_frames(recording, frame, frame + 1) as moments:
        (moment,) = moments
    return [np.asarray(moment.views[names.index(name)], np.uint8) for name in sorted(names)]


def main() -> None:
    """Write the picture."""
    folder, frame, picture, *rig = sys.argv[1:]
    tiles = label_pictures(Path(folder), int(frame))
    if rig:
        seen = camera_frames(Path(rig[0]), int(frame))
        tiles = [np.concatenate(pair) for pair in zip(tiles, seen, strict=True)]
    rows = [np.hstack(tiles[k : k + _COLUMNS]) for k in range(0, len(tiles), _COLUMNS)]
    cv2.imwrite(picture, np.vstack(rows))


if __name__ == "__main__":
    main()
