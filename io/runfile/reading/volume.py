"""The occupancy volume of a run file, read as it is indexed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import AnyArray
from stseg.io.runfile import layout
from stseg.io.runfile.reading.hdf5_reading import read_object


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
