"""Floor features that two views share: SIFT and a robust homography (Khan and Shah 2009, section 4.2).

The views are roughly calibrated from people already. So each background is rectified to the ground first: there all
views share scale and orientation, and a feature is matched near its own position only. What is left between two
rectified plans is a homography near the identity, found by MAGSAC++ (Barath et al., CVPR 2020).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Ints
from stseg.geometry import Camera, Grid

_PLAN_RESOLUTION = 0.02
"""Resolution of a rectified plan, metres."""
_MAX_GROUND_RESOLUTION = 0.08
"""Coarsest ground resolution of an image that is used, metres a pixel."""
_SEARCH_RADIUS = 0.4
"""Search radius between two plans, metres."""
_DESCRIPTOR_RATIO = 0.8
"""Ratio test: greatest ratio of the best to the second best descriptor distance (Lowe 2004)."""
_INLIER_DISTANCE = 0.06
"""Inlier threshold of the homography, metres."""
_MIN_FEATURES = 25
"""Least number of features that two views must share."""


@dataclass(frozen=True)
class Marks:
    """Floor features, each in two views."""

    view: Ints
    """int64 (n, 2): indices of the two views."""
    pixel: Floats
    """float64 (n, 2, 2): its pixel in each of them."""
    ground: Floats
    """float64 (n, 2): approximate ground point, metres."""

    def __len__(self) -> int:
        return len(self.view)

    def of(self, rows: Ints) -> Marks:
        """A subset, by index."""
        return Marks(self.view[rows], self.pixel[rows], self.ground[rows])


def floor_marks(backgrounds: Sequence[Bytes], cameras: Sequence[Camera], grid: Grid) -> Marks:
    """Match floor features on the ground between every two of some roughly calibrated views.

    `backgrounds` uint8 (v, u, 3) are the empty scene in each view.
    """
    x, y = np.arange(grid.x[0], grid.x[1], _PLAN_RESOLUTION), np.arange(grid.y[0], grid.y[1], _PLAN_RESOLUTION)
    ground = np.stack(np.meshgrid(x, y), -1)  # of a plan, (y, x, 2)
    found = [_features(*pair, ground) for pair in zip(backgrounds, cameras, strict=True)]
    parts = []
    for i, j in combinations(range(len(cameras)), 2):
        rows = _shared(found[i], found[j])
        place = [found[k][0][rows[:, side]] for side, k in enumerate((i, j))]
        pixel = np.stack([cameras[k].project(place[side], 0.0)[0] for side, k in enumerate((i, j))], 1)
        parts.append((np.tile([i, j], (len(rows), 1)), pixel, (place[0] + place[1]) / 2))
    return Marks(
        np.concatenate([np.zeros((0, 2), np.int64), *(part[0] for part in parts)]),
        np.concatenate([np.zeros((0, 2, 2)), *(part[1] for part in parts)]),
        np.concatenate([np.zeros((0, 2)), *(part[2] for part in parts)]),
    )


def _features(background: Bytes, camera: Camera, ground: Floats) -> tuple[Floats, AnyArray]:
    """Ground points and upright SIFT descriptors of a plan, float64 (n, 2) and float32 (n, 128)."""
    pixel, ahead = camera.project(ground, 0.0)
    visible = ahead & camera.inside(pixel)
    across, down = (np.linalg.norm(np.gradient(pixel, axis=axis), axis=-1) for axis in (0, 1))
    visible &= np.minimum(across, down) > _PLAN_RESOLUTION / _MAX_GROUND_RESOLUTION
    place = np.where(visible[..., None], pixel, -1.0).astype(np.float32)
    plan = cv2.remap(cv2.cvtColor(background, cv2.COLOR_BGR2GRAY), place[..., 0], place[..., 1], cv2.INTER_LINEAR)
    plan = cv2.createCLAHE(3.0, (8, 8)).apply(plan)
    inner = cv2.erode(visible.astype(np.uint8), np.ones((9, 9), np.uint8))
    sift = cv2.SIFT.create(contrastThreshold=0.02)
    points = [cv2.KeyPoint(point.pt[0], point.pt[1], point.size, 0.0) for point in sift.detect(plan, inner)]
    if not points:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    kept, descriptor = sift.compute(plan, points)
    first: Floats = ground[0, 0]
    return first + _PLAN_RESOLUTION * np.array([point.pt for point in kept]), descriptor


def _shared(one: tuple[Floats, AnyArray], other: tuple[Floats, AnyArray]) -> Ints:
    """Matched rows of the features of two plans, int64 (n, 2)."""
    if min(len(one[0]), len(other[0])) < _MIN_FEATURES:
        return np.zeros((0, 2), np.int64)
    away = np.linalg.norm(one[0][:, None] - other[0][None], axis=2)
    square = (one[1] ** 2).sum(axis=1)[:, None] + (other[1] ** 2).sum(axis=1) - 2 * one[1] @ other[1].T
    unlike = np.where(away < _SEARCH_RADIUS, np.asarray(np.sqrt(np.maximum(square, 0.0)), float), np.inf)
    best = unlike.argmin(axis=1)
    rows = np.arange(len(best))
    first = unlike[rows, best]
    unlike[rows, best] = np.inf
    clear = np.isfinite(first) & (first < _DESCRIPTOR_RATIO * np.minimum(unlike.min(axis=1), 1e9))
    rows, best = rows[clear], best[clear]
    if len(rows) < _MIN_FEATURES:
        return np.zeros((0, 2), np.int64)
    ground = one[0][rows], other[0][best]
    _, inlier = cv2.findHomography(*ground, cv2.USAC_MAGSAC, _INLIER_DISTANCE, maxIters=5000, confidence=0.999)
    kept = np.zeros(len(rows), bool) if inlier is None else inlier.ravel() > 0
    pairs = np.stack([rows[kept], best[kept]], -1)
    return pairs if len(pairs) >= _MIN_FEATURES else np.zeros((0, 2), np.int64)
