"""A detector's boxes as a likelihood map: a soft body in each box.

A box is not full of person: the corners are background. So each is filled with a body of two superellipses, a trunk
with legs and a narrower head, that falls from the box's score to 0 over a soft border inside the box.
"""

import math

import numpy as np

from stseg.arrays import Boxes, Floats, Singles
from stseg.errors import InputError
from stseg.kernels.accelerate import kernel

_BORDER = 0.3  # width of the soft border, as a share of the body's half width
_NECK = 0.13  # of the box's height: the head stands this high above the trunk
_HEAD_WIDTH = 0.4  # of the box's width, arms included
_HEAD_DEPTH = 0.2  # of the box's height: the head reaches this far down, into the trunk


def box_likelihood(boxes: Boxes, size: tuple[int, int], step: int = 1) -> Singles:
    """Likelihood of foreground of the boxes of one view.

    Parameters
    ----------
    boxes
        n boxes; pixel centres are integers, so an image of width w spans -0.5 .. w - 0.5. What lies outside the image
        is cut off; empty and inverted boxes are left out.
    size
        Width and height of the image, pixels.
    step
        Pixels per map pixel along u and v. Map pixel (j, i) covers image pixels step i .. step i + step - 1 and is
        evaluated at its centre, u = step i + (step - 1) / 2.

    Returns
    -------
    float32 (ceil(height / step), ceil(width / step))
        At each pixel the maximum over the boxes of score times body; 0 outside them. The map's
        consumer clamps it above 0.

    Raises
    ------
    InputError
        Where a box or score is not finite, or a score is outside 0..1.
    """
    if step < 1:
        raise InputError("boxes", "step", step, "1 or more pixels")
    if not np.isfinite(boxes.pixel).all():
        raise InputError("boxes", "pixel", "a number that is not finite", "left, top, width, height")
    if not ((boxes.score >= 0) & (boxes.score <= 1)).all():
        raise InputError("boxes", "score", boxes.score.tolist(), "numbers within 0..1")
    width, height = size
    likelihood = np.zeros((-(-height // step), -(-width // step)), np.float32)
    _fill(boxes.pixel, boxes.score, float(step), likelihood)
    return likelihood


@kernel
def _fill(pixel: Floats, score: Floats, step: float, likelihood: Singles) -> None:
    """Raise `likelihood` to each box's body; only map pixels with centres in the box are touched."""
    rows, columns = likelihood.shape
    offset = (step - 1.0) / 2.0
    for n in range(len(score)):
        left, top, width, height = pixel[n]
        if width <= 0.0 or height <= 0.0:
            continue
        first_u = int(max(math.ceil((left - offset) / step), 0.0))
        first_v = int(max(math.ceil((top - offset) / step), 0.0))
        last_u = int(min(math.floor((left + width - offset) / step), columns - 1.0))
        last_v = int(min(math.floor((top + height - offset) / step), rows - 1.0))
        for j in range(first_v, last_v + 1):
            down = (j * step + offset - top) / height
            for i in range(first_u, last_u + 1):
                across = 2.0 * (i * step + offset - left) / width - 1.0
                value = score[n] * body(across, down)
                if value > likelihood[j, i]:
                    likelihood[j, i] = value


@kernel
def body(across: float, down: float) -> float:
    """Density of a body at a place of its box, 0..1: across from -1 to 1, left to right, and down from 0 to 1."""
    half = 0.5 * (1.0 - _NECK)
    trunk = math.sqrt(math.sqrt(across**4 + ((down - _NECK - half) / half) ** 4))
    head = math.sqrt((across / _HEAD_WIDTH) ** 2 + (2.0 * down / _HEAD_DEPTH - 1.0) ** 2)
    return min(max((1.0 - min(trunk, head)) / _BORDER, 0.0), 1.0)
