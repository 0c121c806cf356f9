"""Layouts of detectors' outputs: recognised by their shapes, decoded to corners and scores.

Each layout names the pixels that its network is trained with: RGB 0..1 or BGR 0..255, letter-boxed or stretched.
Sources: Jocher et al., YOLOv5 and YOLOv8; Wang et al., YOLOv7; Li et al., YOLOv6, 2022; Ge et al., YOLOX, 2021,
section 2; Wang et al., YOLOv10, 2024; Zhao et al., DETRs beat YOLOs on real-time object detection (RT-DETR), 2024.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.io.detectors.picture_fit import Fit

Outputs = Mapping[str, Floats]
"""Arrays that a network returned, by name."""
_STRIDES = ((8, 16, 32), (8, 16, 32, 64))
"""Sides of the squares of the input that one prediction stands for, pixels."""


@dataclass(frozen=True)
class ScoredBoxes:
    """Boxes of one picture before a choice."""

    corners: Floats
    """float64 (n, 4): left, top, right, bottom, pixels of the network's input."""
    score: Floats
    """float64 (n, class): score of each class, 0..1."""


@dataclass(frozen=True)
class Layout:
    """A layout of outputs, and the pixels that go with it."""

    name: str
    shapes: str
    """Its name, and the shapes in words, for messages."""
    decode: Callable[[Outputs, tuple[int, int]], ScoredBoxes | None]
    """Boxes of the outputs and the size (width, height) of the input; None where the outputs have other shapes."""
    fit: Fit = "centre"
    rgb: bool = True
    largest: float = 1.0
    """The input: its place, the order of its channels (blue, green, red where not `rgb`), and its value of white."""
    suppressed: bool = False
    """Whether one person has one candidate already."""


def recognise(outputs: Outputs, size: tuple[int, int]) -> Layout | None:
    """The layout of outputs for a grey picture in an input of `size` (width, height); None for an unknown one."""
    return next((layout for layout in LAYOUTS if layout.decode(outputs, size) is not None), None)


def _yolo8(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:
    """[1, 4 + C, N]: centre and size, class scores; of segmentation also the weights of masks, which are left out."""
    rows, masks = _single(outputs)
    if rows is None or rows.shape[0] < 5 + masks or _strides(rows.shape[1], size) is None:
        return None
    return ScoredBoxes(_from_centres(rows[:4].T), rows[4 : len(rows) - masks].T)


def _yolo5(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:
    """[1, N, 5 + C], three predictions a square: centre and size, objectness, class scores."""
    rows, masks = _single(outputs)
    if rows is None or rows.shape[1] < 6 + masks or _strides(rows.shape[0] / 3, size) is None:
        return None
    score = rows[:, 4:5] * rows[:, 5 : rows.shape[1] - masks]
    return ScoredBoxes(_from_centres(rows[:, :4]), score)


def _yolo6(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:
    """[1, N, 5 + C], one prediction a square, objectness 1 throughout."""
    rows, _ = _single(outputs)
    if rows is None or rows.shape[1] < 6 or _strides(rows.shape[0], size) is None or (rows[:, 4] != 1).any():
        return None
    return ScoredBoxes(_from_centres(rows[:, :4]), rows[:, 5:])


def _yolox(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:
    """[1, N, 5 + C], one prediction a square: offsets from the square and logarithms of sizes, in its sides.

    Some exports have the decoding inside: their centres lie near the squares.
    """
    rows, _ = _single(outputs)
    strides = None if rows is None or rows.shape[1] < 6 else _strides(rows.shape[0], size)
    if rows is None or strides is None:
        return None
    corner, side = _squares(strides, size)
    boxes = rows[:, :4]
    if np.abs(boxes[:, :2]).mean() < np.abs(boxes[:, :2] - corner * side).mean():
        boxes = np.concatenate([(boxes[:, :2] + corner) * side, np.exp(np.minimum(boxes[:, 2:], 20)) * side], axis=1)
    return ScoredBoxes(_from_centres(boxes), rows[:, 4:5] * rows[:, 5:])


def _suppressed(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:  # noqa: ARG001
    """[1, N, 6]: corners, score, class; or [N, 7]: picture, corners, class, score."""
    rows, *more = outputs.values()
    if not more and rows.ndim == 3 and rows.shape[::2] == (1, 6):
        rows = rows[0]
    elif not more and rows.ndim == 2 and rows.shape[1] == 7:
        rows = rows[:, [1, 2, 3, 4, 6, 5]]
    else:
        return None
    return ScoredBoxes(rows[:, :4], _by_class(rows[:, 4], rows[:, 5]))


def _lists(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:  # noqa: ARG001
    """Three outputs: corners [1, N, 4], and the score and class [1, N] of each, scores no whole numbers."""
    arrays = [array[0] for array in outputs.values() if array.ndim in (2, 3) and len(array) == 1]
    boxes = [array for array in arrays if array.ndim == 2 and array.shape[1] == 4]
    flat = [array for array in arrays if array.ndim == 1 and len(boxes) == 1 and len(array) == len(boxes[0])]
    if len(outputs) != 3 or len(boxes) != 1 or len(flat) != 2:
        return None
    score, number = sorted(flat, key=lambda array: bool((array == array.round()).all()))
    return ScoredBoxes(boxes[0], _by_class(score, number))


def _rtdetr(outputs: Outputs, size: tuple[int, int]) -> ScoredBoxes | None:
    """Centres and sizes in shares of the input, and class scores or their logits: [1, N, 4] and [1, N, C], or one."""
    arrays = [array[0] for array in outputs.values() if array.ndim == 3 and len(array) == 1]
    if len(arrays) == 1 and len(outputs) == 1 and arrays[0].shape[1] > 4:
        arrays = [arrays[0][:, :4], arrays[0][:, 4:]]
    if len(arrays) != 2 or len(outputs) > 2 or len(arrays[0]) != len(arrays[1]):
        return None
    boxes, score = sorted(arrays, key=lambda array: array.shape[1] != 4)
    if boxes.shape[1] != 4 or (np.abs(boxes) > 2).any():
        return None
    if score.min(initial=0) < 0 or score.max(initial=0) > 1:
        score = 1 / (1 + np.exp(-score))
    return ScoredBoxes(_from_centres(boxes) * np.tile(size, 2), score)


LAYOUTS = (
    Layout("YOLOv8 to YOLO11", "[1, 4 + C, N]", _yolo8),
    Layout("YOLOv5 or YOLOv7", "[1, 3 N, 5 + C]", _yolo5),
    Layout("YOLOv6", "[1, N, 5 + C]", _yolo6),
    Layout("YOLOX", "[1, N, 5 + C]", _yolox, "corner", rgb=False, largest=255.0),
    Layout("YOLO with suppression inside", "[1, N, 6] or [N, 7]", _suppressed, suppressed=True),
    Layout("RT-DETR with its choice inside", "[1, N, 4], [1, N] and [1, N]", _lists, "stretch", suppressed=True),
    Layout("RT-DETR", "[1, N, 4] and [1, N, C], or [1, N, 4 + C]", _rtdetr, "stretch", suppressed=True),
)
"""In the order in which they are tried. C: classes; N: squares of 8, 16 and 32 pixels, or predictions."""


def _single(outputs: Outputs) -> tuple[Floats | None, int]:
    """The one table among the outputs, and the number of masks' weights at the end of its rows (4-D outputs)."""
    tables = [array[0] for array in outputs.values() if array.ndim == 3 and len(array) == 1]
    masks = [array.shape[1] for array in outputs.values() if array.ndim == 4]
    if len(tables) != 1 or len(masks) > 1 or len(outputs) != 1 + len(masks):
        return None, 0
    return tables[0], sum(masks)


def _strides(count: float, size: tuple[int, int]) -> Sequence[int] | None:
    """The strides whose squares number `count` in an input of `size`."""
    return next((some for some in _STRIDES if sum((size[0] // s) * (size[1] // s) for s in some) == count), None)


def _squares(strides: Sequence[int], size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Column and row (n, 2) and side (n, 1) of each square, those of the smallest first, row by row."""
    shapes = [(size[1] // stride, size[0] // stride) for stride in strides]
    corner = np.concatenate([np.indices(shape)[::-1].reshape(2, -1).T for shape in shapes])
    side = np.repeat(strides, [rows * columns for rows, columns in shapes])
    return corner.astype(float), side[:, None].astype(float)


def _from_centres(boxes: Floats) -> Floats:
    """Corners of centres and sizes (n, 4)."""
    half = boxes[:, 2:4] / 2
    return np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)


def _by_class(score: Floats, number: Floats) -> Floats:
    """Scores (n, class) of detections with a score and the number of a class, each (n,)."""
    number = np.clip(number, 0, 10_000).astype(int)
    table = np.zeros((len(score), int(number.max(initial=0)) + 1))
    table[np.arange(len(score)), number] = score
    return table
