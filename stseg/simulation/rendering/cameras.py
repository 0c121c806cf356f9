"""Cameras in a ring around the area, and the viewing ray of every pixel."""

import numpy as np

from stseg.arrays import Singles
from stseg.geometry import Camera, Grid, Lens, Rig
from stseg.simulation.scene import SceneSpec, Topic, random_stream

_AIM = 0.6
"""Height of the point above the area's centre that the cameras look at, metres."""


def turns(spec: SceneSpec) -> list[float]:
    """Positions of the cameras in the ring, as shares of a full turn.

    A camera is drawn by its share alone, so that 1 of 4 is the same camera as 2 of 8.
    """
    return [k / spec.cameras for k in range(spec.cameras)]


def build_rig(spec: SceneSpec) -> Rig:
    """The rig of a scene: its cameras cam1, cam2, ... and the default grid over its area."""
    width, depth = spec.area
    grid = Grid((-width / 2, width / 2), (-depth / 2, depth / 2))
    cameras = tuple(_camera(spec, f"cam{k}", turn) for k, turn in enumerate(turns(spec), start=1))
    return Rig(spec.name, spec.frame_rate, grid, cameras)


def _camera(spec: SceneSpec, name: str, turn: float) -> Camera:
    off = random_stream(spec.seed, Topic.CAMERA, _code(turn)).uniform(-1.0, 1.0, 6)
    angle = 2 * np.pi * (turn + 0.1) + 0.12 * off[0]
    distance, height = spec.camera_distance * (1 + 0.05 * off[1]), spec.camera_height * (1 + 0.06 * off[2])
    centre = np.array([distance * np.cos(angle), distance * np.sin(angle), height])
    forward = np.array([0.3 * off[3], 0.3 * off[4], _AIM]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    focal = spec.size[0] / 2 / np.tan(np.radians(spec.field_of_view) / 2) * (1 + 0.03 * off[5])
    matrix = np.array([[focal, 0, (spec.size[0] - 1) / 2], [0, focal, (spec.size[1] - 1) / 2], [0, 0, 1]])
    projection = matrix @ np.column_stack([rotation, -rotation @ centre])
    lens = Lens(matrix, np.array(spec.distortion)) if any(spec.distortion) else None
    return Camera.from_projection(name, spec.size, projection, lens)


def _code(turn: float) -> int:
    return round(turn * 2**30)


def light_phase(spec: SceneSpec, turn: float) -> float:
    """Share of the light's period by which a camera is ahead: exposures are regulated one by one."""
    return float(random_stream(spec.seed, Topic.LIGHT, _code(turn)).uniform())


def frame_seed(turn: float, frame: int) -> tuple[int, int]:
    """Seed words of a camera's frame, unique to it; frames before the first are negative."""
    return _code(turn), 2 * frame if frame >= 0 else -2 * frame - 1


def pixel_rays(camera: Camera) -> Singles:
    """Viewing rays of the pixels in world coordinates, scaled to depth 1.

    Parameters
    ----------
    camera
        The view.

    Returns
    -------
    float32 (v, u, 3)
        From the camera's centre outwards; zero in corners beyond the lens's fold.
    """
    width, height = camera.size
    pixel = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), -1)
    # Times the scale that makes the third coordinate of P (X, 1) a depth in metres.
    return np.asarray(np.nan_to_num(camera.rays(pixel) * float(np.linalg.norm(camera.projection[2, :3]))), np.float32)
