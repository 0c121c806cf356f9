"""The pictures of docs/calibration.md: the ground's grid on a frame of a simulated scene, by a right and a wrong rig.

stseg simulate FOLDER --scene easy
python tools/calibration_pictures.py FOLDER docs/figures
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from check_figures import spoilt

from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_rig
from stseg.report.ground_grid import grid_picture

_FRAME, _VIEW, _WIDTH = 30, 0, 760


def main(folder: Path, output: Path) -> None:
    """Write rig_right.jpg and rig_turned.jpg."""
    recording = read_rig(folder / "rig.toml")
    with open_frames(recording, _FRAME, _FRAME + 1) as moments:
        (moment,) = list(moments)
    image = np.asarray(moment.views[_VIEW], np.uint8)
    wrong = spoilt(recording.rig, _VIEW, "turned 6 deg")
    for name, rig in (("rig_right", recording.rig), ("rig_turned", wrong)):
        picture = grid_picture(rig.cameras[_VIEW], rig.grid, image, _FRAME, _WIDTH)
        cv2.imwrite(str(output / f"{name}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 82])
        print(f"wrote {output / name}.jpg")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
