"""Reader of run files: the layout is checked on opening, tables are read on demand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, cast

import h5py
import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Rows, Singles
from stseg.errors import FormatError
from stseg.io.extras import load_extra
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile import layout
from stseg.io.runfile.data_frames import to_data_frame
from stseg.io.runfile.hdf5_reading import format_errors, read_object
from stseg.io.runfile.provenance import Provenance, read_provenance
from stseg.io.runfile.volume import RunVolume

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True)
class Run:
    """The contents of a run file.

    Attributes
    ----------
    path
    scene
        The scene's name.
    frame_rate
        Frames per second.
    cameras
        Names; tables count cameras from 0.
    frames : int64 (time,)
        Numbers of the frames in the recording.
    heights, ground_y, ground_x : float64 (plane,), (y,), (x,)
        Centres of the cells, metres.
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    kept
        Stored part of the volume: "all", cells near "tracks", or "none".
    """

    path: Path
    scene: str
    frame_rate: float
    cameras: tuple[str, ...]
    frames: Ints
    heights: Floats
    ground_y: Floats
    ground_x: Floats
    views: Bytes
    kept: str = "all"

    @cached_property
    def trajectory(self) -> Rows:
        """TRAJECTORY (n,)."""
        return self._table("trajectory")

    @cached_property
    def tracks(self) -> Rows:
        """TRACK (n,)."""
        return self._table("tracks")

    @cached_property
    def boxes(self) -> Rows:
        """BOX (n,)."""
        return self._table("boxes")

    @cached_property
    def events(self) -> Rows:
        """EVENT (n,)."""
        return self._table("events")

    @cached_property
    def ghosts(self) -> Rows:
        """CANDIDATE (n,) with `parts`, float32 (views,)."""
        return self._table("ghosts")

    @cached_property
    def windows(self) -> Rows:
        """WINDOW (n,)."""
        return self._table("windows")

    @cached_property
    def rates(self) -> Rows:
        """RATES (n,); empty in a file that has none."""
        return self._table("rates")

    @cached_property
    def shifts(self) -> Rows:
        """SHIFT (n,); empty in a file that has none."""
        return self._table("shifts")

    @cached_property
    def timings(self) -> Rows:
        """TIMING (n,)."""
        return self._table("timings")

    @cached_property
    def provenance(self) -> Provenance:
        """Configuration, rig, versions and sources of the run."""
        return read_object(self.path, layout.PROVENANCE, lambda file: read_provenance(file[layout.PROVENANCE]))

    @cached_property
    def recording(self) -> Recording:
        """The rig with its grid, and the streams, as at the start of the run."""
        provenance = self.provenance
        return with_alignment(
            parse_rig(provenance.rig, provenance.rig_path), [provenance.shown.get(name) for name in self.cameras]
        )

    @property
    def detections(self) -> Rows:
        """CANDIDATE (m,) with `parts`: the detections of each frame by itself, ghosts left out."""
        rows: Rows = self.ghosts[self.ghosts["status"] == 1]
        return rows

    @property
    def volume(self) -> RunVolume:
        """The volume, read as it is indexed: `run.volume.log_odds[10:20]`, `run.volume.label[0, 2]`."""
        shape = len(self.frames), len(self.heights), len(self.ground_y), len(self.ground_x)
        return RunVolume(self.path, shape)

    def volume_dataset(self) -> Dataset:
        """The volume as a dataset of xarray, read as it is used: log_odds and label (time, plane, y, x), views.

        Raises
        ------
        ConfigError
            Where xarray or h5netcdf is not installed.
        """
        xarray = load_extra("xarray", "xarray")
        load_extra("h5netcdf", "xarray")
        return cast(
            "Dataset", xarray.open_dataset(self.path, engine="h5netcdf", group=layout.OCCUPANCY, phony_dims="access")
        )

    def data_frame(self, table: str) -> DataFrame:
        """One of the tables as a data frame of pandas, with `time` in seconds where it has frames.

        Parameters
        ----------
        table
            trajectory, tracks, boxes, events, ghosts, windows, rates, shifts or timings. Texts are strings; the
            evidence of each view for a candidate is one column a view, `parts_CAMERA`.

        Raises
        ------
        ConfigError
            Where pandas is not installed.
        """
        if table not in layout.ABOUT:
            raise ValueError(f"table {table!r} is none of {', '.join(layout.ABOUT)}")
        return to_data_frame(getattr(self, table), self.frame_rate, self.cameras)

    def read_frame(self, frame: int) -> tuple[Singles, Labels]:
        """Volume of one frame.

        Parameters
        ----------
        frame
            Its number in the recording; one of `frames`.

        Returns
        -------
        log_odds : float32 (plane, y, x)
            Nats, NaN where no view sees the cell.
        label : int32 (plane, y, x)
            Track ids, 0 for background.
        """
        index = int(np.searchsorted(self.frames, frame))
        if index == len(self.frames) or self.frames[index] != frame:
            raise ValueError(f"frame {frame} is not in {self.path}")
        return read_object(self.path, layout.OCCUPANCY, lambda file: _volume(file[layout.OCCUPANCY], index))

    def read_volumes(self, number: int) -> Iterator[tuple[Ints, Singles, Labels]]:
        """The volumes of all frames, `number` at a time: the frames, log-odds and labels as `read_frame` gives them."""
        with format_errors(self.path, layout.OCCUPANCY), h5py.File(self.path, "r") as file:
            group = file[layout.OCCUPANCY]
            for start in range(0, len(self.frames), number):
                some = slice(start, start + number)
                yield self.frames[some], group["log_odds"][some].astype(np.float32), group["label"][some]

    def _table(self, name: str) -> Rows:
        def take(file: h5py.File) -> Rows:
            if name in layout.ADDED and name not in file:
                return np.zeros(0, layout.table_types(len(self.cameras))[name])
            return _with_added(np.asarray(file[name][:]), layout.table_types(len(self.cameras))[name])

        return read_object(self.path, f"/{name}", take)


def _with_added(rows: Rows, dtype: np.dtype[np.void]) -> Rows:
    """Rows of a table with the columns that its first files lack."""
    if rows.dtype == dtype:
        return rows
    whole = np.zeros(len(rows), dtype)
    for name in dtype.names or ():
        whole[name] = np.nan if name in _lacking(rows.dtype, dtype) else rows[name]
    return whole


def _lacking(found: np.dtype[np.generic], dtype: np.dtype[np.generic]) -> set[str]:
    return set(dtype.names or ()) - set(found.names or ())


def read_run(path: Path | str) -> Run:
    """Open a run file.

    Raises
    ------
    FormatError
        Where it is no run file, of another version, or lacks what `stseg.io.runfile.layout` promises; it names the
        object.
    """
    return read_object(Path(path), "", lambda file: _checked_run(Path(path), file))


def read_trajectory(path: Path) -> Rows:
    """The TRAJECTORY table of a run file; raises as `read_run` does."""
    return read_run(path).trajectory


def _volume(group: h5py.Group, index: int) -> tuple[Singles, Labels]:
    return group["log_odds"][index].astype(np.float32), group["label"][index]


def _checked_run(path: Path, file: h5py.File) -> Run:
    checks = _Checks(path, file)
    for name in ("format", "format_version"):
        checks.require_value("/", name, layout.ROOT_ATTRIBUTES[name])
    cameras = tuple(str(name) for name in checks.attribute("/", "cameras", "names of cameras"))
    lengths: dict[str, int] = {}
    for field in layout.FIELDS:
        checks.require_field(field, lengths)
    for name, dtype in layout.table_types(len(cameras)).items():
        if name in file or name not in layout.ADDED:
            checks.require_dataset(f"/{name}", dtype, 1)
    checks.require_provenance()
    frame_rate = checks.attribute("/trajectory", "fps", "frames per second")
    entry, group = checks.require("/entry/title"), file[layout.OCCUPANCY]
    frames, heights, ground_y, ground_x, views = (group[name][:] for name in ("frame", "plane", "y", "x", "views"))
    kept = str(group.attrs.get("kept", layout.KEPT[0]))
    title = entry.asstr()[()]
    return Run(path, title, float(frame_rate), cameras, frames, heights, ground_y, ground_x, views, kept)


@dataclass(frozen=True)
class _Checks:
    """The layout, object by object; each raises a FormatError that names the object."""

    path: Path
    file: h5py.File

    def require(self, name: str) -> h5py.Dataset:
        found = self.file.get(name)
        if not isinstance(found, h5py.Dataset):
            raise FormatError(self.path, name, "nothing" if found is None else "no array", "an array")
        return found

    def attribute(self, name: str, key: str, expected: str) -> h5py.AttributeManager:
        attributes = self.file[name].attrs
        if key not in attributes:
            raise FormatError(self.path, f"{name}@{key}", "nothing", expected)
        return attributes[key]

    def require_value(self, name: str, key: str, expected: str | int) -> None:
        found = self.attribute(name, key, repr(expected))
        if np.shape(found) or found != expected:
            raise FormatError(self.path, f"{name}@{key}", repr(found), repr(expected))

    def require_dataset(self, name: str, dtype: np.dtype[np.generic], dimensions: int) -> h5py.Dataset:
        """A dataset of that dtype, or of its first form without the columns that were added, and so many dimensions."""
        dataset = self.require(name)
        lacking = _lacking(dataset.dtype, dtype)
        first = [column for column in dtype.descr if column[0] not in lacking & layout.ADDED_COLUMNS]
        if dataset.dtype not in (dtype, np.dtype(first)):
            raise FormatError(self.path, name, f"the type {dataset.dtype}", str(dtype))
        if dataset.ndim != dimensions:
            raise FormatError(self.path, name, f"{dataset.ndim} dimensions", str(dimensions))
        return dataset

    def require_field(self, field: layout.Field, lengths: dict[str, int]) -> None:
        """Scales come first and say how long the axes are."""
        name = f"{layout.OCCUPANCY}/{field.name}"
        found = self.require(name).dtype
        dtype = found if found == layout.EARLIER.get(field.name) else field.dtype
        dataset = self.require_dataset(name, dtype, len(field.axes))
        expected = tuple(lengths.setdefault(axis, len(dataset)) for axis in field.axes)
        if dataset.shape != expected:
            raise FormatError(self.path, name, f"the shape {dataset.shape}", f"{expected}, as its axes say")

    def require_provenance(self) -> None:
        for name in ("config", "rig", "versions", "sources"):
            self.require(f"{layout.PROVENANCE}/{name}")
        for key in ("created", "rig_path"):
            self.attribute(layout.PROVENANCE, key, "a text")
