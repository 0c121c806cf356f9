"""Checks of a run file: its layout before anything is read, the values of a table when it is read."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.arrays import AnyArray, Flags, Floats, Ints, Rows, repeated_rows
from stseg.errors import FormatError
from stseg.io.runfile import layout
from stseg.io.runfile.reading.hdf5_reading import read_attribute
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import EXPECTED, abbreviated, is_name
from stseg.records.tables import ERROR_RATES

_RANGES: dict[str, tuple[int, int]] = {
    "frame": (0, limits.FRAMES),
    "first": (0, limits.FRAMES),
    "last": (0, limits.FRAMES),
    "id": (0, 2**31 - 1),
    "other": (0, 2**31 - 1),
    "window": (-1, limits.FRAMES),
    "row": (0, limits.ROWS),
    "people": (0, 2),
    "height_count": (0, limits.ROWS),
    "appearance_count": (0, limits.ROWS),
}
"""Columns of whole numbers; `view` counts the cameras."""
_PLACES = {"trajectory": ("x", "y", "z"), "boxes": ("left", "top", "width", "height"), "ghosts": ("x", "y", "evidence")}
"""Columns that must be finite; others may be NaN where nothing is known."""
_KEYS = {"trajectory": ("id", "frame"), "boxes": ("id", "frame", "view"), "known_people": ("id",)}
"""Columns whose values together stand in one row at most."""
_NOT_NEGATIVE = ("xx", "yy", "height", "width", "extent", "seconds", *ERROR_RATES)
"""Variances, sizes, durations and rates."""


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

    def require_value(self, key: str, expected: str | int) -> None:
        found = self.attribute("/", key, repr(expected))
        if np.shape(found) or found != expected:
            raise FormatError(self.path, f"/@{key}", abbreviated(found), repr(expected))

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


@dataclass(frozen=True)
class Bounds:
    """The file, its frames, rising, and the number of its cameras: rows of the run file refer to them."""

    path: Path
    frames: Ints
    cameras: int


def require_table(bounds: Bounds, name: str, rows: Rows) -> Rows:
    """The rows of a table, checked; raises FormatError with the table, the column and the value."""
    for column, wrong, expected in _wrong_values(bounds, name, rows):
        if wrong.any():
            row = int(np.argmax(wrong.reshape(len(rows), -1).any(axis=1)))
            found = str(rows[column][row])[: limits.NAME]
            raise FormatError(bounds.path, f"/{name}, {column}, row {row}", found, expected)
    if name in _KEYS and repeated_rows(rows, _KEYS[name]).any():
        of_people, of_tracks = ("a person twice", "each once"), ("a track twice in a frame", "once, or once a view")
        raise FormatError(bounds.path, f"/{name}", *(of_people if name == "known_people" else of_tracks))
    return rows


def _wrong_values(bounds: Bounds, name: str, rows: Rows) -> Iterator[tuple[str, Flags, str]]:
    """Columns, their wrong values, and what is expected."""
    for column in rows.dtype.names or ():
        values = rows[column]
        if values.dtype.kind == "S":
            yield column, _unprintable(values), "printable text"
        elif values.dtype.kind == "f":
            low, high = 0.0 if column in _NOT_NEGATIVE else -limits.NUMBER, limits.NUMBER
            given = ~np.isnan(values) | (column in _PLACES.get(name, ()))
            yield column, given & ~((low <= values) & (values <= high)), f"a number from {low:g} to {high:g}"
        elif column == "view":
            yield column, (values < 0) | (values >= bounds.cameras), f"a view below {bounds.cameras}"
        elif column in _RANGES and values.dtype.kind in "iu":
            low, high = _RANGES[column]
            yield column, (values < low) | (values > high), f"a whole number from {low} to {high}"
    if name in ("trajectory", "boxes", "known_people"):
        yield "id", rows["id"] < 1, "an id from 1 on"


def _unprintable(values: AnyArray) -> Flags:
    """Texts that are no printable UTF-8, bool (n,)."""
    kinds, index = np.unique(values, return_inverse=True)
    escaped = [bytes(text).decode("utf-8", "surrogateescape") for text in kinds]  # escapes are not printable
    return np.array([not text.isprintable() for text in escaped], bool)[index]


def require_consistency(bounds: Bounds, trajectory: Rows, boxes: Rows, tracks: Rows) -> None:
    """Raise FormatError where tables contradict each other: rows of no frame or track, a track of other rows."""
    for name, rows in (("trajectory", trajectory), ("boxes", boxes)):
        absent = ~np.isin(rows["frame"], bounds.frames)
        if absent.any():
            found = f"frame {rows['frame'][int(np.argmax(absent))]}, which the run has not"
            raise FormatError(bounds.path, f"/{name}, frame", found, "frames of the run")
    lasts = tracks["last"] - tracks["first"] + 1
    if (lasts < np.maximum(tracks["frames"], 1)).any() or len(np.unique(tracks["id"])) != len(tracks):
        raise FormatError(bounds.path, "/tracks", "a track shorter than its frames, or twice", "each once")
    strange = ~np.isin(trajectory["id"], tracks["id"])
    if strange.any():
        found = f"id {trajectory['id'][int(np.argmax(strange))]}, of which /tracks has no row"
        raise FormatError(bounds.path, "/trajectory, id", found, "tracks of the run")
    identities, index = np.unique(trajectory["id"], return_inverse=True)
    ends = np.array([limits.FRAMES, -1]) + np.zeros((len(identities), 2), np.int64)
    np.minimum.at(ends[:, 0], index, trajectory["frame"])
    np.maximum.at(ends[:, 1], index, trajectory["frame"])
    rows = tracks[np.argsort(tracks["id"])]
    if not np.array_equal(rows["id"], identities) or not np.array_equal(
        np.stack([rows["first"], rows["last"]], 1), ends
    ):
        raise FormatError(bounds.path, "/tracks", "other frames than its rows in /trajectory have", "theirs")
