"""Truth of public data sets in the table that `stseg evaluate` reads: metres, frames from 0.

python tools/datasets.py cmc-truth GT_CMC1_WORLD_CENTROID.txt TABLE.csv
python tools/datasets.py wildtrack-truth annotations_positions TABLE.csv
python tools/datasets.py wildtrack-boxes annotations_positions FOLDER        a table a view
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import Rows
from stseg.io.track_csv import POSITION

__all__ = ["WILDTRACK_VIEWS", "cmc_truth", "wildtrack_annotated_boxes", "wildtrack_truth"]

WILDTRACK_VIEWS = ("CVLab1", "CVLab2", "CVLab3", "CVLab4", "IDIAP1", "IDIAP2", "IDIAP3")
"""Names of viewNum 0..6."""


def cmc_truth(path: Path) -> Rows:
    """CMC's `GT_*_WORLD_CENTROID.txt`: lines `frame id -1 x5 x y z hx hy hz`, frames from 1; POSITION (n,)."""
    lines = np.loadtxt(path, ndmin=2)
    table = np.zeros(len(lines), POSITION)
    table["frame"], table["id"] = lines[:, 0] - 1, lines[:, 1]
    table["x"], table["y"] = lines[:, 7], lines[:, 8]
    return table


def wildtrack_truth(folder: Path) -> Rows:
    """WILDTRACK's `annotations_positions`: the file numbered 5 k is frame k; POSITION (n,).

    Positions are numbers of a grid of 0.025 m cells, 480 to a row, that begins at (-3, -9) metres.
    """
    found = [(frame, person["personID"], person["positionID"]) for frame, person in _wildtrack_people(folder)]
    frame, identity, cell = np.array(found, np.int64).reshape(-1, 3).T
    table = np.zeros(len(found), POSITION)
    table["frame"], table["id"] = frame, identity
    table["x"], table["y"] = -3 + 0.025 * (cell % 480), -9 + 0.025 * (cell // 480)
    return table


def wildtrack_annotated_boxes(folder: Path, out_folder: Path) -> None:
    """Write the boxes of WILDTRACK's `annotations_positions` as `VIEW.csv` with frame, left, top, width, height."""
    lines: list[list[str]] = [["frame,left,top,width,height"] for _ in WILDTRACK_VIEWS]
    for frame, person in _wildtrack_people(folder):
        for view in person["views"]:
            left, top, right, bottom = (view[edge] for edge in ("xmin", "ymin", "xmax", "ymax"))
            if right > max(left, 0) and bottom > max(top, 0):  # -1 -1 -1 -1 says that the view does not see the person
                lines[view["viewNum"]].append(f"{frame},{left},{top},{right - left},{bottom - top}")
    out_folder.mkdir(parents=True, exist_ok=True)
    for name, own in zip(WILDTRACK_VIEWS, lines, strict=True):
        (out_folder / f"{name}.csv").write_text("\n".join(own) + "\n", encoding="utf-8")


def _wildtrack_people(folder: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    for path in sorted(folder.glob("*.json")):
        for person in json.loads(path.read_text(encoding="utf-8")):
            yield int(path.stem) // 5, person


if __name__ == "__main__":
    _, what, source, output = sys.argv
    if what == "wildtrack-boxes":
        wildtrack_annotated_boxes(Path(source), Path(output))
    else:
        truth = {"cmc-truth": cmc_truth, "wildtrack-truth": wildtrack_truth}[what](Path(source))
        np.savetxt(output, truth, "%d,%d,%.4f,%.4f,%d", header="frame,id,x,y,flag", comments="")
