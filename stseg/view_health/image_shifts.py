"""Image registration of colour cameras to their backgrounds: a shift of one pixel reveals a knocked camera."""

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from scipy.fft import irfft2, rfft2

from stseg.arrays import Bytes, Floats, Observation, Rows, Singles
from stseg.records.tables import SHIFT

_PERIOD = 2.0
"""Time between measurements, seconds."""
_PEAK_RADIUS = 2
"""Radius of the sub-pixel centroid around a correlation peak, pixels."""


def shift_is_due(frame: int, frame_rate: float) -> bool:
    """Whether shifts are measured in a frame."""
    return frame % max(1, round(_PERIOD * frame_rate)) == 0


def image_shifts(
    frame: int, views: Sequence[Observation], backgrounds: Sequence[Singles | None], factors: Sequence[int]
) -> Rows:
    """SHIFT rows of a frame: shifts of the cameras' images relative to their background images.

    Parameters
    ----------
    frame
        Its number.
    views, backgrounds
        Observation and background image float32 (v, u, 3) of each camera; those without either are not measured.
    factors
        Reduction factor of each camera's images; shifts are in pixels of the full-size image.
    """
    rows = []
    for view, (image, background, factor) in enumerate(zip(views, backgrounds, factors, strict=True)):
        if background is not None and isinstance(image, np.ndarray):
            u, v = factor * background_shift(np.clip(background, 0, 255).astype(np.uint8), np.asarray(image, np.uint8))
            rows.append((frame, view, float(u), float(v)))
    return np.array(rows, SHIFT)


def background_shift(background: Bytes, image: Bytes) -> Floats:
    """Shift (u, v) of an image's edges against the background, both uint8 (v, u, 3), pixels, float64 (2,).

    Phase correlation of the edges (Kuglin and Hines, The phase correlation image alignment method, 1975), which people
    and changes of light disturb little.
    """
    # With SciPy's transforms: OpenCV's differ in the last digits from one call to the next.
    one, other = (rfft2(_edges(picture) * _window(*picture.shape[:2])) for picture in (background, image))
    crossed = np.conj(one) * other
    likeness = irfft2(crossed / np.maximum(np.abs(crossed), np.float32(1e-12)), image.shape[:2])
    return _peak(np.asarray(likeness))


@lru_cache(maxsize=8)  # shapes of a rig's images
def _window(rows: int, columns: int) -> Singles:
    """Hann window: the image's borders would otherwise count as edges that do not move."""
    return np.outer(np.hanning(rows), np.hanning(columns)).astype(np.float32)


def _peak(likeness: Singles) -> Floats:
    """Sub-pixel position (u, v) of the correlation peak: the centroid around the highest pixel."""
    middle = np.array(likeness.shape) // 2
    centred = np.roll(likeness, tuple(middle), (0, 1))
    v, u = map(int, np.unravel_index(int(np.argmax(centred)), centred.shape))
    rows = np.arange(max(v - _PEAK_RADIUS, 0), min(v + _PEAK_RADIUS + 1, centred.shape[0]))
    columns = np.arange(max(u - _PEAK_RADIUS, 0), min(u + _PEAK_RADIUS + 1, centred.shape[1]))
    weight = np.maximum(centred[np.ix_(rows, columns)], 0.0)
    centre = np.array([weight.sum(0) @ columns, weight.sum(1) @ rows]) / max(float(weight.sum()), 1e-12)
    return np.asarray(centre - middle[::-1])


def _edges(image: Bytes) -> Singles:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    across, down = (np.asarray(cv2.Sobel(grey, cv2.CV_16S, *step), np.float32) for step in ((1, 0), (0, 1)))
    # The fourth root, so that strong edges count little more than weak ones. Roots are rounded exactly, logarithms are
    # not: equal pictures give equal results to the last bit.
    return np.asarray(np.sqrt(np.sqrt(across**2 + down**2)))
