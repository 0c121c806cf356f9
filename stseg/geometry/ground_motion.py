"""Similarities of the ground: fitted to points, and applied to rigs."""

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Complexes, Floats
from stseg.geometry.camera import Camera
from stseg.geometry.grid import Grid
from stseg.geometry.rig import Rig


@dataclass(frozen=True)
class GroundMotion:
    """A turn, a shift and a scale: x + iy becomes factor * (x + iy) + shift, and heights are multiplied by |factor|."""

    factor: complex
    shift: complex

    def of(self, ground: Floats) -> Floats:
        """Points (..., 2) on the new ground, metres."""
        place = self.factor * (ground[..., 0] + 1j * ground[..., 1]) + self.shift
        return np.stack([place.real, place.imag], -1)

    def of_rig(self, rig: Rig) -> Rig:
        """The rig on the new ground; its area is turned into a polygon."""
        cameras = tuple(self._of_camera(camera) for camera in rig.cameras)
        doors = tuple(self._around(np.array([[x0, y0], [x0, y1], [x1, y0], [x1, y1]])) for x0, y0, x1, y1 in rig.doors)
        return replace(rig, cameras=cameras, grid=self._of_grid(rig.grid), doors=doors)

    def _of_camera(self, camera: Camera) -> Camera:
        a, b = self.factor.real, self.factor.imag
        moved = np.eye(4)
        moved[:2, :2] = [[a, -b], [b, a]]
        moved[:2, 3], moved[2, 2] = (self.shift.real, self.shift.imag), abs(self.factor)
        return Camera.from_projection(camera.name, camera.size, camera.projection @ np.linalg.inv(moved), camera.lens)

    def _of_grid(self, grid: Grid) -> Grid:
        corners = np.round(self.of(grid.corners), 3)
        low = np.floor(corners.min(axis=0) / grid.cell) * grid.cell
        high = np.ceil(corners.max(axis=0) / grid.cell) * grid.cell
        x, y = np.round(np.stack([low, high], 1), 6).tolist()
        straight = grid.polygon is None and abs(self.factor.imag) < 1e-9
        return replace(grid, x=(x[0], x[1]), y=(y[0], y[1]), polygon=None if straight else corners)

    def _around(self, corners: Floats) -> tuple[float, float, float, float]:
        (x0, y0), (x1, y1) = (np.round(edge(self.of(corners), axis=0), 3).tolist() for edge in (np.min, np.max))
        return x0, y0, x1, y1


def fit_motion(source: Floats, target: Floats, scales: bool) -> GroundMotion:
    """Least squares over turn, shift and, with `scales`, scale, from two or more points (n, 2), metres.

    B. Horn, Closed-form solution of absolute orientation using unit quaternions, JOSA A 4(4), 1987; here in the plane.
    """
    before, after = _complex(source), _complex(target)
    from_middle, to_middle = before - before.mean(), after - after.mean()
    factor = complex(np.vdot(from_middle, to_middle))
    size = float((np.abs(from_middle) ** 2).sum()) if scales else abs(factor)
    factor = factor / size if size else 1 + 0j
    return GroundMotion(factor, complex(after.mean() - factor * before.mean()))


def _complex(ground: Floats) -> Complexes:
    return np.asarray(ground[:, 0] + 1j * ground[:, 1])
