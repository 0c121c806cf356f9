"""Detections of one camera as a detector or an annotation tool writes them, before frames are counted from 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.errors import FormatError
from stseg.io.detections.masks import Mask
from stseg.io.toml.text import abbreviated
from stseg.io.untrusted import limits
from stseg.io.untrusted.numbers import finite_number, parse_number

LEAST_NUMBERS = ("frame", "left", "top", "width", "height", "score")


@dataclass(frozen=True)
class Request:
    """Request to a reader.

    Attributes
    ----------
    path
        File or folder.
    size
        Width and height of the camera's image, pixels.
    view
        Number of the camera in files that hold several, from 0; None where it is not given.
    select
        Pattern of image names in files that hold several cameras' images; empty for all.
    image_list
        File with the images of COCO results, or None.
    columns
        Names of the columns of a CSV or Parquet file, by the names of ours.
    """

    path: Path
    size: tuple[int, int]
    view: int | None = None
    select: str = ""
    image_list: Path | None = None
    columns: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Detections:
    """All detections of one camera.

    Attributes
    ----------
    frame : int64 (n,)
        Frame of each detection, as the source counts them.
    pixel : float64 (n, 4)
        left, top, width, height in pixels.
    score : float64 (n,)
        0..1; 1 where the source gives none.
    label
        Class of each detection: its name, or its number as text; empty where the source has no classes.
    mask
        Mask of each detection, None where it has none; empty where the source has no masks.
    frames
        Number of frames where the source lists them all, counted from 0; None where it lists detections alone.
    features : float32 (n, feature), or None
        Appearance features.
    """

    frame: Ints
    pixel: Floats
    score: Floats
    label: tuple[str, ...] = ()
    mask: tuple[Mask | None, ...] = ()
    frames: int | None = None
    features: Singles | None = None

    def __len__(self) -> int:
        return len(self.frame)

    def of(self, rows: Flags | Ints) -> Detections:
        """A subset, by index or mask."""
        index = np.flatnonzero(rows) if rows.dtype == bool else rows
        label = tuple(self.label[k] for k in index) if self.label else ()
        mask = tuple(self.mask[k] for k in index) if self.mask else ()
        features = None if self.features is None else self.features[index]
        frame, pixel, score = self.frame[index], self.pixel[index], self.score[index]
        return Detections(frame, pixel, score, label, mask, self.frames, features)

    def classes(self) -> dict[str, int]:
        """Number of detections of each class, the most frequent first."""
        names, counts = np.unique(np.array(self.label, dtype=object), return_counts=True)
        return {str(names[k]): int(counts[k]) for k in np.argsort(-counts, kind="stable")}


class DetectionList:
    """Collects detections one by one, and refuses what is no box.

    Parameters
    ----------
    path
        The file, for errors.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._numbers: list[tuple[float, ...]] = []
        self._label: list[str] = []
        self._mask: list[Mask | None] = []

    def __len__(self) -> int:
        return len(self._numbers)

    def add(
        self,
        place: str,
        frame: int,
        box: Sequence[object],
        score: object = 1.0,
        label: str = "",
        mask: Mask | None = None,
    ) -> None:
        """Add a detection: left, top, width, height in pixels; `place` is where it stands in the file."""
        values = (number(self._path, place, "box", one) for one in box)
        row = (float(frame), *values, number(self._path, place, "score", score))
        if len(row) != len(LEAST_NUMBERS):
            raise FormatError(self._path, place, f"a box of {len(row) - 2} numbers", "4 numbers")
        if row[3] < 0 or row[4] < 0:
            raise FormatError(self._path, place, f"a box {row[3]:g} by {row[4]:g} pixels", "0 or more pixels")
        if abs(frame) > limits.FRAMES or len(self._numbers) >= limits.ROWS:
            found = f"frame {frame:.0f}, row {len(self._numbers) + 1}"
            raise FormatError(self._path, place, found, f"at most {limits.FRAMES} frames and {limits.ROWS} rows")
        if not 0 <= row[5] <= 1:
            raise FormatError(self._path, place, f"score {row[5]:g}", "a score of 0..1")
        self._numbers.append(row)
        self._label.append(label)
        self._mask.append(mask)

    def add_corners(
        self, place: str, frame: int, corners: Sequence[object], score: object = 1.0, label: str = "",
        mask: Mask | None = None,
    ) -> None:  # fmt: skip
        """Add a detection by its left, top, right and bottom edges."""
        if len(corners) != 4:
            raise FormatError(self._path, place, f"a box of {len(corners)} numbers", "4 numbers")
        left, top, right, bottom = (number(self._path, place, "box", one) for one in corners)
        self.add(place, frame, (left, top, right - left, bottom - top), score, label, mask)

    def done(self, frames: int | None = None) -> Detections:
        """All that were added."""
        values = np.array(self._numbers, float).reshape(-1, len(LEAST_NUMBERS))
        if frames is not None and not 0 <= frames <= limits.FRAMES:
            raise FormatError(self._path, "", f"{frames:.3g} frames", f"at most {limits.FRAMES}")
        _, crowds = np.unique(values[:, 0], return_counts=True)
        if crowds.max(initial=0) > limits.BOXES_PER_FRAME:
            raise FormatError(self._path, "", f"{crowds.max()} boxes in a frame", f"at most {limits.BOXES_PER_FRAME}")
        label = tuple(self._label) if any(self._label) else ()
        mask = tuple(self._mask) if any(one is not None for one in self._mask) else ()
        return Detections(values[:, 0].astype(np.int64), values[:, 1:5], values[:, 5], label, mask, frames)


def number(path: Path, place: str, name: str, value: object) -> float:
    """A finite number, or a FormatError."""
    if isinstance(value, np.generic):
        value = value.item()
    found = parse_number(value) if isinstance(value, str) else finite_number(value)
    if found is None or not abs(found) <= limits.NUMBER:
        raise FormatError(path, place, f"{name} {abbreviated(value)}", "a finite number of usual size")
    return found
