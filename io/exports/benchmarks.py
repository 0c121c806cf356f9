"""Tracks as the benchmarks of tracking want them: MOTChallenge and WILDTRACK."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from stseg.arrays import Ints, Rows, Singles
from stseg.geometry import Grid
from stseg.io.outputs.whole_files import MARK
from stseg.io.runfile.reading.run_reader import Run

WILDTRACK_STEP = 0.025
"""Distance of neighbouring positions of WILDTRACK's grid, metres."""

_NOT_SEEN = {"xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1}


def write_mot(path: Path, run: Run) -> None:
    """Write 3-D MOTChallenge lines: frame, id, -1, -1, -1, -1, 1, x, y, z.

    Frames count from 1 there; places are metres, and -1 stands for the box that a place on the ground has not.
    """
    table = run.trajectory
    columns = [table[name] for name in ("x", "y", "z")]
    with path.open("w", newline="\n", encoding="utf-8") as file:
        for frame, number, x, y, z in zip(table["frame"] + 1, table["id"], *columns, strict=True):
            file.write(f"{frame},{number},-1,-1,-1,-1,1,{x:.4f},{y:.4f},{z:.4f}\n")


def write_mot_boxes(path: Path, run: Run) -> None:
    """Write a zip of 2-D MOTChallenge lines, `CAMERA.txt` each: frame, id, left, top, width, height, 1, -1, -1, -1.

    Frames count from 1 there; left and top are edges in pixels of the real image, counted from 0 as in the boxes that
    we read: MOTChallenge's own files count pixels from 1.
    """
    texts = {}
    for view, camera in enumerate(run.cameras):
        boxes = run.boxes[run.boxes["view"] == view]
        boxes = boxes[np.lexsort((boxes["id"], boxes["frame"]))]
        lines = (
            f"{row['frame'] + 1},{row['id']},{row['left']:.2f},{row['top']:.2f},"
            f"{row['width']:.2f},{row['height']:.2f},1,-1,-1,-1\n"
            for row in boxes
        )
        texts[f"{camera}.txt"] = "".join(lines)
    write_zip(path, texts.items())


def write_wildtrack(path: Path, run: Run) -> None:
    """Write a zip of WILDTRACK's `annotations_positions`: one JSON file a frame, and `grid.json`, which says the grid.

    positionID counts the points of a grid row by row, x first, from the least corner of the run's ground rectangle,
    0.025 m apart: for x = [-3, 9], y = [-9, 27], the area of WILDTRACK, its own 480 x 1440 points. The file is named
    after the recording's frame, viewNum counts the cameras from 0 in the rig's order, and -1 stands for the edges of a
    box in a view that does not see the person.
    """
    grid = run.recording.rig.grid
    columns, rows = wildtrack_size(grid)
    about = {"x": grid.x[0], "y": grid.y[0], "step": WILDTRACK_STEP, "columns": columns, "rows": rows}
    boxes = _boxes_of_rows(run)
    positions = wildtrack_positions(run.trajectory, grid)
    people: dict[int, list[dict[str, object]]] = {int(frame): [] for frame in run.frames}
    for row, position in zip(run.trajectory, positions.tolist(), strict=True):
        key = int(row["frame"]), int(row["id"])
        views = [{"viewNum": view, **boxes.get((*key, view), _NOT_SEEN)} for view in range(len(run.cameras))]
        people[key[0]].append({"personID": key[1], "positionID": position, "views": views})
    files = ((f"annotations_positions/{frame:08d}.json", json.dumps(rows, indent=4)) for frame, rows in people.items())
    write_zip(path, [("grid.json", json.dumps(about, indent=4)), *files])


def wildtrack_size(grid: Grid) -> tuple[int, int]:
    """Columns and rows of WILDTRACK's grid over the ground rectangle; at least one of each."""
    columns, rows = (max(1, round((high - low) / WILDTRACK_STEP)) for low, high in (grid.x, grid.y))
    return columns, rows


def wildtrack_positions(trajectory: Rows, grid: Grid) -> Ints:
    """positionID of every row, int64 (n,): the nearest point of the grid, at its edge for places beyond it."""
    columns, rows = wildtrack_size(grid)
    column = np.rint((trajectory["x"] - grid.x[0]) / WILDTRACK_STEP).clip(0, columns - 1)
    row = np.rint((trajectory["y"] - grid.y[0]) / WILDTRACK_STEP).clip(0, rows - 1)
    return np.asarray(row * columns + column, np.int64)


def _boxes_of_rows(run: Run) -> Mapping[tuple[int, int, int], Mapping[str, int]]:
    """Edges of boxes in whole pixels, by frame, id and view."""
    boxes = run.boxes
    corner: Singles = np.stack([boxes["left"], boxes["top"]], -1)
    size: Singles = np.stack([boxes["width"], boxes["height"]], -1)
    edges = np.rint(np.hstack([corner, corner + size])).astype(int).tolist()
    keys = zip(boxes["frame"].tolist(), boxes["id"].tolist(), boxes["view"].tolist(), strict=True)
    return {key: dict(zip(_NOT_SEEN, values, strict=True)) for key, values in zip(keys, edges, strict=True)}


def write_zip(path: Path, texts: Iterable[tuple[str, str]]) -> None:
    """A zip of text files that is the same whenever it is written."""
    with ZipFile(path, "w") as archive:
        archive.comment = MARK
        for name, text in texts:
            archive.writestr(ZipInfo(name), text, ZIP_DEFLATED)
