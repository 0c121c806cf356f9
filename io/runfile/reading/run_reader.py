"""Reader of run files: the layout is checked on opening, tables are read on demand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import h5py
import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Rows, Singles
from stseg.errors import FormatError, printable
from stseg.geometry import Grid
from stseg.io.extras import load_extra
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.source_files import recording_files
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import PackedFrame, PackedFrames
from stseg.io.runfile.provenance import Provenance, read_provenance
from stseg.io.runfile.reading.checks import (
    Bounds,
    LayoutChecks,
    require_bounded_volume,
    require_consistency,
    require_table,
)
from stseg.io.runfile.reading.hdf5_reading import dataset_texts, format_errors, read_attribute, read_object
from stseg.io.runfile.reading.run_arrays import RunVolume, to_data_frame
from stseg.io.untrusted import limits
from stseg.io.untrusted.safe_hdf5 import open_hdf5, read_whole
from stseg.io.untrusted.values import EXPECTED_TITLE, abbreviated, is_title, parse_whole
from stseg.records.cell_reliability import CellCounts, CellReliability, count_cells, doubtful_cells, filled_cells
from stseg.records.tables import EXCLUDED_VIEW

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

_BLOCK = 64
"""Packed frames that are read together."""
_SCALES = 8 * limits.FRAMES
"""Bytes of one scale of the volume."""
_FRAMES = 48
"""Frames that the curve is learned from, spread over the run: they hold some 10^5 cells in doubt."""


class _TableProperty(cached_property[Rows]):
    """A table of a run file by the attribute's name, read and checked on its first use."""

    def __init__(self, about: str) -> None:
        super().__init__(self._read)
        self.__doc__ = about

    def _read(self, run: Run) -> Rows:
        name = self.attrname or ""

        def take(file: h5py.File) -> Rows:
            dtype = layout.table_types(len(run.cameras))[name]
            return read_whole(file[name], limits.ROWS * dtype.itemsize)

        return require_table(run.bounds, name, read_object(run.path, f"/{name}", take))


def _above(task: str) -> ModuleType:
    """A module of the tasks, by name: readers stand below what judges and draws a run."""
    return import_module(f"stseg.tasks.{task}")


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
    given_names
        Names of tracks in place of the file's own.
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
    given_names: tuple[tuple[int, str], ...] | None = None

    @property
    def files(self) -> Iterator[Path]:
        """The run file, and the files of its recording that are there."""
        return chain((self.path,), recording_files(self.recording))

    def __repr__(self) -> str:
        frames = f"frames {self.frames[0]} to {self.frames[-1]}" if len(self.frames) else "no frames"
        return f"Run({str(self.path)!r}: {self.scene}, {frames}, {len(self.cameras)} cameras)"

    def _repr_html_(self) -> str:
        return str(_above("notebook").summary_html(self))

    def plot(self) -> Any:
        """The ground from above with the tracks, a picture that notebooks show; `pixels` is uint8 (v, u, 3)."""
        return _above("notebook").plan_picture(self)

    def film(
        self,
        output: Path | str,
        *,
        frames: tuple[int | None, int | None] | None = None,
        camera_images: bool = False,
        overwrite: bool = False,
        progress: Any = None,
    ) -> Any:
        """Write the film of the run, as `stseg report --video` does; notebooks play what this returns.

        Parameters
        ----------
        output
            The WebM or MP4 file, by its ending.
        frames
            (first, stop), half open; None for all.
        camera_images
            Show the cameras' frames. The film then holds images of people.
        overwrite
            Replace an older film.
        progress
            As of `stseg.track`.

        Raises
        ------
        InputError
            Where a file exists, or the run has no such frame.
        """
        return _above("notebook").write_film(self, output, frames, camera_images, overwrite, progress)

    trajectory = _TableProperty("TRAJECTORY (n,).")
    tracks = _TableProperty("TRACK (n,).")
    boxes = _TableProperty("BOX (n,).")
    events = _TableProperty("EVENT (n,).")
    ghosts = _TableProperty("CANDIDATE (n,) with `parts`, float32 (views,).")
    windows = _TableProperty("WINDOW (n,).")
    rates = _TableProperty("RATES (n,).")
    shifts = _TableProperty("SHIFT (n,).")
    timings = _TableProperty("TIMING (n,).")
    committed = _TableProperty("TRAJECTORY (n,) before identities were decided, ids of the filter.")
    committed_events = _TableProperty("EVENT (n,) before identities were decided.")
    appearance = _TableProperty("APPEARANCE (n,).")
    answers = _TableProperty("ANSWER (n,): answers so far (`stseg correct`).")
    known_people = _TableProperty("KNOWN_PERSON (n,): people of earlier recordings (`stseg run --known`).")

    @cached_property
    def excluded_views(self) -> Rows:
        """EXCLUDED_VIEW (n,): of a segment alone, before its first and after its last frame."""
        name = layout.EXCLUDED_VIEWS

        def take(file: h5py.File) -> Rows:
            if name not in file:
                return np.zeros(0, EXCLUDED_VIEW)
            dataset = LayoutChecks(self.path, file).require_dataset(f"/{name}", EXCLUDED_VIEW, 1)
            return read_whole(dataset, limits.ROWS * EXCLUDED_VIEW.itemsize)

        return require_table(self.bounds, name, read_object(self.path, f"/{name}", take))

    @cached_property
    def names(self) -> dict[int, str]:
        """Names of tracks by id, where they were given (`stseg correct`, or `with_names`)."""
        if self.given_names is not None:
            return dict(self.given_names)
        return read_object(self.path, layout.PROVENANCE, lambda file: _names(file[layout.PROVENANCE]))

    @cached_property
    def corrected(self) -> bool:
        """Whether a person's answers changed its identities (`stseg correct`)."""
        return read_object(self.path, layout.PROVENANCE, lambda file: "answers" in file[layout.PROVENANCE])

    def with_names(self, names: Mapping[int, str]) -> Run:
        """The run with other names of its tracks."""
        return replace(self, given_names=tuple(names.items()))

    @cached_property
    def provenance(self) -> Provenance:
        """Configuration, rig, versions and sources of the run."""
        return read_object(self.path, layout.PROVENANCE, lambda file: read_provenance(file[layout.PROVENANCE]))

    @cached_property
    def recording(self) -> Recording:
        """The rig with its grid, and the streams, as at the start of the run."""
        provenance = self.provenance
        recording = parse_rig(provenance.rig, provenance.rig_path)
        cameras = tuple(camera.name for camera in recording.rig.cameras)
        if cameras != self.cameras or recording.rig.grid.shape != self.views.shape:
            found = f"{len(cameras)} cameras and a grid of {recording.rig.grid.shape}"
            expected = f"the run's {len(self.cameras)} cameras and {self.views.shape}"
            raise FormatError(self.path, f"{layout.PROVENANCE}/rig", found, expected)
        return with_alignment(recording, [provenance.frame_at_tick.get(name) for name in self.cameras])

    def require_consistency(self) -> None:
        """Raise FormatError where tables of tracks contradict each other or the frames."""
        require_consistency(self.bounds, self.trajectory, self.boxes, self.tracks)

    @property
    def detections(self) -> Rows:
        """CANDIDATE (m,) with `parts`: the detections of each frame by itself, ghosts left out."""
        rows: Rows = self.ghosts[self.ghosts["status"] == 1]
        return rows

    @cached_property
    def warnings(self) -> list[str]:
        """Faults of the recording and the run, one line each, as `stseg inspect` and the report list them."""
        return list(_above("warnings").run_warnings(self))

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
            trajectory, tracks, boxes, events, ghosts, windows, rates, shifts, timings or another of the file's. Texts
            are strings; the evidence of each view for a candidate is one column a view, `parts_CAMERA`.

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

        def take(file: h5py.File) -> tuple[Singles, Labels]:
            group = file[layout.OCCUPANCY]
            return group["log_odds"][index].astype(np.float32), group["label"][index]

        return read_object(self.path, layout.OCCUPANCY, take)

    @cached_property
    def cell_reliability(self) -> CellReliability:
        """Reliability of the volume's log-odds, measured by the run's own tracks."""
        return learn_reliability(self)

    def read_cell_probability(self, frame: int) -> Singles:
        """Probability that a body fills each cell of one frame, float32 (plane, y, x), NaN where no view sees the cell.

        Calibrated: of the cells with 0.8, 80 % are filled. Cells alone are judged; labels know of their neighbours,
        and of other frames.
        """
        return self.cell_reliability.of_cells(self.read_frame(frame)[0])

    def read_packed_frames(self, field: layout.Field) -> Iterator[PackedFrames]:
        """The log-odds or labels of all frames, some at a time, as they are packed."""
        with format_errors(self.path, layout.OCCUPANCY), open_hdf5(self.path) as file:
            dataset = file[layout.OCCUPANCY][field.name]
            for start in range(0, len(self.frames), _BLOCK):
                frames = self.frames[start : start + _BLOCK]
                chunks = (dataset.id.read_direct_chunk((start + k, 0, 0, 0)) for k in range(len(frames)))
                yield PackedFrames(frames, [PackedFrame(*chunk) for chunk in chunks])

    @property
    def bounds(self) -> Bounds:
        """Frames and cameras to which the rows of tables refer."""
        return Bounds(self.path, self.frames, len(self.cameras))


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


def _names(group: h5py.Group) -> dict[int, str]:
    if "names" not in group:
        return {}
    pairs = (text.partition(",") for text in dataset_texts(group["names"]))
    names = {parse_whole(identity, 1, limits.FRAMES): name for identity, _, name in pairs}
    if None in names or not all(map(is_title, names.values())):
        raise ValueError(f"names of tracks other than id,name with {EXPECTED_TITLE}")
    return {identity: name for identity, name in names.items() if identity is not None}


def _checked_run(path: Path, file: h5py.File) -> Run:
    checks = LayoutChecks(path, file)
    for name in ("format", "format_version"):
        checks.require_value(name, layout.ROOT_ATTRIBUTES[name])
    cameras = checks.names("/", "cameras")
    lengths: dict[str, int] = {}
    for field in layout.FIELDS:
        checks.require_field(field, lengths)
    for name, dtype in layout.table_types(len(cameras)).items():
        checks.require_dataset(f"/{name}", dtype, 1)
    checks.require_provenance()
    entry, group = checks.require("/entry/title"), file[layout.OCCUPANCY]
    require_bounded_volume(group)
    arrays = (read_whole(group[name], _SCALES) for name in ("frame", "plane", "y", "x", "views"))
    frames, heights, ground_y, ground_x, views = arrays
    checks.require_rising(frames)
    for name, axis in (("plane", heights), ("y", ground_y), ("x", ground_x)):
        checks.require_finite(f"{layout.OCCUPANCY}/{name}", axis)
    kept = read_attribute(group, "kept") if "kept" in group.attrs else layout.VOLUMES[0]
    if kept not in layout.VOLUMES:
        raise FormatError(path, f"{layout.OCCUPANCY}@kept", abbreviated(kept), f"one of {', '.join(layout.VOLUMES)}")
    title = printable(str(dataset_texts(entry)))[: limits.NAME]
    return Run(path, title, checks.frame_rate(), cameras, frames, heights, ground_y, ground_x, views, str(kept))


def learn_reliability(run: Run) -> CellReliability:
    """The curve of a run, from frames spread over it; raises FormatError as reading does."""
    chosen = np.unique(np.linspace(0, len(run.frames), _FRAMES, endpoint=False).astype(int))
    grid, rows = run.recording.rig.grid, run.trajectory
    return CellReliability.of(_counts(run, grid, rows, frame) for frame in run.frames[chosen[chosen < len(run.frames)]])


def _counts(run: Run, grid: Grid, rows: Rows, frame: int) -> CellCounts:
    log_odds, _ = run.read_frame(int(frame))
    frame_rows = rows[rows["frame"] == frame]
    return count_cells(log_odds, filled_cells(grid, frame_rows), doubtful_cells(grid, log_odds, frame_rows))
