"""The people detector of OpenCV 4: histograms of oriented gradients, judged by a linear support vector machine.

OpenCV 5 leaves it out, so it is computed here, with OpenCV's coefficients (people_svm.npy, Apache License 2.0). It
finds people who stand upright and whole, from 100 pixels of height on. Source: Dalal and Triggs, Histograms of oriented
gradients for human detection, 2005; `HOGDescriptor` of OpenCV 4.
"""

from functools import cache
from importlib.resources import files
from io import BytesIO

import cv2
import numpy as np

from stseg.arrays import Boxes, Bytes, Floats, Singles

_WINDOW = (64, 128)
"""Width and height of the window that is judged, pixels: a person and 16 pixels around."""
_CELL, _BINS = 8, 9
"""Side of a cell, pixels, and directions of its histogram. A block is two by two cells; blocks begin at each cell."""
_BLOCKS = (7, 15)
"""Columns and rows of blocks of a window."""
_CLIPPED = 0.2
"""Share of a block's length at which one of its numbers is cut off."""
_PADDING = 16
"""Mirrored pixels around the picture."""
_SCALE_STEP = 1.1
_INNER = np.array([0.25, 0.125, 0.5, 0.68])
"""Left, top, width, height of a person in the chosen window, shares of it, measured on people who walk in a room: their
feet are 0.12 of the window higher than its margin of training says."""
_PLATT = (3.4, -2.7)
"""Factor of the margin and constant of the log odds of a person, measured on the same people. Source: Platt,
Probabilistic outputs for support vector machines, 1999."""
_LEAST_SCORE = 0.3
_OVERLAP = 0.4
"""Intersection over union of two windows from which on they are one person's."""
_SUPPORT = 2
"""Number of windows around a person: fewer are chance."""


class HogDetector:
    """Finds people in colour pictures; boxes of a lower score than `least_score` (None: 0.3) are left out."""

    runtime = "histograms of oriented gradients"

    def __init__(self, least_score: float | None = None) -> None:
        self._least = _LEAST_SCORE if least_score is None else least_score

    def detect(self, picture: Bytes) -> Boxes:
        """Boxes in a picture, uint8 (v, u, 3) in the order blue, green, red; the best score first.

        The score is the probability of a person at the margin of the support vector machine.
        """
        windows, margin = _windows(picture)
        score = 1 / (1 + np.exp(-_PLATT[0] * margin - _PLATT[1]))
        rows = np.flatnonzero(score >= self._least)
        windows, score = windows[rows], score[rows]
        if not len(rows):
            return Boxes(np.zeros((0, 4)), np.zeros(0))
        chosen = np.asarray(cv2.dnn.NMSBoxes(windows.tolist(), score.tolist(), 0.0, _OVERLAP), int).ravel()
        chosen = chosen[[int((_overlap(windows[k], windows) > _OVERLAP).sum()) >= _SUPPORT for k in chosen]]
        people = windows[chosen] * [1, 1, 0, 0] + windows[chosen][:, [2, 3, 2, 3]] * _INNER
        return Boxes(people, score[chosen])


def _windows(picture: Bytes) -> tuple[Floats, Floats]:
    """Left, top, width, height (n, 4) of the windows of all scales, pixels, and the margin (n,) of each."""
    height, width = picture.shape[:2]
    found, margins, scale = [np.zeros((0, 4))], [np.zeros(0)], 1.0
    while min(width / scale / _WINDOW[0], height / scale / _WINDOW[1]) >= 1:
        size = round(width / scale), round(height / scale)
        margin = window_margins(np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR_EXACT), np.uint8))
        corner = np.indices(margin.shape)[::-1].reshape(2, -1).T * _CELL - _PADDING
        boxes = np.concatenate([corner, np.broadcast_to(_WINDOW, corner.shape)], axis=1)
        keep = margin.ravel() > 0
        found.append(boxes[keep] * scale)
        margins.append(margin.ravel()[keep])
        scale *= _SCALE_STEP
    return np.concatenate(found), np.concatenate(margins)


def window_margins(picture: Bytes) -> Floats:
    """Margins of all windows, float64 (row, column), which begin every 8 pixels from 16 before the picture on."""
    blocks = _blocks(_directions(picture))
    weights, bias = _coefficients()
    parts = (blocks @ weights).astype(float)
    rows, columns = (count - blocks + 1 for count, blocks in zip(parts.shape[:2], _BLOCKS[::-1], strict=True))
    margin = np.full((rows, columns), bias)
    for k in range(weights.shape[1]):
        x, y = divmod(k, _BLOCKS[1])
        margin += parts[y : y + rows, x : x + columns, k]
    return margin


def _directions(picture: Bytes) -> Singles:
    """Lengths of gradients by direction, float32 (direction, v, u), each shared by the two nearest of 9 directions.

    Of roots of grey values, of the colour that changes most; the picture's border is mirrored.
    """
    edge = _PADDING + 1
    root = np.sqrt(cv2.copyMakeBorder(picture, edge, edge, edge, edge, cv2.BORDER_REFLECT_101).astype(np.float32))
    across, down, square = (np.full((root.shape[0] - 2, root.shape[1] - 2), start, np.float32) for start in (0, 0, -1))
    for colour in cv2.split(root):
        x, y = colour[1:-1, 2:] - colour[1:-1, :-2], colour[2:, 1:-1] - colour[:-2, 1:-1]
        both = x * x + y * y
        larger = both > square
        across, down, square = (np.where(larger, *pair) for pair in ((x, across), (y, down), (both, square)))
    length, angle = cv2.cartToPolar(across, down)
    place = angle * np.float32(_BINS / np.pi) - np.float32(0.5)
    first = np.floor(place)
    share = (place - first) * length
    lower = first.astype(np.int32) % _BINS
    found, pixel = np.zeros((_BINS, length.size), np.float32), np.arange(length.size)
    found[lower.ravel(), pixel] = (length - share).ravel()
    found[(lower.ravel() + 1) % _BINS, pixel] = share.ravel()
    return found.reshape(_BINS, *length.shape)


def _blocks(directions: Singles) -> Singles:
    """Normalised histograms of all blocks, float32 (row, column, 36): cells by columns, then directions."""
    rows, columns = (length // _CELL for length in directions.shape[1:])
    weights = _cell_weights()
    cells = directions[:, : rows * _CELL, : columns * _CELL]
    cells = weights @ cells.reshape(_BINS, rows, _CELL, -1)
    cells = cells.reshape(_BINS, rows, 4, columns, _CELL) @ weights.T
    # Of each cell of the picture: two weights as first half of a block, two as second half, along both axes.
    cells = cells[:, :-1, :2] + cells[:, 1:, 2:]
    cells = cells[..., :-1, :2] + cells[..., 1:, 2:]
    blocks = cells.transpose(1, 3, 4, 2, 0).reshape(rows - 1, columns - 1, -1)
    blocks = blocks / (np.linalg.norm(blocks, axis=2, keepdims=True) + 0.1 * blocks.shape[2])
    blocks = np.minimum(blocks, _CLIPPED)
    return np.asarray(blocks / (np.linalg.norm(blocks, axis=2, keepdims=True) + 1e-3), np.float32)


def _cell_weights() -> Singles:
    """Weights of a block's pixels in its two cells, float32 (half and cell, pixel): less far from either's middle."""
    place = np.arange(2 * _CELL)
    share = np.maximum(1 - np.abs((place + 0.5) / _CELL - 0.5 - np.arange(2)[:, None]), 0)
    weights = share * np.exp(-((place - _CELL) ** 2) / 32)
    return np.asarray(weights.reshape(2, 2, _CELL).transpose(1, 0, 2).reshape(4, _CELL), np.float32)


def _overlap(box: Floats, others: Floats) -> Floats:
    """Intersection over union of a box (4,) with others (n, 4)."""
    inner = np.minimum(box[:2] + box[2:], others[:, :2] + others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    area = np.maximum(inner, 0).prod(axis=1)
    return np.asarray(area / (box[2:].prod() + others[:, 2:].prod(axis=1) - area))


@cache
def _coefficients() -> tuple[Singles, float]:
    """Weights (36, block) and the constant of the support vector machine."""
    numbers = np.load(BytesIO(files("stseg.io.detectors").joinpath("people_svm.npy").read_bytes()))
    return numbers[:-1].reshape(_BLOCKS[0] * _BLOCKS[1], -1).T, float(numbers[-1])
