"""A camera's picture in the fixed size that a network takes, and its boxes back in the camera's pixels."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats

Fit = Literal["centre", "corner", "stretch"]
"""The picture keeps its proportions and stands in the middle or in the upper left corner, or it is stretched."""
_GREY = 114
"""Border of a letter box, as the YOLO detectors are trained with."""


@dataclass(frozen=True)
class PictureFit:
    """Place of a picture in a network's input: pixel = place * scale + shift, each (u, v)."""

    scale: Floats
    shift: Floats

    def back(self, corners: Floats) -> Floats:
        """Left, top, right, bottom (n, 4) of the input as those of the picture."""
        return np.asarray((corners - np.tile(self.shift, 2)) / np.tile(self.scale, 2))


def fit_picture(picture: Bytes, size: tuple[int, int], fit: Fit) -> tuple[Bytes, PictureFit]:
    """A picture uint8 (v, u, 3) in an input of `size` (width, height), and its place there."""
    height, width = picture.shape[:2]
    if fit == "stretch":
        inner = size
    else:
        factor = min(size[0] / width, size[1] / height)
        inner = max(1, round(width * factor)), max(1, round(height * factor))
    resized = cv2.resize(picture, inner, interpolation=cv2.INTER_LINEAR)
    left, top = ((size[k] - inner[k]) // 2 if fit == "centre" else 0 for k in (0, 1))
    whole = np.full((size[1], size[0], 3), _GREY, np.uint8)
    whole[top : top + inner[1], left : left + inner[0]] = resized
    scale = np.array([inner[0] / width, inner[1] / height])
    return whole, PictureFit(scale, np.array([left, top], float))
