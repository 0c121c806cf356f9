"""Points as somebody would click them in the views of a rig, for `stseg calibrate points`.

    python tools/points_of_rig.py RIG.toml FOLDER [SEED]

Writes FOLDER/points.csv: nine places on the ground of each view and two points 2 m above it, off by a pixel (standard
deviation) in u and v; and FOLDER/CAMERA.xml with the lens of each camera that has one.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.geometry import Lens
from stseg.io.recording.rigs import read_rig

_SHARES = (0.15, 0.5, 0.85)


def main(path: Path, folder: Path, seed: int) -> None:
    """Write the files."""
    rig, lots = read_rig(path).rig, np.random.default_rng(seed)
    x, y = (low + np.array(_SHARES) * (high - low) for low, high in (rig.grid.x, rig.grid.y))
    ground = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    place = np.concatenate([ground, ground[[0, 8]]])
    height = np.concatenate([np.zeros(9), [2.0, 2.0]])
    lines = ["camera,u,v,x,y,z"]
    folder.mkdir(parents=True, exist_ok=True)
    for camera in rig.cameras:
        pixel, ahead = camera.project(place, height)
        clicked = pixel + lots.normal(0.0, 1.0, pixel.shape)
        rows = zip(clicked, place, height, ahead & camera.inside(pixel), strict=True)
        lines += [
            f"{camera.name},{u:.1f},{v:.1f},{gx:.2f},{gy:.2f},{z:.1f}" for (u, v), (gx, gy), z, seen in rows if seen
        ]
        if camera.lens is not None:
            (folder / f"{camera.name}.xml").write_text(_xml(camera.lens), "utf-8")
    (folder / "points.csv").write_text("\n".join(lines) + "\n", "utf-8")


def _xml(lens: Lens) -> str:
    def node(name: str, numbers: Floats) -> str:
        return f"<{name}><data>{' '.join(map(repr, numbers.ravel().tolist()))}</data></{name}>"

    nodes = node("camera_matrix", lens.matrix) + node("distortion_coefficients", lens.distortion)
    return f"<opencv_storage>{nodes}</opencv_storage>\n"


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) == 4 else 0)
