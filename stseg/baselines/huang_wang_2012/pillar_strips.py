"""Pillars of HW12 as strips of the image, so that sums over them come from a summed-area table (HW12 eq. 5).

A body is an upright cylinder: its width says how wide it is from any side. Its image is a rectangle only where camera
and lens keep verticals upright and its round ends flat. So it is cut into strips along its axis, rows of the image
where the axis runs down it and columns where it runs across. Each strip is one rectangle, about the place of the axis
there and as wide as the disc's image across the axis. A tilt, a roll or a lens bends the pillar from strip to strip,
not within one: stairs instead of a slope. The half discs that stand out at both ends are rectangles of their area. The
discs' images are ellipses, by the derivatives of the projection.

Strips end at the heights that are tried, so the pillars of all heights and widths of a place are nested sums of the
same few strips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Singles
from stseg.geometry import Camera

STRIPS = 6
"""Strips from the ground to the least height that is tried."""
_CAP = np.pi / 4
"""Length of a rectangle as large as a half ellipse, and as wide, in half axes."""
_DISTANCE = 0.05
"""Over which derivatives are taken, metres."""


@dataclass(frozen=True)
class PillarStrips:
    """Strips of the pillars of one view.

    Image coordinates are those of edges, not of pixel centres: a map pixel i spans i .. i + 1.
    """

    upright: Flags
    """bool (place,): whether the strips are rows of the image; columns otherwise."""
    edge: Singles
    """float32 (place, strip + 1): where they meet, from the feet up: rows of the map, or columns. nan where the view
    does not see the pillar."""
    middle: Singles
    """float32 (place, strip): where the axis is in a strip: columns of the map, or rows."""
    half: Singles
    """float32 (place, strip): half of the strip's width for each metre of the pillar's, map pixels a metre."""
    base: int
    """The strip of the least height, from 0: those above it each end at one height more."""

    @classmethod
    def of(
        cls, camera: Camera, ground: Floats, heights: Floats, width: float, step: int = 1, strips: int = STRIPS
    ) -> PillarStrips:
        """The pillars of a view.

        Parameters
        ----------
        ground : float64 (place, 2)
            Where they stand, metres.
        heights : float64 (h,)
            Heights that are tried, rising, metres.
        width
            Their mean width, by which the round ends are long, metres.
        step
            Image pixels to a map pixel.
        strips
            How many strips there are from the ground to the least height.
        """
        levels = np.concatenate([np.linspace(0.0, heights[0], strips + 1), heights[1:]])
        pixel, jacobian = _project(camera, ground, levels)
        rise = pixel[-1] - pixel[0]
        upright = np.abs(rise[:, 1]) >= np.abs(rise[:, 0])
        along, across = np.where(upright, 1, 0), np.where(upright, 0, 1)
        place = np.arange(len(ground))
        edge, middle = pixel[:, place, along].T, pixel[:, place, across].T
        sign = np.where(rise[place, along] < 0, -1.0, 1.0)[:, None]
        end = _CAP * 0.5 * width * np.hypot(*np.moveaxis(jacobian[:, place, along], -1, 0)).T
        edge = edge + sign * np.where(levels < heights[0], 0.0, end)
        edge[:, 0] -= sign[:, 0] * end[:, 0]
        half = 0.5 * _across(jacobian, rise, upright).T
        middle, half = 0.5 * (middle[:, 1:] + middle[:, :-1]), 0.5 * (half[:, 1:] + half[:, :-1])
        edge[~np.isfinite(np.column_stack([edge, middle, half])).all(1)] = np.nan
        edge, middle, half = (edge + 0.5) / step, (middle + 0.5) / step, half / step
        return cls(upright, edge.astype(np.float32), middle.astype(np.float32), half.astype(np.float32), strips - 1)


def _project(camera: Camera, ground: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """Pixels of the axis, (level, place, 2), and their derivatives along x and y, (level, place, 2, 2)."""
    pixel = np.full((len(levels), len(ground), 2), np.nan)
    jacobian = np.full((len(levels), len(ground), 2, 2), np.nan)
    for k, level in enumerate(levels):
        place, ahead = camera.project(ground, float(level))
        pixel[k][ahead] = place[ahead]
        for axis, away in enumerate(np.eye(2) * _DISTANCE):
            (before, before_ahead), (after, after_ahead) = (
                camera.project(ground + sign * away, float(level)) for sign in (-1, 1)
            )
            visible = before_ahead & after_ahead
            jacobian[k][visible, :, axis] = (after - before)[visible] / (2 * _DISTANCE)
    return pixel, jacobian


def _across(jacobian: Floats, rise: Floats, upright: Flags) -> Floats:
    """Half of what a strip cuts out of a swept disc of radius 1 m, pixels, float64 (level, place).

    The disc's image reaches |J^T n| from the axis along its normal n, and a row, or a column, cuts that askew.
    """
    length = np.hypot(*rise.T)
    sheer = np.where(upright[:, None], [0.0, 1.0], [1.0, 0.0])
    direction = np.where(length[:, None] > 0, rise / np.where(length > 0, length, 1.0)[:, None], sheer)
    normal = np.stack([-direction[:, 1], direction[:, 0]], -1)
    reach = np.hypot(*np.moveaxis(np.einsum("kpia,pi->kpa", jacobian, normal), -1, 0))
    return np.asarray(reach / np.abs(np.where(upright, normal[:, 0], normal[:, 1])))
