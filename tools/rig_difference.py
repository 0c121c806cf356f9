"""How far apart two rigs of the same cameras and world are, on the ground and at the height of heads.

    python tools/rig_difference.py TRUE.toml RIG.toml

Cells of the true rig's area are projected by its cameras and read back by the other's: distance in centimetres, on the
ground and on the plane 1.7 m above it, median and 95 % of the cells that the camera sees.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.io.recording.rigs import read_rig


def main(true: Path, other: Path) -> None:
    """Print a row for each camera."""
    rig, cameras = read_rig(true).rig, read_rig(other).rig.cameras
    print("| camera | ground cm, median | 95 % | at 1.7 m cm, median | 95 % |\n" + "| --- " * 5 + "|")
    for camera, found in zip(rig.cameras, cameras, strict=True):
        cells = [camera.name]
        for height in (0.0, 1.7):
            pixel, ahead = camera.project(rig.grid.ground, height)
            seen = ahead & camera.inside(pixel)
            off = 100 * np.hypot(*(found.back_project(pixel[seen], height) - rig.grid.ground[seen]).T)
            cells += [f"{value:.1f}" for value in np.nanquantile(off, (0.5, 0.95))]
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
