"""Bodies in a view: boxes and discs from the table against points of the body, projected one by one."""

import numpy as np
import pytest
from checks import drawn, numbers
from hypothesis import strategies as st
from scenes import body_box, looking, people, ring

from stseg.arrays import Floats
from stseg.bodies.outlines import outlines
from stseg.bodies.pillars import LEVELS, PROFILE, BodyTable, fill_discs, fill_levels
from stseg.geometry import Camera, Grid

GRID = Grid((-2.0, 2.0), (-2.0, 2.0))
SHARP = (1280, 960)
"""A camera as sharp as real ones, so that a pixel is a strict measure."""
BARREL = (-0.25, 0.05, 0.001, -0.001, 0.0)


def sharp(distortion: tuple[float, ...] | None = None, centre: tuple[float, ...] = (-4.5, -3.0, 2.6)) -> Camera:
    return looking("sharp", centre, size=SHARP, focal=750.0, distortion=distortion)


PLACES = np.stack(np.meshgrid(*[np.linspace(-2, 2, 21)] * 2), -1).reshape(-1, 2)
VIEWS = {"ideal": sharp(), "barrel": sharp(BARREL), "low": sharp(None, (5.0, 0.5, 1.2))}
TABLES = {name: BodyTable.of(camera, GRID) for name, camera in VIEWS.items()}


@pytest.mark.parametrize("view", VIEWS)
@drawn(25, x=numbers(-2, 2), y=numbers(-2, 2), height=numbers(1.3, 2.0))
def test_a_box_is_that_of_the_bodys_points(view: str, x: float, y: float, height: float) -> None:
    expected = body_box(VIEWS[view], np.array([x, y, height]))
    found = TABLES[view].boxes(np.array([[x, y]]), np.array([height]))[0, 0]
    # A pixel, or one hundredth of the body where it is near and large.
    np.testing.assert_allclose(found, expected, rtol=0, atol=max(1.0, 0.01 * (expected[3] - expected[1])))


def test_broad_and_tall_bodies_have_larger_boxes() -> None:
    heights = np.full(len(PLACES), 1.7)
    common, broad = (BodyTable.of(VIEWS["low"], GRID, breadth=b).boxes_of(PLACES, heights) for b in (1.0, 2.0))
    np.testing.assert_allclose(broad[:, 2] - broad[:, 0], 2 * (common[:, 2] - common[:, 0]), rtol=0.02)
    place = people((0.4, -0.7))[:, :2]
    found = TABLES["ideal"].boxes(place, np.array([1.5, 1.7, 1.9]))[:, 0]
    assert (np.diff(found[:, 1]) < -5).all()
    np.testing.assert_allclose(np.ptp(found[:, 3]), 0.0, atol=1e-9)


@drawn(100, x=numbers(-2, 2), y=numbers(-2, 2), height=numbers(1.3, 2.0))
def test_discs_are_rings_of_the_body(x: float, y: float, height: float) -> None:
    table, levels, discs = TABLES["ideal"], np.empty((len(LEVELS), 6)), np.empty((len(PROFILE), 6))
    fill_levels(table, x, y, levels)
    fill_discs(levels, height, PROFILE, table.step, discs)
    for (share, radius), disc in zip(PROFILE, discs, strict=True):
        points = ring(np.array([x, y, height]), share, radius, points=64)
        pixel, _ = VIEWS["ideal"].project(points[:, :2], points[:, 2])
        middle, spread = pixel.mean(0), np.ptp(pixel, axis=0) / 2
        assert np.hypot(*(disc[:2] - middle)) < 1.5
        np.testing.assert_allclose(np.hypot(disc[[2, 4]], disc[[3, 5]]), spread, rtol=0.04, atol=0.5)


def test_a_lens_bends_the_pillar() -> None:
    place, tall = np.array([[-1.9, 1.9]]), np.array([1.7])
    straight, bent = (TABLES[name].boxes(place, tall)[0, 0] for name in ("ideal", "barrel"))
    centre = np.array(SHARP)[[0, 1, 0, 1]] / 2
    assert np.abs(bent - straight).max() > 10
    # A barrel draws what is far from the centre towards it.
    assert np.abs(bent - centre)[0] < np.abs(straight - centre)[0]


@drawn(
    100, st.lists(st.tuples(numbers(-2, 2), numbers(-2, 2), numbers(1.3, 2.0)), min_size=1, max_size=5).map(np.array)
)
def test_a_height_each_or_all_heights(standing: Floats) -> None:
    table = TABLES["barrel"]
    every = table.boxes(standing[:, :2], standing[:, 2])
    own = table.boxes_of(standing[:, :2], standing[:, 2])
    np.testing.assert_array_equal(own, every[np.arange(len(standing)), np.arange(len(standing))])


def test_who_is_behind_or_beside_the_camera_is_on_no_raster() -> None:
    assert TABLES["ideal"].boxes(np.zeros((0, 2)), np.array([1.7])).shape == (1, 0, 4)
    assert TABLES["ideal"].boxes_of(np.zeros((0, 2)), np.zeros(0)).shape == (0, 4)
    inside = looking("inside", (0.0, 0.0, 1.5), target=(2.0, 0.0, 1.0))
    table = BodyTable.of(inside, GRID)
    found = table.boxes(np.array([[-1.5, 0.0], [1.8, 0.0]]), np.array([1.6, 1.8]))
    assert np.isnan(found[:, 0]).all() and np.isfinite(found[:, 1]).all()
    # What stands beside a camera that sees wide angles lies further off than a whole number of pixels can say.
    table, middle = TABLES["ideal"], len(LEVELS) // 2
    for low, high in ((2.5e9, 2.3e19), (-2.3e19, 2.5e9), (1e20, 100.0)):
        pixel = table.pixel.copy()
        pixel[:middle, ..., 1], pixel[middle:, ..., 1] = low, high
        first, spans, _ = outlines(table._replace(pixel=pixel), PLACES, np.full(len(PLACES), 1.7), 4, (240, 320))
        assert ((first >= -1) & (first < 240)).all()
        assert ((spans >= 0) & (spans <= 320)).all()
