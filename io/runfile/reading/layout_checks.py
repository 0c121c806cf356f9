"""Checks that a file has the layout of a run file, before anything of it is read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import FormatError
from stseg.io.runfile import layout
from stseg.io.runfile.reading.texts import read_attribute
from stseg.io.toml.text import abbreviated
from stseg.io.untrusted import limits
from stseg.io.untrusted.names import EXPECTED, is_name


@dataclass(frozen=True)
class LayoutChecks:
    """The layout, object by object; each raises a FormatError that names the object."""

    path: Path
    file: h5py.File

    def require(self, name: str) -> h5py.Dataset:
        found = self.file.get(name)
        if not isinstance(found, h5py.Dataset):
            raise FormatError(self.path, name, "nothing" if found is None else "no array", "an array")
        return found

    def attribute(self, name: str, key: str, expected: str) -> Any:
        if key not in self.file[name].attrs:
            raise FormatError(self.path, f"{name}@{key}", "nothing", expected)
        return read_attribute(self.file[name], key)

    def names(self, name: str, key: str) -> tuple[str, ...]:
        """An attribute of several names of cameras, each once."""
        found = np.ravel(self.attribute(name, key, "names of cameras")).tolist()[: limits.CAMERAS + 1]
        if len(found) > limits.CAMERAS or not all(map(is_name, found)) or len(set(found)) != len(found):
            raise FormatError(self.path, f"{name}@{key}", abbreviated(found), f"names of cameras: {EXPECTED}")
        return tuple(found)

    def frame_rate(self) -> float:
        """Frames per second."""
        low, high = limits.FRAME_RATE
        found = self.attribute("/trajectory", "fps", "frames per second")
        if np.shape(found) or not isinstance(found, float | int | np.number) or not low <= found <= high:
            raise FormatError(self.path, "/trajectory@fps", abbreviated(found), f"a number from {low:g} to {high:g}")
        return float(found)

    def require_rising(self, frames: Ints) -> None:
        """Frames of the run: numbers from 0 on, rising."""
        name = f"{layout.OCCUPANCY}/frame"
        if len(frames) and (frames[0] < 0 or frames[-1] > limits.FRAMES or (np.diff(frames) <= 0).any()):
            raise FormatError(self.path, name, "numbers that do not rise from 0 on", f"at most {limits.FRAMES}, rising")

    def require_finite(self, name: str, values: Floats) -> None:
        """Coordinates: finite and of usual size."""
        if not (np.abs(values) <= limits.METRES).all():
            raise FormatError(self.path, name, "a coordinate that is not finite", f"metres up to {limits.METRES:g}")

    def require_value(self, name: str, key: str, expected: str | int) -> None:
        found = self.attribute(name, key, repr(expected))
        if np.shape(found) or found != expected:
            raise FormatError(self.path, f"{name}@{key}", abbreviated(found), repr(expected))

    def require_dataset(self, name: str, dtype: np.dtype[np.generic], dimensions: int) -> h5py.Dataset:
        """A dataset of that dtype and so many dimensions."""
        dataset = self.require(name)
        if dataset.dtype != dtype:
            raise FormatError(self.path, name, f"the type {dataset.dtype}", str(dtype))
        if dataset.ndim != dimensions:
            raise FormatError(self.path, name, f"{dataset.ndim} dimensions", str(dimensions))
        return dataset

    def require_field(self, field: layout.Field, lengths: dict[str, int]) -> None:
        """Scales come first and say how long the axes are."""
        name = f"{layout.OCCUPANCY}/{field.name}"
        dataset = self.require_dataset(name, field.dtype, len(field.axes))
        expected = tuple(lengths.setdefault(axis, len(dataset)) for axis in field.axes)
        if dataset.shape != expected:
            raise FormatError(self.path, name, f"the shape {dataset.shape}", f"{expected}, as its axes say")

    def require_provenance(self) -> None:
        for name in ("config", "rig", "versions", "sources"):
            self.require(f"{layout.PROVENANCE}/{name}")
        for key in ("created", "rig_path"):
            self.attribute(layout.PROVENANCE, key, "a text")


def require_bounded_volume(group: h5py.Group) -> None:
    """Raise ValueError where a frame or a chunk of the volume is larger than is read."""
    for name in (layout.LOG_ODDS.name, layout.LABEL.name):
        array = group[name]
        if math.prod(array.shape[1:]) > limits.CELLS or (array.chunks is not None and array.chunks[0] > 64):
            raise ValueError(f"{array.name}: frames of {array.shape[1:]} in chunks of {array.chunks}")
