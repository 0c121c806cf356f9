"""Marks on a floor are found where two views share them, and bring wrong cameras nearer to the truth."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_people import Walking, walking

from stseg.arrays import Bytes, Floats
from stseg.calibration.adjusted_rig import cameras_of
from stseg.calibration.automatic.auto import align_all, merge_views, placed_views
from stseg.calibration.automatic.floor_features import Marks, floor_marks
from stseg.calibration.automatic.solution import (
    SolvedViews,
    refine_cameras,
    refine_with_marks,
    single_view_cameras,
    view_places,
)
from stseg.calibration.pinhole import CENTRE
from stseg.geometry import Camera, Grid
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig, pixel_rays
from stseg.simulation.rendering.room import render_room

SPEC = SceneSpec("walking", 2, (6.0, 6.0), 40.0, 5.0, 2, seed=1, distortion=(-0.2, 0.03))
GRID = Grid((-2.5, 2.5), (-2.5, 2.5))


def room(camera: Camera) -> Bytes:
    return render_room(SPEC, pixel_rays(camera), camera.centre).image


@pytest.fixture(scope="module")
def cameras() -> tuple[Camera, ...]:
    return build_rig(SPEC).cameras


@pytest.fixture(scope="module")
def marks(cameras: tuple[Camera, ...]) -> Marks:
    shifted = replace(cameras[1], ground=cameras[1].ground @ np.array([[1, 0, 0.08], [0, 1, -0.05], [0, 0, 1.0]]))
    return floor_marks([room(camera) for camera in cameras], [cameras[0], shifted], GRID)


def test_marks_are_the_same_place_in_both_views(cameras: tuple[Camera, ...], marks: Marks) -> None:
    places = [camera.back_project(marks.pixel[:, side]) for side, camera in enumerate(cameras)]
    away = np.linalg.norm(places[0] - places[1], axis=1)
    assert len(marks) >= 30
    assert np.median(away) < 0.05 and np.percentile(away, 90) < 0.12


def test_marks_lie_where_they_are_said_to(cameras: tuple[Camera, ...], marks: Marks) -> None:
    assert np.median(np.linalg.norm(cameras[0].back_project(marks.pixel[:, 0]) - marks.ground, axis=1)) < 0.1


def test_a_bare_floor_has_no_marks(cameras: tuple[Camera, ...]) -> None:
    bare = [np.full((camera.size[1], camera.size[0], 3), 120, np.uint8) for camera in cameras]
    assert len(floor_marks(bare, cameras, GRID)) == 0


@pytest.mark.slow
def test_marks_bring_cameras_nearer_to_the_truth() -> None:
    scene = walking(2, 2, 12.0, noise=2.0)
    single_cameras = single_view_cameras(scene.views, lambda: None)
    places = view_places(scene.views, single_cameras)
    merged = merge_views(places, align_all(places, 5.0, 0, lambda: None))
    by_people = refine_cameras(scene.views, placed_views(single_cameras, merged), np.zeros(2, np.int64), lambda: None)
    true = exact_marks(scene)
    by_both = refine_with_marks(scene.views, by_people, true)
    assert disagreement(by_both, true) < 0.5 * disagreement(by_people, true)
    assert by_both.adjustment.residual.shape == by_people.adjustment.residual.shape
    assert refine_with_marks(scene.views, by_people, true.of(np.zeros(0, np.int64))) is by_people
    assert np.isfinite(by_both.adjustment.parameters.views[:, CENTRE]).all()


def exact_marks(scene: Walking) -> Marks:
    ground = np.stack(np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9)), -1).reshape(-1, 2)
    pixel = np.stack([camera.project(ground, 0.0)[0] for camera in scene.rig.cameras], 1)
    visible = np.all([camera.inside(pixel[:, k]) for k, camera in enumerate(scene.rig.cameras)], axis=0)
    return Marks(np.tile([0, 1], (int(visible.sum()), 1)), pixel[visible], 0 * ground[visible])


def disagreement(solution: SolvedViews, marks: Marks) -> float:
    """Median distance of the two places that the views have a mark at, metres."""
    places: list[Floats] = [
        camera.back_project(marks.pixel[:, side]) for side, camera in enumerate(cameras_of(solution, ["a", "b"]))
    ]
    return float(np.median(np.linalg.norm(places[0] - places[1], axis=1)))
