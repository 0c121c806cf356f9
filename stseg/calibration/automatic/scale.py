"""The scale of a rig from people: known distances on the ground, or the height of people, and how well these know it.

Feet are seen nearer to the camera than the body's axis. What is not known of that offset shifts the ground up or down,
by which heights, and distances of one view, differ from the distances between views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.adjusted_rig import scaled
from stseg.calibration.automatic.solution import SolvedViews
from stseg.calibration.bundle_adjustment import adjust
from stseg.calibration.pinhole import CENTRE, on_plane

_MEAN_HEIGHT_SPREAD, _BODY_HEIGHT_SPREAD = 0.05, 0.09
"""Standard deviations of the mean height of people of one place, and between these people, metres."""
_FORWARD_SPREAD = 0.06
"""Standard deviation of the offset of feet between recordings, metres."""
_PIXEL_SPREAD = 1.0
"""Standard deviation of a pixel that a person names."""
_ROUNDS = 2


@dataclass(frozen=True)
class KnownDistance:
    """Two ground pixels of a view, and the metres between them."""

    view: int
    pixels: Floats
    """float64 (2, 2)."""
    metres: float


def measured(solution: SolvedViews, known: Sequence[KnownDistance]) -> Floats:
    """Metres that a solution puts between the pixels of each distance; nan above the horizon."""
    return np.array([_measured(solution, one, one.pixels) for one in known])


def _measured(solution: SolvedViews, known: KnownDistance, pixels: Floats) -> float:
    width, height = solution.problem.size[known.view].tolist()
    ground = on_plane(solution.adjustment.parameters.views[known.view], (width, height), pixels, 0.0)
    return float(np.linalg.norm(ground[1] - ground[0]))


def scaled_to(solution: SolvedViews, known: Sequence[KnownDistance]) -> SolvedViews:
    """The solution scaled to the geometric mean of the distances' factors; nan where one is above the horizon."""
    metres = np.array([one.metres for one in known])
    return scaled(solution, float(np.exp(np.log(metres / measured(solution, known)).mean())))


def adjusted_to(solution: SolvedViews, known: Sequence[KnownDistance]) -> SolvedViews:
    """The solution scaled to the distances and adjusted again: offsets of feet are lengths, too."""
    for _ in range(_ROUNDS):
        solution = scaled_to(solution, known)
        if not np.isfinite(solution.adjustment.parameters.views).all():
            break
        solution = replace(solution, adjustment=adjust(solution.adjustment.parameters, solution.problem))
    return scaled_to(solution, known)


def scale_spread(solution: SolvedViews, known: Sequence[KnownDistance]) -> float:
    """Relative standard deviation of the scale: of the distances, or of the heights where there are none."""
    parameters, matched = solution.adjustment.parameters, solution.problem.correspondences
    away = np.linalg.norm(
        parameters.views[matched.view, CENTRE][:, :2] - parameters.points[matched.point][:, :2], axis=1
    )
    rise = float(np.median(parameters.views[matched.view, CENTRE.start + 2] / away))
    if not known:
        tall, people = float(np.median(parameters.points[:, 2])), int(np.bincount(matched.frame).max())
        body = np.hypot(_MEAN_HEIGHT_SPREAD, _BODY_HEIGHT_SPREAD / np.sqrt(people))
        return float(np.hypot(body, _FORWARD_SPREAD * rise) / tall)
    of_pixels = [_pixel_spread(solution, one) / one.metres for one in known]
    off = np.log(measured(solution, known) / [one.metres for one in known])
    scatter = off.std(ddof=1) if len(known) > 1 else 0.0
    of_distances = max(float(np.sqrt(np.mean(np.square(of_pixels)))), scatter) / np.sqrt(len(known))
    return float(np.hypot(of_distances, _FORWARD_SPREAD / np.median(away)))


def _pixel_spread(solution: SolvedViews, known: KnownDistance) -> float:
    """Standard deviation of a measured distance by its pixels, metres."""
    steps = np.eye(4).reshape(4, 2, 2)
    here = _measured(solution, known, known.pixels)
    slope = [_measured(solution, known, known.pixels + step) - here for step in steps]
    return _PIXEL_SPREAD * float(np.linalg.norm(slope))
