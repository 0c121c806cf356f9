"""People in colour pictures by a detector in an ONNX file."""

import ast
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Boxes, Bytes, Floats, Ints, Singles
from stseg.errors import FormatError, one_of
from stseg.io.detectors.layouts import LAYOUTS, ScoredBoxes, recognise
from stseg.io.detectors.networks import Network
from stseg.io.detectors.picture_fit import fit_picture
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import parse_whole

PERSON = "person"
_LEAST_SCORE = 0.25
_OVERLAP = 0.6
"""Intersection over union of two boxes from which on they are one person's."""
_CANDIDATES = 3000
"""Greatest number of boxes of a picture among which people are chosen."""


class OnnxDetector:
    """Finds people, or other classes, in colour pictures.

    SourceError, FormatError where the file is no model whose outputs are known, or has no such class.

    Parameters
    ----------
    path
        The ONNX file.
    classes
        Names or numbers of the wanted classes; a model without names has people as class 0.
    least_score
        Boxes of lower score are left out; None for 0.25.
    by_opencv
        See `Network`.
    """

    def __init__(
        self,
        path: Path,
        classes: Sequence[str] = (PERSON,),
        least_score: float | None = None,
        by_opencv: bool | None = None,
    ) -> None:
        self._network = Network(path, by_opencv)
        self._least = _LEAST_SCORE if least_score is None else least_score
        grey = np.full((*self._network.size[::-1], 3), 114, np.uint8)
        outputs = self._network(_as_input(grey, True, 1.0))
        layout = recognise(outputs, self._network.size)
        if layout is None:
            found = f"the outputs {', '.join(map(str, self._network.header.outputs))}"[: limits.PATH]
            expected = "; ".join(f"{one.name} {one.shapes}" for one in LAYOUTS)
            raise FormatError(path, "", found, f"those of a known detector: {expected}")
        self.layout = layout
        self._wanted = _class_numbers(path, classes, class_names(self._network.header.metadata))

    def detect(self, picture: Bytes) -> Boxes:
        """Boxes in a picture, uint8 (v, u, 3) in the order blue, green, red; the best score first."""
        whole, place = fit_picture(picture, self._network.size, self.layout.fit)
        outputs = self._network(_as_input(whole, self.layout.rgb, self.layout.largest))
        found = self.layout.decode(outputs, self._network.size)
        if found is None:
            shapes = ", ".join(f"{name} {list(array.shape)}" for name, array in outputs.items())
            raise FormatError(self._network.path, "", f"the outputs {shapes}", f"those of {self.layout.name}")
        corners, score = self._chosen(found)
        corners = place.back(corners)
        size = np.tile(picture.shape[1::-1], 2)
        corners = np.clip(corners, 0, size)
        return Boxes(np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1), score)

    def _chosen(self, found: ScoredBoxes) -> tuple[Floats, Floats]:
        """Corners and scores of one candidate for each person."""
        columns = self._wanted[self._wanted < found.score.shape[1]]
        score = found.score[:, columns].max(axis=1, initial=0.0)
        whole = np.isfinite(found.corners).all(axis=1) & (found.corners[:, 2:] > found.corners[:, :2]).all(axis=1)
        rows = np.flatnonzero(whole & (score >= self._least))
        rows = rows[np.argsort(-score[rows], kind="stable")][:_CANDIDATES]
        if not self.layout.suppressed and len(rows):
            boxes = np.concatenate([found.corners[rows, :2], found.corners[rows, 2:] - found.corners[rows, :2]], axis=1)
            kept = cv2.dnn.NMSBoxes(boxes.tolist(), score[rows].tolist(), 0.0, _OVERLAP)
            rows = rows[np.sort(np.asarray(kept, int).ravel())]
        return found.corners[rows], np.clip(score[rows], 0, 1)


def class_names(metadata: Mapping[str, str]) -> dict[int, str]:
    """Names of classes by number in a model's metadata, where Ultralytics writes them as a dictionary of Python."""
    try:
        names = ast.literal_eval(metadata.get("names", "{}")[: limits.LINE])
        return {int(number): str(name) for number, name in dict(names).items()}
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return {}


def _class_numbers(path: Path, classes: Sequence[str], names: Mapping[int, str]) -> Ints:
    """Numbers of classes, int64 (n,); FormatError where a model has none of that name."""
    by_name = {name.lower(): number for number, name in names.items()} or {PERSON: 0}
    found = []
    for name in classes:
        number = parse_whole(name, 0, limits.FRAMES) if name.isdecimal() else by_name.get(name.lower())
        if number is None or (names and number not in names):
            expected = one_of(name, [*by_name]) + (", or its number" if not names else "")
            raise FormatError(path, "classes", repr(name), expected)
        found.append(number)
    return np.array(found, np.int64)


def _as_input(picture: Bytes, rgb: bool, largest: float) -> Singles:
    """A picture uint8 (v, u, 3) as a network takes it, float32 (1, 3, v, u)."""
    channels = picture[:, :, ::-1] if rgb else picture
    return np.ascontiguousarray(channels.transpose(2, 0, 1)[None], np.float32) * np.float32(largest / 255)
