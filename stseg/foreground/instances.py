"""Instance segmentation images, one value a person, as boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Ints
from stseg.errors import SourceError
from stseg.kernels.accelerate import kernel


def instance_boxes(instances: NDArray[np.uint16]) -> Boxes:
    """The tight box around each instance.

    Parameters
    ----------
    instances : uint16 (v, u)
        One value an instance, 0 for background.

    Returns
    -------
    Boxes
        In increasing order of the values that occur, score 1. Pixel centres are integers, so the box of the single
        pixel (u, v) is (u - 0.5, v - 0.5, 1, 1).

    Raises
    ------
    SourceError
        Where it is not an indexed image.
    """
    if instances.ndim != 2 or instances.dtype != np.uint16:
        raise SourceError("instances", "", f"{instances.dtype} {instances.shape}", "uint16 (v, u)")
    height, width = instances.shape
    bounds = np.empty((int(instances.max(initial=0)) + 1, 4), np.int64)
    bounds[:] = (width, height, -1, -1)
    _bound(instances, bounds)
    found = bounds[1:][bounds[1:, 2] >= 0]
    pixel = np.column_stack([found[:, :2] - 0.5, found[:, 2:] - found[:, :2] + 1.0])
    return Boxes(pixel, np.ones(len(pixel)))


@kernel
def _bound(instances: NDArray[np.uint16], bounds: Ints) -> None:
    """Widen `bounds` (value, [first u, first v, last u, last v]) around every pixel that is not background."""
    for v in range(instances.shape[0]):
        for u in range(instances.shape[1]):
            value = instances[v, u]
            if value != 0:
                bounds[value, 0] = min(bounds[value, 0], u)
                bounds[value, 1] = min(bounds[value, 1], v)
                bounds[value, 2] = max(bounds[value, 2], u)
                bounds[value, 3] = max(bounds[value, 3], v)
