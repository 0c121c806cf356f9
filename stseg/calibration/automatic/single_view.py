"""Self-calibration of a single view from the feet and heads of upright people of similar height.

Feet and heads of people of one height span two parallel planes. With square pixels and a centred principal point they
determine the horizon, the vertical, the focal length and the camera's height in body heights.
Lv, Zhao and Nevatia, Camera calibration from video of a walking human, PAMI 28(9), 2006.
"""

from itertools import product
from operator import itemgetter

import numpy as np
from scipy.optimize import least_squares

from stseg.arrays import Flags, Floats, even_rows
from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.pinhole import CENTRE, FOCAL, RADIAL, SIZE, TURN, looking, on_plane, project

_SPREAD = 0.05
"""Standard deviation of endpoints around the model of equal upright people, in body lengths."""
FORWARD = 0.25
"""Distance from a body's axis to its lowest visible point, towards the camera (a toe, half a step), metres."""
_STARTS = tuple(product((0.6, 0.9, 1.4), (0.2, 0.5), (0.0, -0.3)))
"""Starts of the search: focal length in image widths, pitch in radians, k1."""
_COARSE_PAIRS, _FINE_PAIRS = 60, 300
"""Number of endpoint pairs in the first and the last stage of the search."""


def view_of_upright(endpoints: Endpoints, size: tuple[int, int], person_height: float) -> tuple[Floats, float]:
    """Camera at (0, 0, z) looking along +y, from upright people.

    Parameters
    ----------
    endpoints
        Feet and heads in this view.
    size
        Width and height of the image, pixels.
    person_height
        Mean body height, metres.

    Returns
    -------
    float64 (14,), float
        The camera (see `stseg.calibration.pinhole`), and the median head residual in body lengths.
    """
    coarse, fine = (endpoints.of(even_rows(len(endpoints), most)) for most in (_COARSE_PAIRS, _FINE_PAIRS))

    def fit(rows: Endpoints, start: Floats, most: int) -> tuple[float, Floats]:
        def residual(unknown: Floats) -> Floats:
            focal, _, roll, height, k1 = unknown
            # Field of view of 40 to 90 degrees, upright, a few metres high.
            prior = [(focal - np.log(0.9)) / 0.4, roll / 0.1, (height - np.log(3.0)) / 0.7, (k1 + 0.15) / 0.2]
            return np.append(_head_residuals(_view(unknown), rows, size, person_height) / _SPREAD, prior)

        found = least_squares(residual, start, loss="cauchy", max_nfev=most)
        return float(found.cost), np.asarray(found.x)

    starts = [np.array([np.log(focal), pitch, 0.0, np.log(3.0), k1]) for focal, pitch, k1 in _STARTS]
    rough = sorted((fit(coarse, start, 10) for start in starts), key=itemgetter(0))
    _, best = min((fit(fine, unknown, 40) for _, unknown in rough[:3]), key=itemgetter(0))
    view = _view(best)
    away = _head_residuals(view, fine, size, person_height).reshape(-1, 2)
    return view, float(np.median(np.hypot(*away.T)))


def _view(unknown: Floats) -> Floats:
    """Camera vector of log focal length, pitch, roll, log height and k1."""
    focal, pitch, roll, height, k1 = unknown
    view = np.zeros(SIZE)
    view[FOCAL], view[TURN], view[CENTRE], view[RADIAL] = focal, looking(pitch, roll), (0, 0, np.exp(height)), (k1, 0)
    return view


def _head_residuals(view: Floats, endpoints: Endpoints, size: tuple[int, int], person_height: float) -> Floats:
    """Head residuals given the feet, in body lengths, float64 (2n,); 1 where feet are above the horizon."""
    ground = axis_of_foot(view, size, endpoints.foot, FORWARD)
    on_ground: Flags = np.asarray(np.isfinite(ground).all(axis=1))
    top = np.column_stack([np.where(on_ground[:, None], ground, 0.0), np.full(len(ground), person_height)])
    many = np.ones(len(top))
    head = project(np.tile(view, (len(top), 1)), many * size[0], many * size[1], top)
    residual = (head - endpoints.head) / endpoints.length[:, None]
    return np.asarray(np.where(on_ground[:, None] & np.isfinite(residual), np.clip(residual, -1, 1), 1.0).ravel())


def axis_of_foot(view: Floats, size: tuple[int, int], foot: Floats, forward: float) -> Floats:
    """Ground point of a body's axis, (n, 2); `foot` is its lowest visible point, `forward` metres nearer."""
    ground = on_plane(view, size, foot, 0.0)
    away = ground - view[CENTRE][:2]
    return np.asarray(ground + forward * away / np.linalg.norm(away, axis=1, keepdims=True))
