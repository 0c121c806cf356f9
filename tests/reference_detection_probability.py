"""The detection probability and mean shift by their definitions, pixel by pixel and sample by sample: slow, plain."""

import math
from itertools import pairwise

import cv2
import numpy as np

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.baselines.huang_wang_2012.mean_shift import _KERNEL_EXTENT, _MODE_RADIUS, _REST_STEP, _STEP_LIMIT
from stseg.baselines.huang_wang_2012.pillar_strips import PillarStrips
from stseg.geometry import Camera

_FINE, _BITS, _DISCS, _POINTS = 4, 6, 30, 32
"""Image cells to a pixel and their fraction bits, discs to a pillar, points to a circle: of `drawn`."""


def nearest(edge: float) -> int:
    """The nearest whole number, halves upwards."""
    return math.floor(edge + 0.5)


def region(pillars: PillarStrips, place: int, heights: int, width: float, pad: int, shape: tuple[int, int]) -> Flags:
    """M_i of the pillar that reaches to the given one of the heights, on a map (v, u) with a margin all around."""
    mask = np.zeros((shape[0] + 2 * pad, shape[1] + 2 * pad), bool)
    for k in range(pillars.base + heights + 1):
        first, last = sorted(nearest(float(e)) + pad for e in pillars.edge[place, k : k + 2])
        middle, half = float(pillars.middle[place, k]), float(pillars.half[place, k]) * width
        left = nearest(middle - half) + pad
        right = max(nearest(middle + half) + pad, left + 1)
        if pillars.upright[place]:
            mask[first:last, left:right] = True
        else:
            mask[left:right, first:last] = True
    return mask


def chance(
    likelihood: Singles, pillars: PillarStrips, place: int, widths: Floats, height_share: Floats, width_share: Floats,
    outside: float, pad: int,
) -> float:  # fmt: skip
    """p(F_i | X): the mean of F_i over each pillar's region (HW12 eqs 2 to 6); nan where the view sees none of it."""
    shown = np.full((likelihood.shape[0] + 2 * pad, likelihood.shape[1] + 2 * pad), outside)
    image = np.zeros(shown.shape, bool)
    shown[pad:-pad, pad:-pad], image[pad:-pad, pad:-pad] = likelihood, True
    total, seen = 0.0, False
    for h, tall in enumerate(height_share):
        for width, wide in zip(widths, width_share, strict=True):
            mask = region(pillars, place, h, float(width), pad, (likelihood.shape[0], likelihood.shape[1]))
            if mask.any():
                total += float(tall * wide) * float(shown[mask].mean())
                seen |= bool((mask & image).any())
    return total if seen else math.nan


def mean_shift(weight: Floats, reach: float) -> tuple[Floats, Ints]:
    """Places (row, column) of the modes, and the mode of each sample in the order of rows and columns (HW12 eq. 7)."""
    samples = np.argwhere(weight > 0)
    share = weight[weight > 0]
    window = math.ceil(_KERNEL_EXTENT * reach)
    found: list[Floats] = []
    own = []
    for start in samples:
        place = start.astype(float)
        for _ in range(_STEP_LIMIT):
            off = samples - place
            near = (np.abs(off) <= window).all(1)
            pull = np.where(near, share * np.exp(-(off**2).sum(1) / reach**2), 0.0)
            to = (pull[:, None] * samples).sum(0) / pull.sum()
            moved = math.dist(to, place)
            place = to
            if moved < _REST_STEP:
                break
        met = [m for m, mode in enumerate(found) if math.dist(mode, place) < _MODE_RADIUS * reach]
        if not met:
            found.append(place)
        own.append(met[0] if met else len(found) - 1)
    return np.array(found).reshape(-1, 2), np.array(own, np.int64)


def drawn(camera: Camera, place: Floats, height: float, width: float, pad: int) -> Floats:
    """The image of a cylinder: how much of each pixel it covers, float64 (v, u) with a margin all around."""
    columns, rows = camera.size
    fine = np.zeros(((rows + 2 * pad) * _FINE, (columns + 2 * pad) * _FINE), np.uint8)
    angle = np.linspace(0, 2 * np.pi, _POINTS, endpoint=False)
    circle = place + 0.5 * width * np.column_stack([np.cos(angle), np.sin(angle)])
    discs = [camera.project(circle, float(z))[0] for z in np.linspace(0.0, height, _DISCS)]
    for lower, upper in pairwise(discs):
        corners = np.rint(((np.concatenate([lower, upper]) + pad + 0.5) * _FINE - 0.5) * 2**_BITS).astype(np.int32)
        cv2.fillConvexPoly(fine, cv2.convexHull(corners), (1,), shift=_BITS)
    sums = cv2.resize(fine.astype(np.float32), None, fx=1 / _FINE, fy=1 / _FINE, interpolation=cv2.INTER_AREA)
    return np.asarray(sums, float)
