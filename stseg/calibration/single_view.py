"""One view by itself from the foot and head ends of people who are about as tall (METHODS 1).

Feet and heads of equal people are two parallel planes seen together: with square pixels and a known middle of the
image they give the horizon, the vertical, the focal length and the camera's height in people.
Lv, Zhao and Nevatia, Camera calibration from video of a walking human, PAMI 28(9), 2006.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import least_squares

from stseg.arrays import Flags, Floats
from stseg.calibration.endpoints import Ends
from stseg.calibration.pinhole import CENTRE, CLOCK, FOCAL, RADIAL, SIZE, TURN, looking, on_plane, project

_SPREAD = 0.05
"""How far ends are from where a model of equal, upright people has them, in lengths of a person."""
FORWARD = 0.15
"""Metres by which the lowest point of a silhouette is nearer to the camera than the body's axis: a toe, half a step."""
_STARTS = tuple(product((0.6, 0.9, 1.4), (0.2, 0.5), (0.0, -0.3)))
"""Focal length in widths, pitch in radians, k1 from which the search starts."""
_FIRST, _MOST = 60, 300
"""How many people and frames are asked at first and at last."""


def view_of_upright(ends: Ends, size: tuple[int, int], person_height: float) -> tuple[Floats, float]:
    """A camera in a world of its own, at (0, 0, z) and looking along +y, from upright people.

    Parameters
    ----------
    ends
        Feet and heads in this view.
    size
        Width and height of the image, pixels.
    person_height
        How tall people are, metres.

    Returns
    -------
    float64 (12,), float
        The camera, and the median miss of heads in lengths of a person.
    """
    few, some = (_spread_out(ends, most) for most in (_FIRST, _MOST))

    def fit(rows: Ends, start: Floats, most: int) -> tuple[float, Floats]:
        def miss(unknown: Floats) -> Floats:
            return np.concatenate([_head_misses(_view(unknown), rows, size, person_height) / _SPREAD, _prior(unknown)])

        found = least_squares(miss, start, loss="cauchy", max_nfev=most)
        return float(found.cost), np.asarray(found.x)

    starts = [np.array([np.log(focal), pitch, 0.0, np.log(3.0), k1]) for focal, pitch, k1 in _STARTS]
    rough = sorted((fit(few, start, 10) for start in starts), key=_cost)
    _, best = min((fit(some, unknown, 40) for _, unknown in rough[:3]), key=_cost)
    view = _view(best)
    away = _head_misses(view, some, size, person_height).reshape(-1, 2)
    return view, float(np.median(np.hypot(*away.T)))


def _spread_out(ends: Ends, most: int) -> Ends:
    return ends.of(np.unique(np.linspace(0, len(ends) - 1, min(most, len(ends))).astype(np.int64)))


def _cost(fit: tuple[float, Floats]) -> float:
    return fit[0]


def _view(unknown: Floats) -> Floats:
    """The camera of log focal length, pitch, roll, log height, k1."""
    focal, pitch, roll, height, k1 = unknown
    view = np.zeros(SIZE)
    view[FOCAL], view[TURN], view[CENTRE], view[RADIAL] = focal, looking(pitch, roll), (0, 0, np.exp(height)), (k1, 0)
    view[CLOCK] = 0.0
    return view


def _prior(unknown: Floats) -> Floats:
    """What cameras are like, in standard deviations: lenses of 40 to 90 degrees, upright, a few metres up."""
    focal, _, roll, height, k1 = unknown
    return np.array([(focal - np.log(0.9)) / 0.4, roll / 0.1, (height - np.log(3.0)) / 0.7, (k1 + 0.15) / 0.2])


def _head_misses(view: Floats, ends: Ends, size: tuple[int, int], person_height: float) -> Floats:
    """How far heads are from above their feet, in lengths of a person, float64 (2n,); 1 where feet have no ground."""
    ground = axis_of_foot(view, size, ends.foot, FORWARD)
    known: Flags = np.asarray(np.isfinite(ground).all(axis=1))
    top = np.column_stack([np.where(known[:, None], ground, 0.0), np.full(len(ground), person_height)])
    many = np.ones(len(top))
    head = project(np.tile(view, (len(top), 1)), many * size[0], many * size[1], top)
    miss = (head - ends.head) / ends.length[:, None]
    return np.asarray(np.where(known[:, None] & np.isfinite(miss), np.clip(miss, -1, 1), 1.0).ravel())


def axis_of_foot(view: Floats, size: tuple[int, int], foot: Floats, forward: float) -> Floats:
    """Where the axis of a body stands whose lowest point, `forward` metres nearer, shows at a pixel, float64 (n, 2)."""
    ground = on_plane(view, size, foot, 0.0)
    away = ground - view[CENTRE][:2]
    return np.asarray(ground + forward * away / np.linalg.norm(away, axis=1, keepdims=True))
