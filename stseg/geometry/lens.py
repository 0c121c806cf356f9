"""A lens: OpenCV's radial (polynomial or rational) and tangential model, or its fisheye, with its fold.

Strong barrel distortion is a polynomial that turns round: far off-axis points come back into the image. The model
means nothing there, so a point is rejected by its angle, beyond the first turning point of r (1 + k1 r^2 + ...).
A fisheye's polynomial is one in the angle t = atan r: t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8). J. Kannala and
S. Brandt, A generic camera model and calibration method, TPAMI 28(8), 2006.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.polynomial import Polynomial

from stseg.arrays import Complexes, Flags, Floats
from stseg.errors import CalibrationError, one_of

LensModel = Literal["pinhole", "fisheye"]
COEFFICIENTS: Mapping[LensModel, tuple[str, ...]] = {
    "pinhole": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
"""Names of the numbers of `Lens.distortion`, by model."""
_UNDISTORT_ROUNDS = 50
_LEAST_FOCAL = 1e-6  # pixels: smaller ones leave no digits of a projection
_NO_COEFFICIENT = 1e-100  # its root lies beyond every image


@dataclass(frozen=True)
class Lens:
    """Camera matrix and distortion of one lens.

    Attributes
    ----------
    matrix : float64 (3, 3)
        Camera matrix, pixels.
    distortion : float64 (4,), (5,) or (8,)
        k1, k2, p1, p2, k3 of OpenCV's model, or those and the k4, k5, k6 of its rational form; k1 to k4 of a fisheye.
        Shorter lists are filled with zeros.
    model
        "fisheye" shows what lies less than 90 degrees off the axis.
    fold : float
        Tangent of the largest angle from the axis at which the radial function still rises.

    Raises
    ------
    CalibrationError
        Where the matrix is none of a camera, or coefficients beyond the model's are not zero.
    """

    matrix: Floats
    distortion: Floats
    model: LensModel = "pinhole"
    fold: float = field(init=False)

    def __post_init__(self) -> None:
        given = np.trim_zeros(np.asarray(self.distortion, float).ravel(), "b")
        object.__setattr__(self, "matrix", np.asarray(self.matrix, float))
        self._require_sound(given)
        length = 4 if self.model == "fisheye" else 5 if len(given) <= 5 else 8
        object.__setattr__(self, "distortion", _filled(given, length))
        object.__setattr__(self, "fold", (_fisheye_fold if self.model == "fisheye" else _fold)(self.distortion))

    def _require_sound(self, given: Floats) -> None:
        matrix, names = self.matrix, COEFFICIENTS.get(self.model, ())
        if not names:
            raise CalibrationError("lens", "model", repr(self.model), one_of(self.model, COEFFICIENTS))
        is_affine = matrix.shape == (3, 3) and matrix[1, 0] == 0 and matrix[2].tolist() == [0, 0, 1]
        if not (is_affine and min(matrix[0, 0], matrix[1, 1]) > _LEAST_FOCAL):
            expected = "a camera matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]]"
            raise CalibrationError("lens", "matrix", matrix.tolist(), expected)
        if len(given) > len(names) or not np.isfinite(given).all():
            found = given.tolist() if len(given) <= len(names) else f"{len(given)} coefficients"
            raise CalibrationError("lens", "distortion", found, f"at most {len(names)}, finite: {', '.join(names)}")

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

    def reduced(self, factor: int) -> Lens:
        """The lens of images reduced by a whole factor, each pixel the mean of a square."""
        return replace(self, matrix=reduction(factor) @ self.matrix)

    def _ray(self, pixel: Floats) -> Floats:
        offset = np.asarray(pixel, float) - self.matrix[:2, 2]
        y = offset[..., 1] / self.matrix[1, 1]
        return np.stack([(offset[..., 0] - self.matrix[0, 1] * y) / self.matrix[0, 0], y], -1)

    def _pixel(self, ray: Floats) -> Floats:
        return np.asarray(ray @ self.matrix[:2, :2].T + self.matrix[:2, 2])

    def _bend(self, ray: Floats) -> Floats:
        p1, p2 = self._tangential
        x, y = ray[..., 0], ray[..., 1]
        square = x * x + y * y
        radial, _ = self._radial(square)
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
                y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
            ],
            -1,
        )

    @property
    def _tangential(self) -> tuple[float, float]:
        return (0.0, 0.0) if self.model == "fisheye" else (float(self.distortion[2]), float(self.distortion[3]))

    def _radial(self, square: Floats) -> tuple[Floats, Floats]:
        """Stretch of a ray of squared radius s, N(s) / D(s) but for a fisheye, and the slope of that in s."""
        if self.model == "fisheye":
            radius = np.sqrt(np.maximum(square, 1e-12))
            bend, angle = _fisheye_angle(self.distortion), np.arctan(radius)
            stretch = bend(angle) / radius
            return stretch, (bend.deriv()(angle) / (1 + radius**2) - stretch) / (2 * radius**2)
        k1, k2, _, _, k3, *rational = self.distortion
        over = 1 + square * (k1 + square * (k2 + square * k3))
        rise = k1 + square * (2 * k2 + square * 3 * k3)
        if not rational:
            return over, rise
        k4, k5, k6 = rational
        under = 1 + square * (k4 + square * (k5 + square * k6))
        fall = k4 + square * (2 * k5 + square * 3 * k6)
        return over / under, (rise - over / under * fall) / under

    def _slope(self, ray: Floats) -> Floats:
        """Jacobian of `_bend`, float64 (..., 2, 2)."""
        p1, p2 = self._tangential
        x, y = ray[..., 0], ray[..., 1]
        square = x * x + y * y
        radial, slope = self._radial(square)
        rise = 2 * slope
        across = x * y * rise + 2 * p1 * x + 2 * p2 * y
        return np.stack(
            [
                np.stack([radial + x * x * rise + 2 * p1 * y + 6 * p2 * x, across], -1),
                np.stack([across, radial + y * y * rise + 6 * p1 * y + 2 * p2 * x], -1),
            ],
            -2,
        )


def reduction(factor: int) -> Floats:
    """From pixels to those of an image reduced by a whole factor, each the mean of a square; float64 (3, 3)."""
    corner = (1 / factor - 1) / 2
    return np.array([[1 / factor, 0.0, corner], [0.0, 1 / factor, corner], [0.0, 0.0, 1.0]])


def _solve(slope: Floats, miss: Floats) -> Floats:
    """Cramer's rule for (..., 2, 2) and (..., 2): unlike LAPACK, a singular point spoils itself alone."""
    (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
    x, y = miss[..., 0], miss[..., 1]
    return np.asarray(np.stack([d * x - b * y, a * y - c * x], -1) / (a * d - b * c)[..., None])


def _filled(given: Floats, length: int) -> Floats:
    return np.concatenate([given, np.zeros(length - len(given))])


def _fold(distortion: Floats) -> float:
    """First positive root of the derivative of r N(r^2) / D(r^2), or of D; infinite where there is neither.

    With s = r^2 the derivative's numerator is N D + 2 s (N' D - N D').
    """
    k1, k2, _, _, k3, k4, k5, k6 = _filled(distortion, 8)
    over, under = Polynomial([1.0, k1, k2, k3]), Polynomial([1.0, k4, k5, k6])
    rise = over * under + Polynomial([0.0, 2.0]) * (over.deriv() * under - over * under.deriv())
    squares = np.concatenate([_roots(rise), _roots(under)])
    return float(np.sqrt(_least_positive(squares)))


def _fisheye_fold(distortion: Floats) -> float:
    """Tangent of the least angle at which the image's radius stops rising; infinite where that is 90 degrees."""
    angle = _least_positive(_roots(_fisheye_angle(distortion).deriv()))
    return float(np.tan(angle)) if angle < np.pi / 2 else float("inf")


def _fisheye_angle(distortion: Floats) -> Polynomial:
    """The angle off the axis at which a fisheye shows a ray, from the ray's own."""
    k1, k2, k3, k4 = distortion
    return Polynomial([0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4])


def _roots(polynomial: Polynomial) -> Complexes:
    """Roots, but for those so far away that their leading coefficient would overflow when it is divided by."""
    return np.asarray(polynomial.trim(_NO_COEFFICIENT).roots(), complex)


def _least_positive(roots: Complexes) -> float:
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(real[real > 0].min(initial=np.inf))
