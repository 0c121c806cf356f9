"""Points as somebody would click them in the views of a rig, as CSV for `stseg calibrate points`.

    python tools/points_of_rig.py RIG.toml [SEED] > points.csv

Nine places on the ground of each view and two points 2 m above it, off by a pixel (standard deviation) in u and v, in
the real image, lens included.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from stseg.io.rigs import read_rig

_SHARES = (0.15, 0.5, 0.85)


def main(path: Path, seed: int) -> None:
    """Print the table."""
    rig, lots = read_rig(path).rig, np.random.default_rng(seed)
    x, y = (low + np.array(_SHARES) * (high - low) for low, high in (rig.grid.x, rig.grid.y))
    ground = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    place = np.concatenate([ground, ground[[0, 8]]])
    height = np.concatenate([np.zeros(9), [2.0, 2.0]])
    print("camera,u,v,x,y,z")
    for camera in rig.cameras:
        pixel, ahead = camera.project(place, height)
        clicked = pixel + lots.normal(0.0, 1.0, pixel.shape)
        for (u, v), (gx, gy), z, shown in zip(clicked, place, height, ahead & camera.inside(pixel), strict=True):
            if shown:
                print(f"{camera.name},{u:.1f},{v:.1f},{gx:.2f},{gy:.2f},{z:.1f}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) == 3 else 0)
