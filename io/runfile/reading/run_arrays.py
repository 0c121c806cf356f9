"""Arrays of a run file: its volume, read as it is indexed, and its tables as data frames of pandas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stseg.arrays import AnyArray, Rows
from stseg.io.extras import load_extra
from stseg.io.runfile import layout
from stseg.io.runfile.reading.hdf5_reading import read_object

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class RunVolume:
    """The volume of a run file, of which only what is indexed is read."""

    path: Path
    shape: tuple[int, int, int, int]
    """(time, plane, y, x)"""

    @property
    def log_odds(self) -> VolumeArray:
        """float32 (time, plane, y, x), nats; nan where no view sees the cell."""
        return VolumeArray(self.path, self.shape, "log_odds", np.dtype(np.float32))

    @property
    def label(self) -> VolumeArray:
        """int32 (time, plane, y, x), track ids, 0 for background."""
        return VolumeArray(self.path, self.shape, "label", np.dtype(np.int32))


@dataclass(frozen=True)
class VolumeArray:
    """One array (time, plane, y, x) of a run file; indexed as an array, it gives arrays."""

    path: Path
    shape: tuple[int, int, int, int]
    name: str
    dtype: np.dtype[Any]

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> AnyArray:
        place = f"{layout.OCCUPANCY}/{self.name}"
        return read_object(self.path, place, lambda file: np.asarray(file[place][index], self.dtype))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> AnyArray:
        del copy  # it always is one
        return np.asarray(self[:], dtype)


def to_data_frame(table: Rows, frame_rate: float, cameras: Sequence[str]) -> DataFrame:
    """A structured array as a data frame, with `time` (seconds) where there are frames.

    Texts become strings; a column with one value a view becomes one column a camera, `NAME_CAMERA`.

    ConfigError where pandas is not installed.
    """
    pandas = load_extra("pandas", "pandas")
    columns = dict(_columns(table, cameras))
    if "frame" in columns:
        columns["time"] = table["frame"] / frame_rate
    return cast("DataFrame", pandas.DataFrame(columns))


def _columns(table: Rows, cameras: Sequence[str]) -> Iterator[tuple[str, AnyArray]]:
    for name in table.dtype.names or ():
        column = table[name]
        if column.ndim > 1:
            yield from ((f"{name}_{camera}", column[:, view]) for view, camera in enumerate(cameras))
        elif column.dtype.kind == "S":
            yield name, np.char.decode(column, "utf-8")
        else:
            yield name, column
