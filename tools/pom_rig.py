"""Make a rig of POM's test recording, which has no calibration, from the rectangles that it has instead.

    python tools/pom_rig.py FOLDER RIG.toml

`FOLDER/test.pom` says for every camera and every cell of a ground grid where a standing body would show: `RECTANGLE
camera cell left top right bottom`. The feet (middle of the bottom) give the homography from cells to pixels, the heads
(middle of the top) the vertical. How long a row of the grid is, is not said; feet lie on a plane only for rows of 36
(residual 0.3 pixels). Nor is the scale: with square pixels and the principal point in the middle of the image, a body
is 9.0 cells tall in the one view and 8.2 in the other, so a body of 1.75 m has cells of about 0.20 m.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.geometry import Camera, Grid, Rig
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import write_rig

ROW, ROWS = 36, 37
CELL, BODY = 0.20, 1.75  # metres
SIZE = (160, 120)
FRAME_RATE = 5.0  # frames per second; not said either


def read_rectangles(path: Path, camera: int) -> tuple[Floats, Floats]:
    """Where bodies stand, float64 (n, 2) metres, and their rectangles, float64 (n, 4): left, top, right, bottom."""
    words = (line.split() for line in path.read_text(encoding="ascii").splitlines())
    rows = [w[2:] for w in words if w[:2] == ["RECTANGLE", str(camera)] and w[3] != "notvisible"]
    table = np.array(rows, float)
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
    return Camera(name, SIZE, homography, fit_vertical(homography, ground[headed], np.stack([middle, top], -1)[headed]))


def fit_homography(ground: Floats, pixel: Floats) -> Floats:
    """Direct linear transform with both sides brought to about unit size; float64 (3, 3), metres to pixels."""
    to_unit, from_unit = _unit(ground), np.linalg.inv(_unit(pixel))
    x, y, one = to_unit @ _homogeneous(ground)
    u, v, _ = _unit(pixel) @ _homogeneous(pixel)
    zero = np.zeros_like(x)
    along_u = np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], -1)
    along_v = np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], -1)
    unit = np.linalg.svd(np.concatenate([along_u, along_v]))[2][-1].reshape(3, 3)
    homography = from_unit @ unit @ to_unit
    return np.asarray(homography / np.linalg.norm(homography[2]))


def fit_vertical(homography: Floats, ground: Floats, head: Floats) -> Floats:
    """What one metre adds to the third column: least squares over heads `BODY` above the ground; float64 (3,)."""
    foot_u, foot_v, scale = homography @ _homogeneous(ground)
    u, v = head.T
    zero, one = np.zeros_like(u), np.ones_like(u)
    along_u = np.stack([one, zero, -u], -1) / scale[:, None]
    along_v = np.stack([zero, one, -v], -1) / scale[:, None]
    wanted = np.concatenate([u - foot_u / scale, v - foot_v / scale])
    return np.asarray(np.linalg.lstsq(np.concatenate([along_u, along_v]), wanted)[0] / BODY)


def _unit(point: Floats) -> Floats:
    """The similarity that brings points to mean 0 and unit size."""
    middle, size = point.mean(axis=0), point.std()
    return np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1]])


def _homogeneous(point: Floats) -> Floats:
    return np.concatenate([point.T, np.ones((1, len(point)))])


def main(folder: Path, output: Path) -> None:
    """Write the rig file."""
    cameras, sources = [], []
    for index in range(2):
        cameras.append(fit_camera(f"c{index}", *read_rectangles(folder / "test.pom", index)))
        sources.append(CameraSource(Source("masks", folder / "images" / f"view-f*-c{index}.png")))
    grid = Grid((0.0, CELL * (ROW - 1)), (0.0, CELL * (ROWS - 1)))
    write_rig(output, Recording(output, Rig("pom", FRAME_RATE, grid, tuple(cameras)), tuple(sources)))
    print(f"wrote {output}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
