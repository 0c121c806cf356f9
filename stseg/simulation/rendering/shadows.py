"""Soft shadows of ellipsoids on the ground."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.kernels.accelerate import kernel

PENUMBRA = 1.3
"""Outer radius of the penumbra, in half axes of the ellipsoid."""
_UMBRA = 0.75  # radius of full shadow


@kernel
def darken(
    ground: Singles,
    boxes: Ints,
    centre: Floats,
    form: Floats,
    lamp: Floats,
    shade: Singles,
) -> None:
    """Raise `shade`, 0..1, of every pixel's ground point to the shadow cast there.

    Parameters
    ----------
    ground : float32 (v, u, 2)
        Ground point of each pixel, metres; nan where there is none.
    boxes : int64 (n, 4)
        Image boxes that contain the shadows, see `pixel_boxes`.
    centre, form
        Of the ellipsoids, float64 (n, 3) and (n, 3, 3), see `stseg.simulation.rendering.body.Bodies`.
    lamp : float64 (3,)
        Direction towards the light.
    shade : float32 (v, u)
        Modified in place.
    """
    for k in range(len(centre)):
        m = form[k]
        lx = m[0, 0] * lamp[0] + m[0, 1] * lamp[1] + m[0, 2] * lamp[2]
        ly = m[1, 0] * lamp[0] + m[1, 1] * lamp[1] + m[1, 2] * lamp[2]
        lz = m[2, 0] * lamp[0] + m[2, 1] * lamp[1] + m[2, 2] * lamp[2]
        length = lx * lx + ly * ly + lz * lz
        z = -centre[k, 2]
        for v in range(boxes[k, 2], boxes[k, 3] + 1):
            for u in range(boxes[k, 0], boxes[k, 1] + 1):
                x, y = ground[v, u, 0] - centre[k, 0], ground[v, u, 1] - centre[k, 1]
                px = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
                py = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
                pz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
                along = px * lx + py * ly + pz * lz
                # Distance of the light's ray from the centre, in half axes.
                miss = np.sqrt(max(px * px + py * py + pz * pz - along * along / length, 0.0))
                dark = (PENUMBRA - miss) / (PENUMBRA - _UMBRA)
                if dark > shade[v, u]:
                    shade[v, u] = min(dark, 1.0)
