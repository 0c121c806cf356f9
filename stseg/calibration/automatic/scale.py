"""The scale of a rig from people: known distances on the ground, or the height of people, and how well these know it.

Feet are seen nearer to the camera than the body's axis. What is not known of that offset shifts the ground up or down,
by which heights, and distances of one view, differ from the distances between views.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import approx_fprime

from stseg.arrays import Floats, even_rows
from stseg.calibration.adjusted_rig import scaled
from stseg.calibration.automatic.solution import SolvedViews
from stseg.calibration.bundle_adjustment import adjust
from stseg.calibration.pinhole import CENTRE, on_plane

_MEAN_HEIGHT_SPREAD, _BODY_HEIGHT_SPREAD = 0.067, 0.07
"""Standard deviations of the mean height of people of one place, and between these people of one sex, metres.

The former is of countries (0.05), of men and women in any mixture (0.04), and of shoes and hair (0.02): NCD Risk Factor
Collaboration, A century of trends in adult human height, eLife 5, 2016."""
_GROUND_SPREAD = 0.045
"""Standard deviation of the ground's height beyond what the adjustment knows, metres: feet differ from their model in
all views alike, by shoes and gait. Known lengths on the floor stay; places of people above it do not."""
_PIXEL_SPREAD = 1.0
"""Standard deviation of a pixel that a person names."""
_FEET = 100
"""Most feet of a view by which the size of the plan is known."""
_ROUNDS, _STEP_SIZE = 2, 1e-5


@dataclass(frozen=True)
class KnownDistance:
    """Two ground pixels of a view, and the metres between them."""

    view: int
    pixels: Floats
    """float64 (2, 2)."""
    metres: float


def measured(solution: SolvedViews, known: Sequence[KnownDistance]) -> Floats:
    """Metres that a solution puts between the pixels of each distance; nan above the horizon."""
    return np.array([_measured(solution, solution.adjustment.parameters.views, one, one.pixels) for one in known])


def _measured(solution: SolvedViews, views: Floats, known: KnownDistance, pixels: Floats) -> float:
    ground = on_plane(views[known.view], solution.problem.size_of(known.view), pixels, 0.0)
    return float(np.linalg.norm(ground[1] - ground[0]))


def _shortage(solution: SolvedViews, known: Sequence[KnownDistance]) -> Floats:
    """Logarithm of each distance over what the solution puts there, float64 (n,)."""
    return np.asarray(np.log([one.metres for one in known]) - np.log(measured(solution, known)))


def scaled_to(solution: SolvedViews, known: Sequence[KnownDistance]) -> SolvedViews:
    """The solution scaled to the distances, by generalised least squares; nan where one is above the horizon."""
    short = _shortage(solution, known)
    weight = _weights(_size_covariance(solution, known)[1:, 1:]) if np.isfinite(short).all() else np.ones(len(known))
    return scaled(solution, float(np.exp(weight @ short)))


def adjusted_to(solution: SolvedViews, known: Sequence[KnownDistance]) -> SolvedViews:
    """The solution scaled to the distances and adjusted again: offsets of feet are lengths, too."""
    for _ in range(_ROUNDS):
        solution = scaled_to(solution, known)
        if not np.isfinite(solution.adjustment.parameters.views).all():
            break
        solution = replace(solution, adjustment=adjust(solution.adjustment.parameters, solution.problem))
    return scaled_to(solution, known)


def scale_spread(solution: SolvedViews, known: Sequence[KnownDistance]) -> float:
    """Relative standard deviation of people's places: by the distances, or by the heights where there are none."""
    covariance, parameters = _size_covariance(solution, known), solution.adjustment.parameters
    ground = _GROUND_SPREAD / np.median(parameters.views[:, CENTRE][:, 2])
    if known:
        weight = _weights(covariance[1:, 1:])
        scatter = _shortage(solution, known).std(ddof=1) * np.linalg.norm(weight) if len(known) > 1 else 0.0
        return float(np.hypot(ground, max(np.sqrt(weight @ covariance[1:, 1:] @ weight), scatter)))
    matched, tall = solution.problem.correspondences, np.median(parameters.points[:, 2])
    most = np.unique(matched.frame, return_counts=True)[1].max()
    body = np.hypot(_MEAN_HEIGHT_SPREAD, _BODY_HEIGHT_SPREAD / np.sqrt(most)) / tall
    return float(np.sqrt(body**2 + ground**2 + covariance[0, 0]))


def _weights(covariance: Floats) -> Floats:
    """Weights of the best unbiased mean, float64 (n,)."""
    weight = np.linalg.solve(covariance, np.ones(len(covariance)))
    return np.asarray(weight / weight.sum())


def _size_covariance(solution: SolvedViews, known: Sequence[KnownDistance]) -> Floats:
    """Covariance of the logarithms of the plan's size, by itself and over each distance, from cameras and pixels."""
    problem, views = solution.problem, solution.adjustment.parameters.views
    feet = [problem.correspondences.foot[problem.correspondences.view == view] for view in range(len(views))]
    feet = [foot[even_rows(len(foot), _FEET)] for foot in feet]

    def grounds(views: Floats) -> Floats:
        cameras = enumerate(zip(views, feet, strict=True))
        places = [on_plane(view, problem.size_of(k), foot, 0.0) for k, (view, foot) in cameras]
        return np.nan_to_num(np.concatenate(places))

    here = grounds(views) - grounds(views).mean(axis=0)

    def logarithms(unknown: Floats) -> Floats:
        changed, pixels = unknown[: views.size].reshape(views.shape), unknown[views.size :].reshape(-1, 2, 2)
        size = np.log((grounds(changed) * here).sum() / (here**2).sum())
        pairs = zip(known, pixels, strict=True)
        return np.array([size, *(size - np.log(_measured(solution, changed, *pair)) for pair in pairs)])

    pixels = [one.pixels for one in known]
    slope = np.atleast_2d(approx_fprime(np.concatenate([views, *pixels], axis=None), logarithms, _STEP_SIZE))
    covariance = block_diag(
        solution.adjustment.covariance[: views.size, : views.size], _PIXEL_SPREAD**2 * np.eye(4 * len(known))
    )
    return np.asarray(slope @ covariance @ slope.T)
