"""Views whose boxes never stand where other views see people: exchanged files, other frames, columns or image sizes.

Of right views of five real recordings 58 % to 100 % of the feet that do not meet others by chance meet them in their
own frame (none of 27 views warns: by this, fewer than 11 in 100 do, 95 %); of exchanged ones less than a quarter.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from stseg.arrays import Flags, Floats, Ints
from stseg.geometry import Camera

_RADIUS = 0.75
"""Distance within which feet of two views meet, metres."""
_AGREEMENT = 0.2
"""Share of the feet that do not meet by chance, below which a view does not agree with the others."""
_STANDING = 0.85
"""Share of feet that meet feet of their own view at another time, above which people stand and nothing can be said."""
_LAGS = (0.3, 0.5, 0.7)
"""Shifts in time by which chance is measured, in lengths of the recording."""
_PLACES_AT_ONCE = 1 << 15
"""Places that are projected at a time."""
_LEAST_FEET, _FRAMES = 50, 200
"""Least number of feet for a statement, and number of frames that are looked at."""


Feet = Sequence[tuple[Ints, Floats]]
"""Frames int64 (n,) of each camera's boxes, and where they stand, float64 (n, 2), metres."""


def agreement_warnings(cameras: Sequence[Camera], feet: Feet, by_centres: Callable[[], Feet]) -> list[str]:
    """A warning that names the cameras whose feet meet those of other cameras hardly more often than by chance.

    Where they meet if each box's left and top are its centre, `by_centres`, it asks for that.
    """
    strangers = _strangers(cameras, feet)
    if not strangers:
        return []
    every = by_centres()
    some = [(every if k in strangers else feet)[k] for k in range(len(cameras))]
    remedy = "are its file, first frame, columns, image size and lower edges of boxes right?"
    if not (_strangers(cameras, some) and _strangers(cameras, every)):
        remedy = "are left and top the centres of its boxes? (name these columns x and y)"
    names = ", ".join(cameras[k].name for k in strangers)
    return [f"{names}: people stand where other cameras see them hardly more often than by chance: {remedy}"]


def _strangers(cameras: Sequence[Camera], feet: Feet) -> list[int]:
    view = np.repeat(np.arange(len(cameras)), [len(frame) for frame, _ in feet])
    frame, ground = np.concatenate([one for one, _ in feet]), np.concatenate([one for _, one in feet])
    order = np.argsort(frame, kind="stable")
    view, frame, ground = view[order], frame[order], ground[order]
    return [k for k in range(len(cameras)) if _is_stranger(k, cameras, view, frame, ground)]


def _visible(index: int, cameras: Sequence[Camera], ground: Floats) -> Flags:
    """Whether a camera other than the own sees a place, bool (n,)."""
    visible = np.zeros(len(ground), bool)
    for k, camera in enumerate(cameras):
        for start in range(0, len(ground) if k != index else 0, _PLACES_AT_ONCE):
            part = slice(start, start + _PLACES_AT_ONCE)
            pixel, ahead = camera.project(ground[part], 0.0)
            with np.errstate(invalid="ignore"):
                visible[part] |= ahead & (pixel >= 0).all(axis=1) & (pixel < camera.size).all(axis=1)
    return visible


def _is_stranger(index: int, cameras: Sequence[Camera], view: Ints, frame: Ints, ground: Floats) -> bool:
    chosen = np.flatnonzero(view == index)
    chosen = chosen[_visible(index, cameras, ground[chosen])]
    kept = np.unique(frame[chosen])
    chosen = chosen[np.isin(frame[chosen], kept[:: max(1, len(kept) // _FRAMES)])]
    if len(chosen) < _LEAST_FEET:
        return False
    first, length = int(frame[0]), int(frame[-1] - frame[0]) + 1
    lags = [int(length * part) for part in _LAGS]

    def share(lag: int, partners: Flags) -> float:
        later = first + (frame[chosen] - first + lag) % length  # the recording begins anew at its end
        then = np.flatnonzero(partners & np.isin(frame, later))  # a day has too many others for a tree
        tree = cKDTree(_apart(frame[then], ground[then]))
        away, _ = tree.query(_apart(later, ground[chosen]), distance_upper_bound=_RADIUS)
        return float(np.mean(away < _RADIUS))

    if np.mean([share(lag, view == index) for lag in lags]) > _STANDING:
        return False
    chance = np.mean([share(lag, view != index) for lag in lags])
    return bool(share(0, view != index) - chance < _AGREEMENT * (1 - chance))


def _apart(frame: Ints, ground: Floats) -> Floats:
    """Places (n, 3) of which those of two frames are farther from each other than feet meet, metres."""
    return np.column_stack([frame * 2 * _RADIUS, ground])
