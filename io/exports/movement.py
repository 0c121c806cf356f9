"""Tracks for the analysis of movement: PedPy, JuPedSim, and netCDF in the layout of the package `movement`.

The datasets of `movement` since 0.17: `position` (time, space, keypoint, individual) of poses, `position` and `shape`
(time, space, individual) of boxes, `confidence` beside both; NaN where an individual is not there. Each individual has
chunks of its own, so that the file holds no more than the tracks.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.arrays import Floats, Rows, ground_of
from stseg.io.extras import load_extra
from stseg.io.outputs.whole_files import MARK
from stseg.io.runfile import layout
from stseg.io.runfile.reading.run_reader import Run

_LONGEST_CHUNK = 4096  # frames
_JUPEDSIM_VERSION = 2  # PedPy refuses the area of version 3; JuPedSim reads both
_MOTION_TOLERANCE = 1e-6  # metres
_ONLY_AREA = 1  # its number among the areas of the recording; it does not change
_JUPEDSIM_TABLES = """
CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL /* made by stseg */);
CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);
CREATE UNIQUE INDEX geometry_hash ON geometry(hash);
CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);
CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, pos_y REAL NOT NULL,
    ori_x REAL NOT NULL, ori_y REAL NOT NULL);
CREATE INDEX frame_id_idx ON trajectory_data(frame, id);
"""


def write_movement(path: Path, run: Run) -> None:
    """Write a poses dataset: metres on the ground, one keypoint `ground`, confidence the probability of a person."""
    with _dataset(path, run, "poses", {"keypoint": ["ground"]}) as file:
        position = _variable(file, "position", ("time", "space", "keypoint", "individual"), "metres on the ground")
        confidence = _variable(file, "confidence", ("time", "keypoint", "individual"), "probability of a person")
        for individual, rows in rows_by_track(run, run.trajectory):
            span, ground = _filled(run, rows, ground_of(rows))
            position[span, :, 0, individual] = ground
            confidence[span, 0, individual] = _filled(run, rows, _probability(rows))[1]


def write_movement_boxes(path: Path, run: Run) -> None:
    """Write a bboxes dataset: centre and shape of the boxes, pixels, with a first dimension `view`.

    Confidence is the probability of a person, the same in all views.
    """
    with _dataset(path, run, "bboxes", {"view": run.cameras}) as file:
        axes = ("view", "time", "space", "individual")
        position, shape = _variable(file, "position", axes, "pixels"), _variable(file, "shape", axes, "pixels")
        confidence = _variable(file, "confidence", ("view", "time", "individual"), "probability of a person")
        places = dict(rows_by_track(run, run.trajectory))
        for individual, boxes in rows_by_track(run, run.boxes):
            for view in np.unique(boxes["view"]):
                rows = boxes[boxes["view"] == view]
                size = np.stack([rows["width"], rows["height"]], -1).astype(float)
                corner = np.stack([rows["left"], rows["top"]], -1).astype(float)
                visible = places[individual][np.isin(places[individual]["frame"], rows["frame"])]
                span, centre = _filled(run, rows, corner + size / 2)
                position[view, span, :, individual] = centre
                shape[view, span, :, individual] = _filled(run, rows, size)[1]
                confidence[view, span, individual] = _filled(run, rows, _probability(visible))[1]


@contextmanager
def _dataset(path: Path, run: Run, kind: str, names: dict[str, Sequence[str]]) -> Iterator[Any]:
    """A netCDF file with the coordinates that all have, and those of these names."""
    netcdf = load_extra("h5netcdf", "movement")
    individuals = [f"id_{number}" for number in run.tracks["id"].tolist()]
    texts = {**names, "space": ["x", "y"], "individual": individuals}
    with netcdf.File(path, "w") as file:
        file.attrs["history"] = MARK.decode()
        file.dimensions = {"time": len(run.frames), **{name: len(labels) for name, labels in texts.items()}}
        file.create_variable("time", ("time",), float, run.frames / run.frame_rate)
        for name, labels in texts.items():
            file.create_variable(name, (name,), h5py.string_dtype())[:] = np.array(labels, dtype=object)
        file.attrs["ds_type"], file.attrs["fps"], file.attrs["time_unit"] = kind, run.frame_rate, "seconds"
        file.attrs["source_software"], file.attrs["source_file"] = "stseg", run.path.name
        yield file


def _variable(file: Any, name: str, axes: tuple[str, ...], long_name: str) -> Any:
    """NaN everywhere; a chunk is one individual's, in one view."""
    lengths = {axis: file.dimensions[axis].size for axis in axes}
    chunks = {"time": min(lengths["time"], _LONGEST_CHUNK), "space": 2}
    shape = tuple(chunks.get(axis, 1) for axis in axes) if all(lengths.values()) else None
    variable = file.create_variable(
        name, axes, float, fillvalue=np.nan, chunks=shape, compression="gzip", compression_opts=1, shuffle=True
    )
    variable.attrs["long_name"] = long_name
    return variable


def rows_by_track(run: Run, table: Rows) -> Iterator[tuple[int, Rows]]:
    """Rows of each track in the order of frames, with the track's number among the tracks."""
    table = table[np.lexsort((table["frame"], table["id"]))]
    starts, stops = (np.searchsorted(table["id"], run.tracks["id"], side) for side in ("left", "right"))
    for individual, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        if stop > start:
            yield individual, table[start:stop]


def _filled(run: Run, rows: Rows, values: Floats) -> tuple[slice, Floats]:
    """From a track's first frame to its last, as a slice of the run's frames, the values (n, ...) with NaN between."""
    time = np.searchsorted(run.frames, rows["frame"])
    filled = np.full((time[-1] - time[0] + 1, *values.shape[1:]), np.nan)
    filled[time - time[0]] = values
    return slice(int(time[0]), int(time[-1]) + 1), filled


def _probability(rows: Rows) -> Floats:
    """Log-odds in nats as probability, float64 (n,)."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * rows["score"].astype(float))))


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
        database.executescript(f"PRAGMA journal_mode = OFF; {_JUPEDSIM_TABLES}")
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
    place, track = ground_of(table)[order], table["id"][order]
    begins = np.append(True, np.diff(track) != 0)[: len(track)]
    rows = np.arange(len(track))
    way = place[np.where(np.roll(begins, -1), rows, rows + 1)] - place[np.where(begins, rows, rows - 1)]
    length = np.hypot(*way.T)
    still = length < _MOTION_TOLERANCE
    heading = np.zeros((len(table), 2))
    heading[order] = np.where(still[:, None], (1.0, 0.0), way / np.where(still, 1.0, length)[:, None])
    return heading
