"""Image of bodies and shadows by other means: every ray against every ellipsoid, no boxes, no kernels."""

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.simulation.rendering.body import Bodies


def hits(rays: Singles, eye: Floats, bodies: Bodies) -> Floats:
    """Depth at which each pixel's ray meets each body, inf where it does not, float64 (n, v, u).

    The roots of |form (eye + t ray - centre)|^2 = 1, each part by itself.
    """
    people, parts = bodies.centre.shape[:2]
    depth = np.full((people, *rays.shape[:2]), np.inf)
    for person in range(people):
        for part in range(parts):
            metric = bodies.form[person, part].T @ bodies.form[person, part]
            ray, start = rays.astype(float), eye - bodies.centre[person, part]
            a = np.einsum("vui,ij,vuj->vu", ray, metric, ray)
            b = 2 * np.einsum("vui,ij,j->vu", ray, metric, start)
            c = start @ metric @ start - 1
            under = b * b - 4 * a * c
            with np.errstate(invalid="ignore", divide="ignore"):
                t = (-b - np.sqrt(under)) / (2 * a)
            met = (under > 0) & (t > 0)
            depth[person] = np.where(met, np.minimum(depth[person], t), depth[person])
    return depth


def extents(masks: Floats) -> Ints:
    """First and last column, first and last row, and number of the pixels of masks (n, v, u); int64 (n, 5)."""
    table = np.empty((len(masks), 5), np.int64)
    for row, mask in enumerate(masks):
        v, u = np.nonzero(mask)
        empty = (mask.shape[1], -1, mask.shape[0], -1, 0)
        table[row] = (u.min(), u.max(), v.min(), v.max(), len(u)) if len(u) else empty
    return table


def shade(ground: Singles, bodies: Bodies, lamp: Floats, umbra: float, penumbra: float) -> Floats:
    """Darkness of the ground, 0..1 (v, u): walk along the way to the lamp and keep the nearest to each middle."""
    dark = np.zeros(ground.shape[:2])
    point = np.concatenate([ground, np.zeros_like(ground[..., :1])], -1).astype(float)
    way = np.linspace(0.0, 4.0, 801)[:, None, None, None] * lamp
    for centre, form in zip(bodies.centre.reshape(-1, 3), bodies.form.reshape(-1, 3, 3), strict=True):
        miss = np.linalg.norm((point + way - centre) @ form.T, axis=-1).min(axis=0)
        dark = np.fmax(dark, np.clip((penumbra - miss) / (penumbra - umbra), 0.0, 1.0))
    return dark
