"""Networks in ONNX files, run by onnxruntime where it is installed (extra `onnx`), else by OpenCV."""

import re
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stseg.arrays import Floats, Singles
from stseg.errors import FormatError, SourceError
from stseg.io.detectors.onnx_header import parse_header
from stseg.io.extras import load_extra
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes, reading

_FLOAT32, _INT64, _FLOAT16 = 1, 7, 10
"""Types of numbers in ONNX files."""
_SIDES = (640, 640)
"""Height and width of the input where a detector does not say them, pixels: most are trained with these."""
_MODEL = "a model in ONNX"


class Network:
    """A network that takes colour pictures.

    SourceError, FormatError where the file cannot be read, is no ONNX, or takes anything else.

    Parameters
    ----------
    path
        The ONNX file.
    by_opencv
        Run by OpenCV; None: only where onnxruntime is not installed.
    sides
        Height and width of the input where the model does not say them, pixels.
    most_pictures
        Greatest fixed number of pictures in one pass.
    """

    def __init__(
        self, path: Path, by_opencv: bool | None = None, sides: tuple[int, int] = _SIDES, most_pictures: int = 1
    ) -> None:
        self.path = path
        with reading(path, _MODEL, SourceError):
            data = read_bytes(path, limits.MODEL_FILE)
        try:
            self.header = parse_header(data)
            """Inputs, outputs and metadata in the file."""
        except ValueError as error:
            raise FormatError(path, "", f"what is no ONNX ({error})", _MODEL) from error
        self.size = self._size(sides, most_pictures)
        """Width and height of a picture, pixels."""
        self.pictures = self.header.inputs[0].shape[0]
        """Fixed number of pictures in one pass; None for any."""
        self._elements = [one.element for one in self.header.inputs]
        by_opencv = _by_opencv() if by_opencv is None else by_opencv
        self.runtime = runtime(by_opencv)
        """The library that runs it, and its version."""
        self._run = self._by_opencv(data) if by_opencv else self._by_onnxruntime(data)

    def __call__(self, picture: Singles) -> dict[str, Floats]:
        """The outputs by name for pictures, float32 (n, 3, v, u); raises FormatError where the network fails."""
        names = [one.name for one in self.header.inputs]
        kind = np.float16 if self._elements[0] == _FLOAT16 else np.float32
        given: dict[str, Any] = {names[0]: picture.astype(kind)}
        if len(names) > 1:
            given[names[1]] = np.array([self.size], np.int64)  # of RT-DETR: the size in which boxes are wanted
        try:
            return {name: np.asarray(array, float) for name, array in self._run(given).items()}
        except Exception as error:  # onnxruntime has a type for each of its failures
            raise self._refused(error) from error

    def _size(self, sides: tuple[int, int], most_pictures: int) -> tuple[int, int]:
        """Width and height of the input; raises FormatError where it is no colour picture."""
        picture, *more = self.header.inputs
        shape = picture.shape
        colour = len(shape) == 4 and (shape[0] or 1) <= most_pictures and shape[1] in (3, None)
        size_alone = len(more) <= 1 and all(one.element == _INT64 and one.shape in ((1, 2), (None, 2)) for one in more)
        if not colour or not size_alone or picture.element not in (_FLOAT32, _FLOAT16):
            found = f"the inputs {', '.join(map(str, self.header.inputs))}"
            raise FormatError(self.path, "", found[: limits.PATH], "one colour picture, [1, 3, height, width]")
        height, width = (axis or side for axis, side in zip(shape[2:], self._trained_size(sides), strict=True))
        if height * width > limits.PIXELS:
            raise FormatError(self.path, "", f"an input of {width}x{height}", f"at most {limits.PIXELS} pixels")
        return width, height

    def _trained_size(self, default: tuple[int, int]) -> tuple[int, int]:
        """Height and width of the input where the model leaves them free, as Ultralytics writes them."""
        sides = [int(side) for side in re.findall(r"\d{2,5}", self.header.metadata.get("imgsz", ""))]
        return (sides[0], sides[1]) if len(sides) == 2 else default

    def _by_opencv(self, data: bytes) -> Callable[[dict[str, Any]], dict[str, Any]]:
        try:
            net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
        except cv2.error as error:
            raise self._refused(error) from error
        names = [one.name for one in self.header.outputs]

        def run(given: dict[str, Any]) -> dict[str, Any]:
            for name, array in given.items():
                net.setInput(array, name)
            return dict(zip(names, net.forward(names), strict=True))

        return run

    def _by_onnxruntime(self, data: bytes) -> Callable[[dict[str, Any]], dict[str, Any]]:
        library = _onnxruntime()
        options = library.SessionOptions()
        options.log_severity_level = 4
        try:
            session = library.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # as above
            raise self._refused(error) from error
        names = [one.name for one in self.header.outputs]
        return lambda given: dict(zip(names, session.run(names, given), strict=True))

    def _refused(self, error: Exception) -> FormatError:
        reason = " ".join(str(error).split())[:160]
        return FormatError(self.path, "", f"what {self.runtime} does not run ({reason})", _MODEL)


def runtime(by_opencv: bool | None = None) -> str:
    """The library that runs networks (see `Network`), and its version."""
    by_opencv = _by_opencv() if by_opencv is None else by_opencv
    return f"OpenCV {cv2.__version__}" if by_opencv else f"onnxruntime {_onnxruntime().__version__}"


def _by_opencv() -> bool:
    return find_spec("onnxruntime") is None


def _onnxruntime() -> Any:
    return load_extra("onnxruntime", "onnx")
