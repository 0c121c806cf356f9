"""The plane of reference of measured points: the ground, or another one that holds four of them, such as a wall."""

from heapq import nlargest
from itertools import combinations

import numpy as np

from stseg.arrays import Flags, Floats, even_rows
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_requirements import MIN_POINTS, all_but_one_on_line
from stseg.geometry.fits import homogeneous

_FLAT = 0.005
"""Distance from a plane within which points lie on it, metres."""
_MOST_POINTS = 40
"""Points of which planes are made, spread over all."""
_TRIES = 50
"""Planes with the most points that are tried."""


def plane_frame(place: Floats) -> Floats:
    """From the world to a frame whose plane z = 0 is that of reference, float64 (4, 4), for places (n, 3), metres.

    The ground, where it holds enough points; else the plane that holds the most.
    """
    if _spans(place[np.abs(place[:, 2]) <= _FLAT]):
        return np.eye(4)
    some = place[even_rows(len(place), _MOST_POINTS)]
    planes = nlargest(_TRIES, combinations(some, 3), key=lambda three: int(_on_plane(some, three).sum()))
    candidates = (place[_on_plane(place, three)] for three in planes)
    frame, points = np.eye(4), next(filter(_spans, candidates), None)
    if points is not None:
        axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
        axes[2] *= np.linalg.det(axes)
        frame[:3, :3], frame[:3, 3] = axes, -axes @ points.mean(axis=0)
    return frame


def in_plane_frame(points: Points, frame: Floats) -> Points:
    """The points in a frame of `plane_frame`; those on its plane have no height."""
    place = homogeneous(points.place) @ frame[:3].T
    return Points(points.pixel, place[:, :2], np.where(np.abs(place[:, 2]) <= _FLAT, 0.0, place[:, 2]))


def _spans(place: Floats) -> bool:
    """Whether points are enough for a homography, as `require_plane` has it."""
    return len(place) >= MIN_POINTS and not all_but_one_on_line(place[even_rows(len(place), _MOST_POINTS)])


def _on_plane(place: Floats, three: tuple[Floats, ...]) -> Flags:
    normal = np.cross(three[1] - three[0], three[2] - three[0])
    size = np.linalg.norm(normal)
    return np.asarray(np.abs((place - three[0]) @ normal) <= _FLAT * size) & (size > 0)
