"""Array aliases, and the records of observations and evidence.

Volumes are always `(time, plane, y, x)`, one frame of a volume `(plane, y, x)`, images `(v, u)` with pixel centres at
integer coordinates (u to the right, v down). Names carry the frame of reference: `ground` is metres on the ground
plane, `pixel` is image coordinates, `cell` is an index into the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Labels = NDArray[np.int32]
Shorts = NDArray[np.int16]
Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Rows = NDArray[np.void]
"""A structured array; its dtype is one of those in `stseg.records.tables`."""
AnyArray = NDArray[Any]


def by_track(table: Rows) -> list[Rows]:
    """The rows of each `id` in the order of `frame`, by rising id: parts of one copy."""
    table = table[np.lexsort((table["frame"], table["id"]))]
    return np.split(table, np.flatnonzero(np.diff(table["id"])) + 1) if len(table) else []


def even_rows(count: int, most: int) -> Ints:
    """At most `most` row numbers, spread evenly over `count` rows from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).astype(np.int64))


def repeated_rows(table: Rows, names: Sequence[str]) -> Flags:
    """Rows whose values in these columns stand in an earlier row, bool (n,)."""
    keys, repeats = [table[name] for name in names], np.zeros(len(table), bool)
    order = np.lexsort(keys)
    repeats[order[1:]] = np.logical_and.reduce([key[order[1:]] == key[order[:-1]] for key in keys])
    return repeats


def ground_of(rows: Rows) -> Floats:
    """Ground points x and y of rows, metres, float64 (n, 2)."""
    return np.column_stack([rows["x"], rows["y"]]).astype(float, copy=False)


def some_columns(table: Rows, dtype: np.dtype[np.void]) -> Rows:
    """A copy of the columns of a dtype."""
    rows = np.empty(len(table), dtype)
    for name in dtype.names or ():
        rows[name] = table[name]
    return rows


def columns(text: str) -> np.dtype[np.void]:
    """Dtype of rows with such columns as in `"frame:<i8 score:<f4"`."""
    return np.dtype([(name, kind) for name, kind in (column.split(":") for column in text.split())])


@dataclass(frozen=True, slots=True)
class Boxes:
    """A detector's boxes in one view of one frame.

    Attributes
    ----------
    pixel : float64 (n, 4)
        left, top, width, height in pixels; edges, not pixel centres, of the distorted image.
    score : float64 (n,)
        Detection score of each box, 0..1; 1 where the detector gives none.
    features : float32 (n, feature), or None
        Appearance features of each box, as the detector gives them.
    """

    pixel: Floats
    score: Floats
    features: Singles | None = None

    def __len__(self) -> int:
        return len(self.pixel)

    def __repr__(self) -> str:
        return f"Boxes({len(self)} boxes{'' if self.features is None else ' with appearance features'})"

    def of(self, chosen: Flags | Ints | slice) -> Boxes:
        """A subset, by index, mask or slice."""
        features = None if self.features is None else self.features[chosen]
        return Boxes(self.pixel[chosen], self.score[chosen], features)


@dataclass(frozen=True, slots=True)
class AlignedBoxes(Boxes):
    """Boxes that were moved to where the other views see their people."""

    right: Floats = field(default_factory=lambda: np.zeros(0))
    """float64 (n,): how far to the right, pixels."""


Observation = Bytes | NDArray[np.uint16] | Singles | Boxes | None
"""Data of one camera for one frame: a colour image uint8 (v, u, 3), a mask uint8 (v, u), an instance image
uint16 (v, u), a foreground likelihood float32 (v, u), boxes, or None where it is blind."""

ViewEvidence = Boxes | Singles | None
"""Result of the foreground stage for an observation: boxes, a likelihood map float32 (v, u), or None where the view is
blind."""
