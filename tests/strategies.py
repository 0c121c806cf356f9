"""Hypothesis strategies for geometry: cameras that watch an area, grids, rigs, recordings."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from checks import numbers
from hypothesis import strategies as st
from scenes import rotation_towards

from stseg.arrays import Floats
from stseg.geometry import Camera, Grid, Lens, Rig
from stseg.geometry.lens import LensModel
from stseg.io.recording.recording import SOURCE_KINDS, CameraSource, Recording, Source
from stseg.io.untrusted.values import is_name

BARREL = (-0.39, 0.25, 0.0008, -0.0017, -0.107)
"""A strong barrel, whose polynomial turns round about 48 degrees off the axis."""
FISHEYE = (-0.02, 0.015, -0.012, 0.002)
LENSES: tuple[tuple[tuple[float, ...], LensModel], ...] = (
    *(
        (k, "pinhole")
        for k in (BARREL, BARREL[:2], (-0.32, 0.048, 0.0012, -0.0006, 0.086), (0.12, 0.02, 0.001), (-0.1,))
    ),
    ((*BARREL, 0.3, 0.1, 0.02), "pinhole"),
    (FISHEYE, "fisheye"),
)
"""Coefficients and models of lenses of all kinds."""


@dataclass(frozen=True)
class Pose:
    """A calibrated camera: x = K (R X + t), metres, Z up."""

    matrix: Floats
    rotation: Floats
    translation: Floats

    @property
    def projection(self) -> Floats:
        """K [R | t], float64 (3, 4)."""
        return np.asarray(self.matrix @ np.column_stack([self.rotation, self.translation]))


@st.composite
def poses(draw: st.DrawFn, size: tuple[int, int] = (640, 480), target: tuple[float, float] = (0.0, 0.0)) -> Pose:
    """Cameras 3 to 12 m from a target on the ground, 1.5 to 6 m high, that look at it, perhaps rolled."""
    angle, distance, height = draw(numbers(0.0, 6.2)), draw(numbers(3.0, 12.0)), draw(numbers(1.5, 6.0))
    centre = np.array([target[0] + distance * np.cos(angle), target[1] + distance * np.sin(angle), height])
    roll = draw(numbers(-0.3, 0.3))
    turn = np.array([[np.cos(roll), -np.sin(roll), 0.0], [np.sin(roll), np.cos(roll), 0.0], [0.0, 0.0, 1.0]])
    focal = draw(numbers(0.5, 1.5)) * size[0]
    matrix = np.array([[focal, 0.0, size[0] / 2 - 3.3], [0.0, focal * 1.01, size[1] / 2 + 2.1], [0.0, 0.0, 1.0]])
    rotation = turn @ rotation_towards(centre, [*target, 0.0])
    return Pose(matrix, rotation, -rotation @ centre)


@st.composite
def cameras(
    draw: st.DrawFn,
    name: str = "cam",
    size: tuple[int, int] = (640, 480),
    target: tuple[float, float] = (0.0, 0.0),
    lenses: bool = True,
) -> Camera:
    """Cameras that see the ground at `target`, half of them through a lens where `lenses` allows."""
    pose = draw(poses(size, target))
    chosen = draw(st.sampled_from((None, *LENSES))) if lenses else None
    lens = None if chosen is None else Lens(pose.matrix, np.array(chosen[0]), chosen[1])
    scale = draw(st.sampled_from((1.0, -3.0, 1e-3)))
    return Camera.from_projection(name, size, pose.projection * scale, lens)


@st.composite
def grids(draw: st.DrawFn) -> Grid:
    """Small grids, at most a few thousand cells a plane, some within a polygon."""
    x0, y0, width, depth = (draw(numbers(*bounds)) for bounds in ((-5, 5), (-5, 5), (2, 5), (2, 5)))
    corners = st.sampled_from((None, ((0.0, 0.0), (1.0, 0.1), (0.6, 1.0)), ((0.1, 0), (0.9, 0), (1, 1), (0, 0.9))))
    chosen = draw(corners)
    return Grid(
        (x0, x0 + width),
        (y0, y0 + depth),
        cell=draw(numbers(0.1, 0.5)),
        top=draw(numbers(1.0, 2.5)),
        planes=draw(st.integers(1, 5)),
        polygon=None if chosen is None else np.array(chosen) * (width, depth) + (x0, y0),
    )


_NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=12).filter(is_name)


@st.composite
def rigs(draw: st.DrawFn, most: int = 4, lenses: bool = True) -> Rig:
    """One to `most` cameras that look into the same grid."""
    grid = draw(grids())
    target = tuple(grid.ground[grid.inside()].mean(axis=0).tolist())
    names = draw(st.lists(_NAMES, min_size=1, max_size=most, unique=True))
    size = draw(st.sampled_from(((640, 480), (1920, 1080), (160, 121))))
    views = tuple(draw(cameras(name, size, target, lenses)) for name in names)
    doors = draw(st.sampled_from(((), ((*target, target[0] + 0.3, target[1]),), ((*target, *target),) * 2)))
    return Rig(draw(_NAMES), draw(numbers(0.1, 120.0)), grid, views, doors, draw(st.booleans()))


@st.composite
def recordings(draw: st.DrawFn, path: Path) -> Recording:
    """What a rig file at `path` may say; streams below its folder, beside it, or at absolute paths."""
    rig = draw(rigs())
    return Recording(path, rig, tuple(draw(_camera_sources(path.parent)) for _ in rig.cameras))


@st.composite
def _camera_sources(draw: st.DrawFn, folder: Path) -> CameraSource:
    tails = st.sampled_from(("a.avi", "deep/er/frame_*.png", '../beside/ü "quoted".txt', "tab\tand\\back"))
    places = st.sampled_from((folder, Path("/elsewhere")))
    kind = draw(st.sampled_from(SOURCE_KINDS))
    counts = (draw(st.integers(-1, 5)), draw(st.none() | st.integers(1, 9))) if kind == "boxes" else (0, None)
    empty = draw(st.sampled_from((None, Source("video", folder / "empty.avi"), Source("images", folder / "empty"))))
    return CameraSource(
        Source(kind, draw(places) / draw(tails), *counts),
        empty,
        draw(st.integers(-50, 50)),
        draw(st.sampled_from(("error", "blind"))),
    )
