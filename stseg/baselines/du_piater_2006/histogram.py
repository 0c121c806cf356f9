"""Colours of clothes as HSV histograms (Du and Piater 2006, section 3.3; Perez et al. 2002).

A pixel with enough saturation and brightness counts in one of 10 x 10 bins of hue and saturation, another in one of 10
bins of its value. A body has one histogram for each of its parts, the thirds of the box around it, so that it matters
where a colour is. Colours are sampled at a lattice of points in an ellipse inside the box.
"""

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.kernels.accelerate import kernel

BINS = 110
"""10 x 10 of hue and saturation, 10 of value."""
PARTS = 3
"""Thirds of a body, from the head down."""
_BINS_PER_AXIS = 10
_GREY, _DARK = 0.1, 0.2  # saturation and value, 0..1, below which hue means nothing (Perez et al.)
_LEVELS = 32  # of each channel of the colour table
_LATTICE = (9, 24)  # points across and along an ellipse
_ELLIPSE_WIDTH = 0.8  # relative to the box


def hsv_bins() -> Bytes:
    """The bin of every colour, blue, green and red divided by 8, uint8 (32, 32, 32)."""
    level = (np.arange(_LEVELS) + 0.5) / _LEVELS
    blue, green, red = np.meshgrid(level, level, level, indexing="ij")
    value = np.maximum(np.maximum(blue, green), red)
    chroma = value - np.minimum(np.minimum(blue, green), red)
    saturation = chroma / value
    safe = np.where(chroma > 0, chroma, 1.0)
    sector = np.select(
        [value == red, value == green], [(green - blue) / safe % 6, (blue - red) / safe + 2], (red - green) / safe + 4
    )
    hue_step = np.minimum((sector / 6 * _BINS_PER_AXIS).astype(int), _BINS_PER_AXIS - 1)
    saturation_step = np.minimum((saturation * _BINS_PER_AXIS).astype(int), _BINS_PER_AXIS - 1)
    value_step = np.minimum((value * _BINS_PER_AXIS).astype(int), _BINS_PER_AXIS - 1)
    coloured = (saturation > _GREY) & (value > _DARK)
    chosen = np.where(
        coloured, hue_step * _BINS_PER_AXIS + saturation_step, _BINS_PER_AXIS * _BINS_PER_AXIS + value_step
    )
    return np.asarray(chosen, np.uint8)


def ellipse_points() -> Floats:
    """Sampling points of a box: shares of its width and height, by rising height share, float64 (k, 2)."""
    across, along = ((np.arange(n) + 0.5) / n for n in _LATTICE)
    points = np.stack(np.meshgrid(across, along), -1).reshape(-1, 2)
    inside = points[((2 * points - 1) ** 2).sum(1) <= 1]
    return np.asarray(0.5 + (inside - 0.5) * (_ELLIPSE_WIDTH, 1.0))


HSV_BINS = hsv_bins()
POINTS = ellipse_points()


def histograms(image: Bytes, boxes: Floats, nearer: Floats) -> tuple[Floats, Floats]:
    """Colour histograms of the parts of boxes.

    Parameters
    ----------
    image : uint8 (v, u, 3)
        Blue, green, red.
    boxes : float64 (n, 4)
        left, top, right, bottom, pixels; nan where there is none.
    nearer : float64 (k, 4)
        Boxes of bodies in front of all of these.

    Returns
    -------
    float64 (n, part, bin), float64 (n, part)
        Each part's sum is 1, or 0 where nothing of it is seen; and the share of it that is seen, 0..1.
    """
    colours, share = np.zeros((len(boxes), PARTS, BINS)), np.zeros((len(boxes), PARTS))
    fill_histograms(image, HSV_BINS, boxes, nearer, POINTS, colours, share)
    return colours, share


@kernel
def fill_histograms(
    image: Bytes, bins: Bytes, boxes: Floats, nearer: Floats, points: Floats, colours: Floats, share: Floats
) -> None:
    """Fill colours (n, part, bin), which are zero, and share (n, part); see `histograms`."""
    rows, columns = image.shape[:2]
    parts = colours.shape[1]
    points_of_part = np.zeros(parts)
    for k in range(len(points)):
        points_of_part[int(points[k, 1] * parts)] += 1.0
    for i in range(len(boxes)):
        left, top = boxes[i, 0], boxes[i, 1]
        wide, tall = boxes[i, 2] - left, boxes[i, 3] - top
        if not (wide > 0.0 and tall > 0.0):
            continue
        for k in range(len(points)):
            x, y = left + points[k, 0] * wide, top + points[k, 1] * tall
            u, v = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
            if not (0 <= u < columns and 0 <= v < rows) or _within(x, y, nearer):
                continue
            chosen = bins[image[v, u, 0] >> 3, image[v, u, 1] >> 3, image[v, u, 2] >> 3]
            part = int(points[k, 1] * parts)
            colours[i, part, chosen] += 1.0
            share[i, part] += 1.0
        for part in range(parts):
            for b in range(colours.shape[2]):
                colours[i, part, b] /= max(share[i, part], 1.0)
            share[i, part] /= points_of_part[part]


@kernel
def _within(x: float, y: float, boxes: Floats) -> bool:
    """Whether a pixel lies within the ellipse of one of the boxes."""
    for k in range(len(boxes)):
        a = (2.0 * x - boxes[k, 0] - boxes[k, 2]) / (boxes[k, 2] - boxes[k, 0])
        b = (2.0 * y - boxes[k, 1] - boxes[k, 3]) / (boxes[k, 3] - boxes[k, 1])
        if a * a + b * b <= 1.0:
            return True
    return False
