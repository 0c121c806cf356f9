"""Tracks for the analysis of pedestrians: PedPy and JuPedSim."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.io.runfile import layout
from stseg.io.runfile.reading.run_reader import Run

_JUPEDSIM_VERSION = 2  # PedPy refuses the area of version 3; JuPedSim reads both
_MOTION_TOLERANCE = 1e-6  # metres
_ONLY_AREA = 1  # its number among the areas of the recording; it does not change
_JUPEDSIM_TABLES = """
CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);
CREATE UNIQUE INDEX geometry_hash ON geometry(hash);
CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);
CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, pos_y REAL NOT NULL,
    ori_x REAL NOT NULL, ori_y REAL NOT NULL);
CREATE INDEX frame_id_idx ON trajectory_data(frame, id);
"""


def write_pedpy(path: Path, run: Run) -> None:
    """Write the text that PedPy and JuPedSim read: id, frame, x, y, z, metres, in the order of ids.

    PedPy takes the first number of the line with `framerate` for the rate and the units from `x/m`, so that these two
    comments say nothing else.
    """
    rate = np.format_float_positional(run.frame_rate, min_digits=2)
    table = run.trajectory[np.lexsort((run.trajectory["frame"], run.trajectory["id"]))]
    with path.open("w", newline="\n", encoding="utf-8") as file:
        file.write(f"# framerate: {rate}\n# id frame x/m y/m z/m\n")
        np.savetxt(file, table[["id", "frame", "x", "y", "z"]], fmt="%d %d %.4f %.4f %.4f")


def write_jupedsim(path: Path, run: Run) -> None:
    """Write JuPedSim's SQLite trajectory: the tracks, the frame rate, and the walkable area."""
    grid, area = run.recording.rig.grid, layout.walkable_area(run.recording.rig.grid)
    bounds = {"xmin": grid.x[0], "xmax": grid.x[1], "ymin": grid.y[0], "ymax": grid.y[1]}
    about = {"version": _JUPEDSIM_VERSION, "fps": run.frame_rate, **bounds}
    table = run.trajectory
    columns = [table[name].tolist() for name in ("frame", "id", "x", "y")] + headings(table).T.tolist()
    path.write_bytes(b"")  # SQLite would add to what is there
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(_JUPEDSIM_TABLES)
        database.executemany("INSERT INTO metadata VALUES(?, ?)", [(key, str(value)) for key, value in about.items()])
        database.execute("INSERT INTO geometry VALUES(?, ?)", (_ONLY_AREA, area))
        database.executemany(
            "INSERT INTO frame_data VALUES(?, ?)", [(frame, _ONLY_AREA) for frame in run.frames.tolist()]
        )
        database.executemany("INSERT INTO trajectory_data VALUES(?, ?, ?, ?, ?, ?)", zip(*columns, strict=True))


def headings(table: Rows) -> Floats:
    """Heading of each row's person, by central differences of positions, float64 (n, 2) of length 1.

    People who stand still, or exist for one frame, face along x: JuPedSim requires a direction.
    """
    order = np.lexsort((table["frame"], table["id"]))
    place, track = np.stack([table["x"], table["y"]], -1)[order], table["id"][order]
    begins = np.append(True, np.diff(track) != 0)[: len(track)]
    rows = np.arange(len(track))
    way = place[np.where(np.roll(begins, -1), rows, rows + 1)] - place[np.where(begins, rows, rows - 1)]
    length = np.hypot(*way.T)
    still = length < _MOTION_TOLERANCE
    heading = np.zeros((len(table), 2))
    heading[order] = np.where(still[:, None], (1.0, 0.0), way / np.where(still, 1.0, length)[:, None])
    return heading
