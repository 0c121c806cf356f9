"""Appearance features of people in colour pictures, by a model for re-identification in an ONNX file."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats, Singles
from stseg.errors import FormatError
from stseg.io.detectors.networks import Network
from stseg.io.untrusted import limits

_SIDES = (256, 128)
"""Height and width of the input where a model does not say them, pixels: most are trained with these."""
_IMAGENET = np.array([[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]])
"""Mean and deviation of red, green and blue, 0..1: pictures are trained with less the one, over the other."""
_UNCHANGED = np.array([[0.0], [1.0]])
_TOGETHER = 16
"""Crops in one pass where a model takes any number; more cost no less."""
_FIXED = 256
"""Greatest number of crops that a model may want in one pass."""


class FeatureModel:
    """Describes people by vectors of length 1.

    SourceError, FormatError where the file is no model that makes one vector of each picture.

    Parameters
    ----------
    path
        The ONNX file.
    by_opencv
        See `Network`.
    """

    def __init__(self, path: Path, by_opencv: bool | None = None) -> None:
        self._network = Network(path, by_opencv, _SIDES, _FIXED)
        subtracted = self._network.header.subtracted
        self._white = 1.0 if subtracted is None or subtracted <= 1 else 255.0
        self._mean, self._deviation = _IMAGENET if subtracted is None else _UNCHANGED
        width, height = self._network.size
        self._together = self._network.pictures or 1
        samples = np.random.default_rng(0).integers(0, 256, (2, height, width, 3), np.uint8)
        alone = self._vectors(samples)
        self.length = alone.shape[1]
        """Numbers of a vector."""
        if self._network.pictures is None:
            # Some models were exported with the length of a single picture inside.
            with suppress(FormatError, ValueError):
                if np.allclose(self._pass(samples), alone, atol=1e-3):
                    self._together = _TOGETHER

    def describe(self, pictures: Sequence[Bytes], boxes: Sequence[Floats]) -> Singles:
        """Features of the boxes in each picture, one picture after another, float32 (box, length).

        Pictures are uint8 (v, u, 3) in the order blue, green, red; boxes float64 (n, 4) left, top, width, height in
        their pixels. Of a box beyond the picture the nearest pixels are described.
        """
        crops = [
            cv2.resize(_crop(picture, box), self._network.size, interpolation=cv2.INTER_LINEAR)
            for picture, here in zip(pictures, boxes, strict=True)
            for box in here
        ]
        return self._vectors(np.array(crops, np.uint8)) if crops else np.zeros((0, self.length), np.float32)

    def _vectors(self, crops: Bytes) -> Singles:
        """Vectors (n, length) of crops uint8 (n, v, u, 3), in as many passes as it takes."""
        starts = range(0, len(crops), self._together)
        return np.concatenate([self._pass(crops[start : start + self._together]) for start in starts])

    def _pass(self, crops: Bytes) -> Singles:
        """Those of one pass; one that is too short for a fixed number of pictures is filled up with the last."""
        count = max(len(crops), self._network.pictures or 1)
        whole = crops[np.minimum(np.arange(count), len(crops) - 1), :, :, ::-1]
        pixels = (whole.astype(np.float32) * np.float32(self._white / 255) - self._mean) / self._deviation
        outputs = self._network(np.ascontiguousarray(pixels.transpose(0, 3, 1, 2), np.float32))
        found = _table(outputs, count)
        if found is None:
            shapes = ", ".join(f"{name} {list(array.shape)}" for name, array in outputs.items())
            expected = f"one vector of each picture, [{count}, length]"
            raise FormatError(self._network.path, "", f"the outputs {shapes}"[: limits.PATH], expected)
        if not np.isfinite(found).all():
            raise FormatError(self._network.path, "", "a feature that is no finite number", "finite numbers alone")
        size = np.linalg.norm(found, axis=1, keepdims=True)
        return np.asarray(found / np.maximum(size, np.finfo(float).tiny), np.float32)[: len(crops)]


def _crop(picture: Bytes, box: Floats) -> Bytes:
    """The pixels of a box, one at least."""
    size = np.array(picture.shape[1::-1])
    first = np.clip(np.floor(box[:2]), 0, size - 1).astype(int)
    stop = np.clip(np.ceil(box[:2] + box[2:]), first + 1, size).astype(int)
    return picture[first[1] : stop[1], first[0] : stop[0]]


def _table(outputs: Mapping[str, Floats], count: int) -> Floats | None:
    """The single output as a table of `count` vectors; None where it is none."""
    array = next(iter(outputs.values()))
    if len(outputs) != 1 or array.ndim < 2 or len(array) != count or array.size != count * array.shape[1]:
        return None
    return array.reshape(count, -1) if 2 <= array.shape[1] <= limits.FEATURES else None
