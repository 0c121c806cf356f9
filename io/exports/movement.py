"""Tracks as netCDF in the layout of `movement`, the package for the analysis of animals' movement.

Its datasets since 0.17: `position` (time, space, keypoint, individual) of poses, `position` and `shape`
(time, space, individual) of boxes, `confidence` beside both; NaN where an individual is not there. Each individual has
chunks of its own, so that the file holds no more than the tracks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.arrays import Floats, Rows
from stseg.io.extras import load_extra
from stseg.io.runfile.reading.run_reader import Run

_LONGEST_CHUNK = 4096  # frames


def write_movement(path: Path, run: Run) -> None:
    """Write a poses dataset: metres on the ground, one keypoint `ground`, confidence the probability of a person."""
    with _dataset(path, run, "poses", {"keypoint": ["ground"]}) as file:
        position = _variable(file, "position", ("time", "space", "keypoint", "individual"), "metres on the ground")
        confidence = _variable(file, "confidence", ("time", "keypoint", "individual"), "probability of a person")
        for individual, rows in _by_id(run, run.trajectory):
            span, ground = _filled(run, rows, np.stack([rows["x"], rows["y"]], -1))
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
        places = dict(_by_id(run, run.trajectory))
        for individual, boxes in _by_id(run, run.boxes):
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


def _by_id(run: Run, table: Rows) -> Iterator[tuple[int, Rows]]:
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
