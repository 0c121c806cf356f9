"""Pinhole camera as a parameter vector: focal length, principal point, radial lens, rotation, centre, clock offset.

Square pixels and a radial lens; the principal point is near the image's middle. Points are x, y, z in metres, z up.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.geometry import Camera, Lens
from stseg.geometry.fits import middle_matrix

FOCAL, MIDDLE, RADIAL, TURN, CENTRE = 0, slice(1, 3), slice(3, 5), slice(5, 8), slice(8, 11)
CLOCK, ENDS = 11, slice(12, 14)
"""Slices of the vector: log of focal length over image width; principal point from the image's middle, in widths;
k1, k2; rotation vector from world to camera; centre, metres; delay of the stream, seconds; how far the view's
silhouettes reach below feet and above heads, in widths."""
SIZE = 14


def project(views: Floats, width: Floats, height: Floats, points: Floats) -> Floats:
    """Project points, each into a view of its own.

    Parameters
    ----------
    views : float64 (n, 14)
        Cameras.
    width, height : float64 (n,)
        Of their images, pixels.
    points : float64 (n, 3)
        Metres.

    Returns
    -------
    float64 (n, 2)
        Pixels of the real image; nan behind the camera.
    """
    in_camera = Rotation.from_rotvec(views[:, TURN]).apply(points - views[:, CENTRE])
    depth = np.where(in_camera[:, 2] > 1e-3, in_camera[:, 2], np.nan)
    ray = in_camera[:, :2] / depth[:, None]
    # Far outside the image the polynomial of a barrel lens folds back; it is held constant from there on.
    square = np.minimum((ray**2).sum(axis=1), _fold_squared(views[:, RADIAL]))
    bend = 1 + square * (views[:, 3] + square * views[:, 4])
    focal = width * np.exp(views[:, FOCAL])
    middle = np.stack([(width - 1) / 2, (height - 1) / 2], -1) + views[:, MIDDLE] * width[:, None]
    return np.asarray(middle + (focal * bend)[:, None] * ray)


def _fold_squared(radial: Floats) -> Floats:
    """Squared radius at which r (1 + k1 r^2 + k2 r^4) stops rising; large where it never does, float64 (n,)."""
    k1, k2 = radial.T
    inside = 9 * k1**2 - 20 * k2
    # The smaller root of 1 + 3 k1 s + 5 k2 s^2, in the form that holds as k2 goes to zero.
    below = -3 * k1 + np.sqrt(np.maximum(inside, 0.0))
    turns = (inside >= 0) & (below > 0.02)
    return np.where(turns, 2.0 / np.where(turns, below, 1.0), 100.0)


def rays(view: Floats, size: tuple[int, int], pixel: Floats) -> Floats:
    """Viewing rays of pixels of one view, world directions, float64 (n, 3); nan beyond the lens's fold."""
    lens = lens_of(view, size)
    ideal = lens.undistort(pixel)
    ray = (ideal - lens.matrix[:2, 2]) / lens.matrix[0, 0]
    return np.asarray(Rotation.from_rotvec(view[TURN]).inv().apply(np.column_stack([ray, np.ones(len(ray))])))


def on_plane(view: Floats, size: tuple[int, int], pixel: Floats, height: float) -> Floats:
    """Back-project pixels of one view to the plane at `height`, metres, float64 (n, 2); nan above the horizon."""
    way = rays(view, size, pixel)
    rise = height - view[CENTRE][2]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = rise / way[:, 2]
    reach = np.where(reach > 0, reach, np.nan)
    return np.asarray(view[CENTRE][:2] + reach[:, None] * way[:, :2])


def height_of_head(view: Floats, size: tuple[int, int], pixel: Floats, ground: Floats) -> Floats:
    """Height at which a pixel's ray passes nearest to the vertical over its ground point, metres, float64 (n,)."""
    way = rays(view, size, pixel)
    reach = np.linalg.norm(ground - view[CENTRE][:2], axis=1) / np.linalg.norm(way[:, :2], axis=1)
    return np.asarray(view[CENTRE][2] + reach * way[:, 2])


def as_camera(view: Floats, name: str, size: tuple[int, int]) -> Camera:
    """Convert to a ground homography, a vertical and a lens."""
    lens = lens_of(view, size)
    return Camera.from_projection(name, size, projection_of(view, lens.matrix), lens)


def projection_of(view: Floats, matrix: Floats) -> Floats:
    """K [R | -R c] of a camera matrix and a view's pose, float64 (3, 4)."""
    turn = Rotation.from_rotvec(view[TURN]).as_matrix()
    return np.asarray(matrix @ np.column_stack([turn, -turn @ view[CENTRE]]))


def moved(view: Floats, turn: float, shift: Floats, scale: float) -> Floats:
    """The camera after the similarity x -> scale * R(turn) x + shift of the ground, z -> scale * z."""
    about = Rotation.from_euler("z", turn)
    new = view.copy()
    new[TURN] = (Rotation.from_rotvec(view[TURN]) * about.inv()).as_rotvec()
    new[CENTRE] = scale * about.apply(view[CENTRE]) + np.array([*shift, 0.0])
    return new


def looking(pitch: float, roll: float) -> Floats:
    """Rotation vector of a camera that looks along +y, `pitch` down and `roll` about its axis, radians."""
    level = Rotation.from_matrix([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    return np.asarray((Rotation.from_euler("z", roll) * Rotation.from_euler("x", pitch) * level).as_rotvec())


def ground_jacobian(camera: Camera, ground: Floats, step: float, height: float = 0.0) -> Floats:
    """Jacobian of pixels in a horizontal place by differences of `step` metres, pixels a metre, float64 (n, 2, 2)."""
    columns = [
        (camera.project(ground + move, height)[0] - camera.project(ground - move, height)[0]) / (2 * step)
        for move in step * np.eye(2)
    ]
    return np.stack(columns, -1)


def lens_of(view: Floats, size: tuple[int, int]) -> Lens:
    """Camera matrix and radial distortion of a view."""
    matrix = middle_matrix(size[0] * float(np.exp(view[FOCAL])), size)
    matrix[:2, 2] += view[MIDDLE] * size[0]
    return Lens(matrix, view[RADIAL])
