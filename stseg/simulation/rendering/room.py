"""The empty room in each camera: a tiled floor and plastered walls, rendered once."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from stseg.arrays import Bytes, Floats, Singles
from stseg.simulation.scene import SceneSpec, Topic, random_stream

_TILE, _JOINT = 0.6, 0.02  # metres
_FLOOR = np.array([118.0, 128.0, 135.0])  # blue, green, red
_WALL = np.array([150.0, 165.0, 170.0])
_SKIRTING = 0.12  # metres
_GRAIN = ((2.0, 0.5), (0.5, 0.3), (0.13, 0.2))  # metres and weight of each octave
_LATTICE = 64


@dataclass(frozen=True, slots=True)
class Room:
    """A camera's view of the empty room."""

    image: Bytes
    """uint8 (v, u, 3): blue, green, red."""
    ground: Singles
    """float32 (v, u, 2): ground point of each pixel, metres; nan on the walls."""
    depth: Singles
    """float32 (v, u): depth in lengths of the pixels' rays, metres."""


def render_room(spec: SceneSpec, rays: Singles, eye: Floats) -> Room:
    """Render the empty room along the given rays.

    Parameters
    ----------
    spec
        The scene; its seed makes the textures, its cameras' distance the room's size.
    rays : float32 (v, u, 3)
        See `stseg.simulation.rendering.cameras.pixel_rays`.
    eye : float64 (3,)
        The camera's centre, metres.
    """
    half = 1.25 * spec.camera_distance + 1.0
    lattice = random_stream(spec.seed, Topic.ROOM).uniform(-1.0, 1.0, (_LATTICE, _LATTICE))
    visible = np.any(rays != 0, axis=-1)
    across, down = np.gradient(rays, axis=1), np.gradient(rays, axis=0)
    # Four rays a pixel, so that the joints between tiles do not flicker where they are narrow.
    shots = [_shade_rays(rays + 0.25 * (i * across + j * down), eye, half, lattice) for i in (-1, 1) for j in (-1, 1)]
    image = np.where(visible[..., None], np.mean(shots, axis=0), 0.0)
    ground = _ground(rays, eye, half)
    down = np.where(rays[..., 2] < 0, rays[..., 2], -1.0)
    depth = np.where(np.isfinite(ground[..., 0]), -eye[2] / down, np.abs(_to_walls(rays, eye, half)).min(axis=-1))
    return Room(np.clip(np.rint(image), 0, 255).astype(np.uint8), ground, depth.astype(np.float32))


def _ground(rays: Singles, eye: Floats, half: float) -> Singles:
    """Intersections of rays with the floor within the walls, float32 (v, u, 2), else nan."""
    down = rays[..., 2] < -1e-6
    distance = -eye[2] / np.where(down, rays[..., 2], -1.0)
    ground = eye[:2] + distance[..., None] * rays[..., :2]
    inside = down & (np.abs(ground) <= half).all(axis=-1)
    return np.where(inside[..., None], ground, np.nan).astype(np.float32)


def _to_walls(rays: Singles, eye: Floats, half: float) -> Floats:
    """Distances to the walls across x and y, in lengths of the rays, float64 (v, u, 2)."""
    with np.errstate(divide="ignore"):
        far = (np.where(rays[..., :2] < 0, -half, half) - eye[:2]) / np.where(rays[..., :2] == 0, 1e-9, rays[..., :2])
    return np.asarray(far, float)


def _shade_rays(rays: Singles, eye: Floats, half: float, lattice: Floats) -> Floats:
    """Colours at the intersections of rays, float64 (v, u, 3)."""
    to_walls = _to_walls(rays, eye, half)
    side = np.argmin(np.abs(to_walls), axis=-1)
    hit = eye + np.abs(to_walls).min(axis=-1)[..., None] * rays
    along = np.where(side == 0, hit[..., 1], hit[..., 0]) + 3.7 * half * (1 + side + 2 * (hit.sum(axis=-1) > 0))
    colour = _wall(along, hit[..., 2], lattice)
    ground = _ground(rays, eye, half).astype(float)
    floor = np.isfinite(ground[..., 0])
    colour[floor] = _floor(ground[floor], lattice)
    return colour


def _floor(ground: Floats, lattice: Floats) -> Floats:
    """Colours of ground points (n, 2), float64 (n, 3): tiles of many tones under a lamp in the middle."""
    tile = np.floor(ground / _TILE)
    tone = lattice[tuple((tile.astype(int) % _LATTICE).T)]
    edge = np.abs(ground / _TILE - tile - 0.5).max(axis=-1)
    joint = np.where(edge > 0.5 - _JOINT / _TILE, 0.7, 1.0)
    lamp = 0.8 + 0.3 * np.exp(-(ground**2).sum(axis=-1) / 60.0)
    light = lamp * joint * (1.0 + 0.09 * tone + 0.16 * _grain(ground, lattice))
    return np.asarray(light[:, None] * _FLOOR)


def _wall(along: Floats, height: Floats, lattice: Floats) -> Floats:
    """Colours of points on the walls, float64 (v, u, 3)."""
    light = 0.85 + 0.12 * _grain(np.stack([along, height], -1), lattice) + 0.04 * np.minimum(height, 4.0)
    light = np.where(height < _SKIRTING, 0.45, light)
    return np.asarray(light[..., None] * _WALL)


def _grain(place: Floats, lattice: Floats) -> Floats:
    """Value noise in octaves at points (..., 2) in metres, about -1..1, float64 (...)."""
    octaves = [
        weight * ndimage.map_coordinates(lattice, np.moveaxis(place / size, -1, 0), order=1, mode="grid-wrap")
        for size, weight in _GRAIN
    ]
    return np.asarray(np.sum(octaves, axis=0))
