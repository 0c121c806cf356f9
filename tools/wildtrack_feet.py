"""How far WILDTRACK's annotated feet lie from where the calibration shows the annotated places.

    python tools/wildtrack_feet.py RIG.toml WILDTRACK_FOLDER

The rig is one that `stseg calibrate import opencv` made. Of each view and every fifth frame, people shown whole:
the distance from the middle of the lower edge of their box to the projection of their place, in pixels and, on the
ground, in centimetres: medians and 95 %. (The boxes were drawn by projecting a cylinder from that place, so this checks
the import, not the world.)
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from stseg.io.recording.rigs import read_rig


def main(rig: Path, folder: Path) -> None:
    """Print a row for each view."""
    cameras = read_rig(rig).rig.cameras
    found: list[list[tuple[float, ...]]] = [[] for _ in cameras]
    for path in sorted((folder / "annotations_positions").glob("*.json"))[::5]:
        for person in json.loads(path.read_text("utf-8")):
            row, column = divmod(person["positionID"], 480)
            for view in person["views"]:
                if view["xmin"] > 1 and view["xmax"] < 1918 and view["ymin"] > 1 and view["ymax"] < 1078:
                    foot = ((view["xmin"] + view["xmax"]) / 2, view["ymax"])
                    found[view["viewNum"]].append((*foot, -3 + 0.025 * column, -9 + 0.025 * row))
    print("| view | people | off px, median | 95 % | on the ground cm, median | 95 % |\n" + "| --- " * 6 + "|")
    for camera, rows in zip(cameras, found, strict=True):
        table = np.array(rows)
        pixel, ground = table[:, :2], table[:, 2:]
        off = np.hypot(*(camera.project(ground, 0.0)[0] - pixel).T)
        metres = np.hypot(*(camera.back_project(pixel) - ground).T)
        middle, most = np.quantile(off, (0.5, 0.95))
        near, far = 100 * np.nanquantile(metres, (0.5, 0.95))
        print(f"| {camera.name} | {len(table)} | {middle:.1f} | {most:.1f} | {near:.1f} | {far:.1f} |")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
