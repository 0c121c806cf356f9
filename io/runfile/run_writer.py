"""Incremental writer of run files and segment files; a file takes its name once it is complete."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

import h5py
import numpy as np

from stseg.arrays import AnyArray, Bytes, Ints, Labels, Rows, Singles
from stseg.geometry import Rig
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.recording import Recording
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import PackedFrame, packed_frame
from stseg.io.runfile.provenance import gather_provenance, write_provenance
from stseg.io.runfile.unfinished.part_file import PartFile

_LARGEST = 65536.0  # nats
_HELD_ROWS = 4096  # of one table, before they are written


class RunWriter:
    """Writes a run file as a part beside it, renamed by `finish`.

    Use it in a `with`: an exception before `finish` removes the part and leaves an older file of that name unchanged.

    OutputError where the file exists and is not to be overwritten, or cannot be written; from every method.

    Parameters
    ----------
    path
        The run file.
    recording
        The rig and its streams.
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    config_text
        The resolved configuration, TOML.
    overwrite
        Whether an older file of that name may be replaced, at the end.
    kept
        One of `layout.VOLUMES`: the part of the volume that is appended; the rest is NaN and background.
    """

    def __init__(
        self, path: Path, recording: Recording, views: Bytes, config_text: str, *, overwrite: bool, kept: str = "all"
    ) -> None:
        self._path = Path(path)
        require_new(self._path, overwrite)
        if views.shape != recording.rig.grid.shape:
            raise ValueError(f"views {views.shape} on a grid {recording.rig.grid.shape}")
        self._recording, self._views, self._config_text, self._overwrite = recording, views, config_text, overwrite
        self._kept = kept
        self._frames, self._labels, self._last_frame = 0, 0, -1
        self._finished = False
        self._file: h5py.File | None = None

    def __enter__(self) -> Self:
        self._disk = PartFile(self._path)
        try:
            with self._disk.step():
                self._create()
            return self
        except BaseException:
            self._disk.discard(self._close)
            raise

    def __exit__(self, *reason: object) -> None:
        if not self._finished:
            self._disk.discard(self._close)

    def append_packed_log_odds(self, frames: Ints, log_odds: Sequence[PackedFrame]) -> None:
        """Append the log-odds of the next frames, one each by `packed_volume`; their labels may come later.

        The numbers of frames, int64 (time,), rise.
        """
        if len(frames) and (frames[0] <= self._last_frame or (np.diff(frames) <= 0).any()):
            raise ValueError(f"frames {frames} after frame {self._last_frame}")
        with self._disk.step():
            self._extend_packed("log_odds", log_odds)
            self._extend("frame", frames)
            self._extend("time", frames / self._recording.rig.frame_rate)
            self._frames += len(frames)
            self._last_frame = int(frames[-1]) if len(frames) else self._last_frame

    def append_packed_labels(self, label: Sequence[PackedFrame]) -> None:
        """Append the labels of the next frames that have none, one each by `packed_volume`."""
        if self._labels + len(label) > self._frames:
            raise ValueError(f"labels of {self._labels + len(label)} frames for {self._frames}")
        with self._disk.step():
            self._extend_packed("label", label)
            self._labels += len(label)

    def append(self, table: str, rows: Rows) -> None:
        """Add rows to one of the tables of `stseg.io.runfile.layout`, whose dtype they have."""
        with self._disk.step():
            if table not in self._tables:
                self._tables[table] = _GrowingTable(_create_table(self._file, table, rows.dtype))
            self._tables[table].append(rows)

    def finish(self, tracks: Rows) -> None:
        """Write the TRACK rows, then sync the file and give it its name."""
        if self._labels != self._frames:
            raise ValueError(f"labels of {self._labels} frames for {self._frames}")
        with self._disk.step():
            self._tables["tracks"].append(tracks)
            for table in self._tables.values():
                table.flush()
            self._close()  # flushes
        try:
            with self._disk.step():  # an interrupt waits until the part has its name
                self._finished = True  # the part is complete and is kept from here on
                self._disk.publish(self._overwrite)
        finally:
            self._disk.close()

    def _create(self) -> None:
        rig = self._recording.rig
        self._file = file = h5py.File(self._disk, "w")
        cameras = [camera.name for camera in rig.cameras]
        area = layout.walkable_area(rig.grid)
        file.attrs.update({**layout.ROOT_ATTRIBUTES, "cameras": cameras, "wkt_geometry": area})
        entry = file.create_group("entry")
        entry.attrs.update(layout.ENTRY_ATTRIBUTES)
        entry["title"] = rig.name
        self._occupancy = _create_occupancy(file, rig, self._views)
        self._occupancy.attrs["kept"] = self._kept
        self._tables = {
            name: _GrowingTable(_create_table(file, name, dtype))
            for name, dtype in layout.table_types(len(cameras)).items()
        }
        file["trajectory"].attrs["fps"] = rig.frame_rate
        file["ghosts"].attrs["views"] = cameras
        provenance = gather_provenance(self._recording, self._config_text)
        write_provenance(file.create_group(layout.PROVENANCE), provenance)

    def _extend_packed(self, name: str, frames: Sequence[PackedFrame]) -> None:
        dataset = self._occupancy[name]
        start = len(dataset)
        dataset.resize(start + len(frames), axis=0)
        for k, packed in enumerate(frames):
            dataset.id.write_direct_chunk((start + k, 0, 0, 0), packed.data, packed.filters)

    def _extend(self, name: str, values: AnyArray) -> None:
        dataset = self._occupancy[name]
        start = len(dataset)
        dataset.resize(start + len(values), axis=0)
        dataset[start:] = values

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()


def packed_volume(log_odds: Singles, label: Labels) -> tuple[PackedFrame, PackedFrame]:
    """The log-odds and labels (plane, y, x) of a frame on a grid, packed for the layout of run files.

    Log-odds are in nats, NaN where no view sees the cell, and kept to `layout.LOG_ODDS_STEP`; labels are track ids, and
    0 for background.
    """
    coarse = np.clip(log_odds, -_LARGEST, _LARGEST, dtype=np.float32)
    coarse /= np.float32(layout.LOG_ODDS_STEP)
    np.rint(coarse, out=coarse)
    coarse *= np.float32(layout.LOG_ODDS_STEP)
    whole = coarse.astype(layout.LOG_ODDS.dtype, copy=False), label.astype(layout.LABEL.dtype, copy=False)
    return packed_frame(whole[0]), packed_frame(whole[1])


class _GrowingTable:
    """A growing table; rows are buffered up to a chunk."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset = dataset
        self._held: list[Rows] = []
        self._count = 0

    def append(self, rows: Rows) -> None:
        """Add rows (n,) of the table's dtype to the buffer."""
        if rows.dtype != self._dataset.dtype:
            raise ValueError(f"rows {rows.dtype} for the table {self._dataset.name} of {self._dataset.dtype}")
        self._held.append(rows if len(rows) >= _HELD_ROWS else rows.copy())
        self._count += len(rows)
        if self._count >= _HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        if self._count:
            start = len(self._dataset)
            self._dataset.resize(start + self._count, axis=0)
            self._dataset[start:] = self._held[0] if len(self._held) == 1 else np.concatenate(self._held)
        self._held, self._count = [], 0


def _create_occupancy(file: h5py.File, rig: Rig, views: Bytes) -> h5py.Group:
    grid = rig.grid
    group = file.create_group(layout.OCCUPANCY)
    group.attrs.update(layout.OCCUPANCY_ATTRIBUTES)
    group["title"] = f"{rig.name}: occupancy"
    lengths = dict(zip(layout.AXES, (0, *grid.shape), strict=True))
    contents: dict[str, AnyArray] = {"plane": grid.heights, "y": grid.ground_y, "x": grid.ground_x, "views": views}
    for field in layout.FIELDS:
        _create_field(group, field, lengths)
        if field.name in contents:
            group[field.name][...] = contents[field.name]
    return group


def _create_field(group: h5py.Group, field: layout.Field, lengths: Mapping[str, int]) -> None:
    """An empty array with its attributes, attached to the existing scales of its axes."""
    shape = tuple(lengths[axis] for axis in field.axes)
    grows = field.axes[0] == "time"
    chunks = (1, *shape[1:]) if grows and len(shape) > 1 else (1024,) if grows else None
    storage = {
        "chunks": chunks,
        "maxshape": (None, *shape[1:]),
        "compression": "gzip",
        "compression_opts": 1,
        "shuffle": True,
    }
    fill = np.nan if field is layout.LOG_ODDS else 0
    dataset = group.create_dataset(field.name, shape, field.dtype, fillvalue=fill, **(storage if grows else {}))
    dataset.attrs["long_name"] = field.long_name
    if field.units:
        dataset.attrs["units"] = field.units
    if field in layout.SCALES:
        dataset.make_scale(field.name)
    for dimension, axis in enumerate(field.axes):
        dataset.dims[dimension].label = axis
        if field not in layout.SCALES:
            dataset.dims[dimension].attach_scale(group[axis])
    if field.axes == layout.AXES:
        dataset.attrs["interpretation"] = "image"


def _create_table(file: h5py.File, name: str, dtype: np.dtype[np.void]) -> h5py.Dataset:
    table = file.create_dataset(
        name, (0,), dtype, maxshape=(None,), chunks=(1024,), compression="gzip", compression_opts=1, shuffle=True
    )
    table.attrs["about"] = layout.ABOUT.get(name, "of a segment alone")
    return table
