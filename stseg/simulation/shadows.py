"""Shadows that ellipsoids cast on the ground, softer at their edges: a lamp has a size."""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles

PENUMBRA = 1.3
"""Where shadows end, in half axes of their ellipsoid around its middle."""
_UMBRA = 0.75  # where they are full


@kernel
def darken(
    ground: Singles,
    boxes: Ints,
    centre: Floats,
    form: Floats,
    lamp: Floats,
    shade: Singles,
) -> None:
    """Raise `shade`, 0..1 of every pixel's ground point, to the shadow that falls there.

    Parameters
    ----------
    ground : float32 (v, u, 2)
        Ground points that the pixels show, metres; nan where they show none.
    boxes : int64 (n, 4)
        Where the ellipsoids' shadows may fall, see `pixel_boxes`.
    centre, form
        Of the ellipsoids, float64 (n, 3) and (n, 3, 3), see `stseg.simulation.body.Bodies`.
    lamp : float64 (3,)
        Direction towards the light.
    shade : float32 (v, u)
        Changed in place.
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
                # How near the light's ray passes by the centre, in half axes.
                miss = np.sqrt(max(px * px + py * py + pz * pz - along * along / length, 0.0))
                dark = (PENUMBRA - miss) / (PENUMBRA - _UMBRA)
                if dark > shade[v, u]:
                    shade[v, u] = min(dark, 1.0)
