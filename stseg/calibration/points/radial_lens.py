"""Radial coefficients of a lens that points bear out."""

import numpy as np
from scipy.stats import f as fisher

from stseg.calibration.points.camera_models import ModelFit, Points, fit_model, project

MIN_POINTS = 8
"""Points from which on a lens is looked for."""
_CHANCE = 0.01
"""Greatest chance that errors of clicks alone give as much support to a coefficient."""
_LEAST_NOISE = 0.01
"""Least variance of a pixel in the test, square pixels: points of a simulation would bear out anything."""
_COEFFICIENTS = 2


def fit_radial_lens(pose: ModelFit, free: ModelFit, points: Points) -> ModelFit | None:
    """The pose with k1, or k1 and k2, where they are significant; None where none is, or a free camera fits better.

    The F test of nested models, each coefficient in its turn; its evidence must not hang on the one point that fits
    worst without it, which may be wrong. `pose` is the fit without a lens (`pose_model`), `free` that of a free camera.
    """
    found, plain = None, pose
    for _ in range(_COEFFICIENTS if len(points.pixel) >= MIN_POINTS else 0):
        bent = fit_model(pose.model, np.append(plain.unknowns, 0.0), points, np.ones(len(points.pixel), bool))
        straight = plain.refit(points, bent.used)
        off = np.hypot(*(project(straight.model, straight.unknowns, points.place) - points.pixel).T)
        fewer = bent.used & (off < off[bent.used].max())
        if not _significant(straight, bent) or not _significant(plain.refit(points, fewer), bent.refit(points, fewer)):
            break
        found = plain = bent
    return None if found is None or free.refit(points, found.used).noise < found.noise else found


def _significant(straight: ModelFit, bent: ModelFit) -> bool:
    noise = max(bent.noise, _LEAST_NOISE)
    return bool(fisher.sf((straight.squares - bent.squares) / noise, 1, bent.freedom) < _CHANCE)
