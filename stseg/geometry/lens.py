"""A lens: OpenCV's radial and tangential model, with its fold.

Strong barrel distortion is a polynomial that turns round: far off-axis points come back into the image. The model
means nothing there, so a point is rejected by its angle, beyond the first turning point of r (1 + k1 r^2 + ...).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Flags, Floats

_UNDISTORT_ROUNDS = 50


@dataclass(frozen=True)
class Lens:
    """Camera matrix and distortion of one lens.

    Attributes
    ----------
    matrix : float64 (3, 3)
        Camera matrix, pixels.
    distortion : float64 (5,)
        k1, k2, p1, p2, k3 of OpenCV's model; shorter lists are filled with zeros.
    fold : float
        Tangent of the largest angle from the axis at which the radial polynomial still rises.
    """

    matrix: Floats
    distortion: Floats
    fold: float = field(init=False)

    def __post_init__(self) -> None:
        given = np.asarray(self.distortion, float).ravel()
        object.__setattr__(self, "matrix", np.asarray(self.matrix, float).reshape(3, 3))
        object.__setattr__(self, "distortion", np.concatenate([given, np.zeros(5 - len(given))]))
        object.__setattr__(self, "fold", _fold(self.distortion))

    def distort(self, pixel: Floats) -> tuple[Floats, Flags]:
        """Where the lens shows undistorted pixels.

        Parameters
        ----------
        pixel : float64 (..., 2)
            Pixels of the ideal pinhole image.

        Returns
        -------
        float64 (..., 2), bool (...)
            Pixels of the real image, and whether the point lies before the fold.
        """
        ray = self._ray(pixel)
        radius = np.hypot(ray[..., 0], ray[..., 1])
        return self._pixel(self._bend(ray)), radius < self.fold

    def undistort(self, pixel: Floats) -> Floats:
        """The inverse of `distort` by Newton's method on the ray, float64 (..., 2); nan where no ray before the fold
        comes to the pixel, as in the corners of a strong barrel's image.
        """
        target = self._ray(pixel)
        ray = target
        with np.errstate(all="ignore"):  # rays beyond the fold may run away; they end as nan
            for _ in range(_UNDISTORT_ROUNDS):
                step = _solve(self._slope(ray), target - self._bend(ray))
                ray = ray + step
                if np.abs(step).max(initial=0.0) < 1e-13:
                    break
            miss = np.abs(target - self._bend(ray)).max(axis=-1)
            unfolded = (miss < 1e-9) & (np.hypot(ray[..., 0], ray[..., 1]) < self.fold)
        return self._pixel(np.where(unfolded[..., None], ray, np.nan))

    def _ray(self, pixel: Floats) -> Floats:
        offset = np.asarray(pixel, float) - self.matrix[:2, 2]
        y = offset[..., 1] / self.matrix[1, 1]
        return np.stack([(offset[..., 0] - self.matrix[0, 1] * y) / self.matrix[0, 0], y], -1)

    def _pixel(self, ray: Floats) -> Floats:
        return np.asarray(ray @ self.matrix[:2, :2].T + self.matrix[:2, 2])

    def _bend(self, ray: Floats) -> Floats:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = ray[..., 0], ray[..., 1]
        square = x * x + y * y
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
                y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
            ],
            -1,
        )

    def _slope(self, ray: Floats) -> Floats:
        """Jacobian of `_bend`, float64 (..., 2, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = ray[..., 0], ray[..., 1]
        square = x * x + y * y
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        rise = 2 * (k1 + square * (2 * k2 + square * 3 * k3))
        across = x * y * rise + 2 * p1 * x + 2 * p2 * y
        return np.stack(
            [
                np.stack([radial + x * x * rise + 2 * p1 * y + 6 * p2 * x, across], -1),
                np.stack([across, radial + y * y * rise + 6 * p1 * y + 2 * p2 * x], -1),
            ],
            -2,
        )


def _solve(slope: Floats, miss: Floats) -> Floats:
    """Cramer's rule for (..., 2, 2) and (..., 2): unlike LAPACK, a singular point spoils itself alone."""
    (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
    x, y = miss[..., 0], miss[..., 1]
    return np.asarray(np.stack([d * x - b * y, a * y - c * x], -1) / (a * d - b * c)[..., None])


def _fold(distortion: Floats) -> float:
    """First positive root of d/dr [r (1 + k1 r^2 + k2 r^4 + k3 r^6)]; infinite where it never turns."""
    k1, k2, _, _, k3 = distortion
    squares = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    real = squares[np.abs(squares.imag) < 1e-9].real
    real = real[real > 0]
    return float(np.sqrt(real.min())) if len(real) else float("inf")
