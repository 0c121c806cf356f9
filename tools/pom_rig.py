"""Make a rig of POM's test recording, which has no calibration, from the rectangles that it has instead.

    python tools/pom_rig.py FOLDER RIG.toml

`FOLDER/test.pom` says for every camera and every cell of a ground grid where a standing body would show: `RECTANGLE
camera cell left top right bottom`. The feet (middle of the bottom) give the homography from cells to pixels, the heads
(middle of the top) the vertical. How long a row of the grid is, is not said; feet lie on a plane only for rows of 36
(residual 0.3 pixels). Nor is the scale: with square pixels and the principal point in the middle of the image, a body
is 9.0 cells tall in the one view and 8.2 in the other, so a body of 1.75 m has cells of about 0.20 m.
"""

import sys
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.geometry import Camera, Grid, Rig
from stseg.geometry.fits import fit_homography, fit_vertical
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import write_rig

ROW, ROWS, CELL, BODY = 36, 37, 0.20, 1.75  # of cells; metres
SIZE, FRAME_RATE = (160, 120), 5.0  # pixels; frames per second, not said either


def read_rectangles(path: Path, camera: int) -> tuple[Floats, Floats]:
    """Where bodies stand, float64 (n, 2) metres, and their rectangles, float64 (n, 4): left, top, right, bottom."""
    words = (line.split() for line in path.read_text(encoding="ascii").splitlines())
    table = np.array([w[2:] for w in words if w[:2] == ["RECTANGLE", str(camera)] and w[3] != "notvisible"], float)
    cell = table[:, 0].astype(int)
    # Rows count downwards: counted upwards, the cameras would see a mirrored room.
    return CELL * np.stack([cell % ROW, ROWS - 1 - cell // ROW], -1).astype(float), table[:, 1:]


def fit_camera(name: str, ground: Floats, rectangle: Floats) -> Camera:
    """Homography and vertical from the rectangles that the image's border does not cut."""
    left, top, right, bottom = rectangle.T
    whole = (left > 0) & (right < SIZE[0] - 1) & (bottom < SIZE[1] - 1)
    middle = (left + right) / 2
    homography = fit_homography(ground[whole], np.stack([middle, bottom], -1)[whole])
    headed = whole & (top > 0)
    heads = np.stack([middle, top], -1)[headed]
    return Camera(name, SIZE, homography, fit_vertical(homography, ground[headed], np.full(len(heads), BODY), heads))


def main(folder: Path, output: Path) -> None:
    """Write the rig file."""
    cameras = tuple(fit_camera(f"c{k}", *read_rectangles(folder / "test.pom", k)) for k in range(2))
    sources = tuple(CameraSource(Source("masks", folder / "images" / f"view-f*-c{k}.png")) for k in range(2))
    grid = Grid((0.0, CELL * (ROW - 1)), (0.0, CELL * (ROWS - 1)))
    write_rig(output, Recording(output, Rig("pom", FRAME_RATE, grid, cameras), sources), overwrite=True)
    print(f"wrote {output}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
