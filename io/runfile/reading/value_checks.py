"""Values of a run file, checked when a table is read: numbers within their ranges, texts printable, rows that fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import AnyArray, Flags, Ints, Rows
from stseg.errors import FormatError
from stseg.io.untrusted import limits
from stseg.io.untrusted.names import printable

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
_PLACES = {"trajectory": ("x", "y", "z"), "boxes": ("left", "top", "width", "height"), "ghosts": ("x", "y")}
"""Columns that must be finite; others may be NaN where nothing is known."""


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
            value = rows[column][int(np.argmax(wrong.reshape(len(rows), -1).any(axis=1)))]
            raise FormatError(bounds.path, f"/{name}, {column}", printable(str(value))[: limits.NAME], expected)
    if name in ("trajectory", "boxes") and _repeated(rows):
        raise FormatError(bounds.path, f"/{name}", "a track twice in a frame", "once, or once a view")
    if name == "known_people" and _repeated(rows):
        raise FormatError(bounds.path, "/known_people", "a person twice", "each once")
    return rows


def _wrong_values(bounds: Bounds, name: str, rows: Rows) -> Iterator[tuple[str, Flags, str]]:
    """Columns, their wrong values, and what is expected."""
    for column in rows.dtype.names or ():
        values = rows[column]
        if values.dtype.kind == "S":
            yield column, _unprintable(values), "printable text"
        elif values.dtype.kind == "f":
            finite = column in _PLACES.get(name, ())
            fits = np.abs(values) <= limits.NUMBER
            yield column, ~(fits if finite else fits | ~np.isfinite(values)), "a finite number of usual size"
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
    return np.array([not _is_printable(bytes(text)) for text in kinds], bool)[index]


def _is_printable(text: bytes) -> bool:
    try:
        return text.decode("utf-8").isprintable()
    except UnicodeDecodeError:
        return False


def _repeated(rows: Rows) -> bool:
    keys: Sequence[AnyArray] = [rows[key] for key in ("id", "frame", "view") if key in (rows.dtype.names or ())]
    order = np.lexsort(keys)
    same = np.ones(max(0, len(rows) - 1), bool)
    for key in keys:
        same &= key[order][1:] == key[order][:-1]
    return bool(same.any())


def require_fit(bounds: Bounds, trajectory: Rows, boxes: Rows, tracks: Rows) -> None:
    """Raise FormatError where tables do not fit each other: rows of no frame or track, a track of other rows."""
    for name, rows in (("trajectory", trajectory), ("boxes", boxes)):
        absent = ~np.isin(rows["frame"], bounds.frames)
        if absent.any():
            found = f"frame {rows['frame'][int(np.argmax(absent))]}, which the run has not"
            raise FormatError(bounds.path, f"/{name}, frame", found, "frames of the run")
    if (tracks["last"] < tracks["first"]).any() or len(np.unique(tracks["id"])) != len(tracks):
        raise FormatError(bounds.path, "/tracks", "a track that ends before it begins, or twice", "each once")
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
