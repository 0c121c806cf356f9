"""Target detection probability: strips are pillars, sums are those of the definition, and people stand at its modes."""

from dataclasses import replace

import numpy as np
import pytest
import reference_detection_probability as reference
from checks import compiled_only, drawn, numbers, refused
from hypothesis import assume, example
from hypothesis import strategies as st
from scenes import corner_cameras, likelihoods, looking, people, rig_of
from strategies import BARREL, cameras

from stseg.arrays import Floats, Singles
from stseg.baselines.huang_wang_2012.detection_probability import DetectionProbability, fill_chance
from stseg.baselines.huang_wang_2012.mean_shift import fill_modes, modes
from stseg.baselines.huang_wang_2012.pillar_strips import PillarStrips
from stseg.config import BodyConfig, ProposalConfig
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.geometry.summed_area import TOP_LEVEL, fill_summed_area

FEW = ProposalConfig(body_sizes=3, lattice_spacing=0.25)
HEIGHTS = np.array([1.5, 1.7, 1.9])


def probability(views: tuple[Camera, ...] = corner_cameras(), config: ProposalConfig = FEW) -> DetectionProbability:
    return DetectionProbability(rig_of(views), config, BodyConfig())


def rolled(camera: Camera, angle: float) -> Camera:
    """A camera turned about its own axis, radians."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    middle = np.array([[1.0, 0.0, (camera.size[0] - 1) / 2], [0.0, 1.0, (camera.size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera.from_projection(
        camera.name, camera.size, middle @ turn @ np.linalg.inv(middle) @ camera.projection, camera.lens
    )


@st.composite
def maps(draw: st.DrawFn) -> Singles:
    """A small map of whole levels, so that its sums are exact."""
    rows, columns = draw(st.integers(3, 12)), draw(st.integers(3, 12))
    levels = np.random.default_rng(draw(st.integers(0, 10**6))).integers(0, TOP_LEVEL + 1, (rows, columns))
    return (levels / TOP_LEVEL).astype(np.float32)


@st.composite
def strips(draw: st.DrawFn) -> PillarStrips:
    """One pillar of a few strips, about a small map: upright or lying, from either end."""
    count = draw(st.integers(2, 5))
    lengths = draw(st.lists(numbers(0.0, 4.0), min_size=count, max_size=count))
    edge = draw(numbers(-8.0, 14.0)) + np.append(0.0, np.cumsum(lengths)) * draw(st.sampled_from((-1.0, 1.0)))
    middle = draw(st.lists(numbers(-4.0, 14.0), min_size=count, max_size=count))
    half = draw(st.lists(numbers(0.5, 12.0), min_size=count, max_size=count))
    upright, base = np.array([draw(st.booleans())]), draw(st.integers(0, count - 1))
    one, two, three = (np.array([part], np.float32) for part in (edge, middle, half))
    return PillarStrips(upright, one, two, three, base)


EDGE, MIDDLE, HALF = (np.array([part], np.float32) for part in ([0, 0, 1], [0, -0.375], [1, 0.5]))
NARROW = PillarStrips(np.array([False]), EDGE, MIDDLE, HALF, 0)
"""A pillar whose widest form, rounded to pixels, misses an image that a narrower one meets."""


@example(np.ones((3, 3), np.float32), NARROW, 0.5)
@drawn(60, maps(), strips(), numbers(0.01, 0.5))
def test_the_kernel_is_the_definition(likelihood: Singles, pillars: PillarStrips, outside: float) -> None:
    rng, widths = np.random.default_rng(0), np.array([0.2, 0.3, 0.4])
    height_share, width_share = (rng.dirichlet(np.ones(n)) for n in (pillars.middle.shape[1] - pillars.base, 3))
    sums = np.empty((likelihood.shape[0] + 1, likelihood.shape[1] + 1), np.uint32)
    fill_summed_area(likelihood, 0, 0, sums)
    found = np.empty(1)
    fill_chance(
        sums, pillars.upright, pillars.edge, pillars.middle, pillars.half, pillars.base, widths, height_share,
        width_share, outside, found,
    )  # fmt: skip
    expected = reference.chance(likelihood, pillars, 0, widths, height_share, width_share, outside, 40)
    np.testing.assert_allclose(found[0], expected, rtol=1e-6, atol=1e-9)


def overlap(one: Floats, other: Floats) -> float:
    return float(np.minimum(one, other).sum() / np.maximum(one, other).sum())


def boxed(image: Floats) -> Floats:
    """The one rectangle about an image."""
    filled = np.zeros_like(image)
    rows, columns = np.nonzero(image)
    filled[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = 1.0
    return filled


VIEWS = {
    "corner": (corner_cameras()[0], 0.9),
    "rolled": (rolled(corner_cameras()[1], 0.4), 0.8),
    "on its side": (rolled(corner_cameras()[1], 1.5), 0.9),
    "barrel": (looking("barrel", (-3.5, -3.5, 2.6), distortion=BARREL), 0.8),
    "from above": (looking("above", (0.3, -0.5, 5.0)), 0.8),
}
"""Cameras, and how much of strips and pillar together both must cover."""


@compiled_only
@pytest.mark.parametrize("view", VIEWS)
def test_strips_cover_what_the_pillar_does(view: str) -> None:
    # Images are enlarged so that whole pixels are no part of the error, but where there is a lens.
    small, floor = VIEWS[view]
    fine = np.diag([4.0, 4.0, 1.0])
    large = Camera("large", (512, 384), fine @ small.ground, fine @ small.vertical)
    camera = small if small.lens else large
    places = np.array([[0.0, 0.0], [1.2, 0.8], [-0.7, 1.1], [1.3, -0.9]])
    pillars = PillarStrips.of(camera, places, HEIGHTS, 0.3)
    shares = []
    for i, place in enumerate(places):
        for h, height in enumerate(HEIGHTS):
            exact = reference.drawn(camera, place, float(height), 0.3, 300)
            strips = reference.region(pillars, i, h, 0.3, 300, (camera.size[1], camera.size[0])).astype(float)
            shares.append(overlap(strips, exact))
    assert np.mean(shares) > floor, shares
    one_box = [reference.drawn(camera, place, 1.7, 0.3, 300) for place in places]
    assert np.mean(shares) > np.mean([overlap(boxed(image), image) for image in one_box])


@drawn(25, cameras(lenses=False))
def test_a_pillar_stands_where_the_homographies_say(camera: Camera) -> None:
    # On the axis, at each end of the strips above the caps, whatever the camera.
    pillars = PillarStrips.of(camera, np.zeros((1, 2)), HEIGHTS, 1e-9)
    assume(not np.isnan(pillars.edge[0, 0]))
    for k, height in ((0, 0.0), (-3, HEIGHTS[0]), (-1, HEIGHTS[2])):
        column = camera.plane(float(height)) @ [0.0, 0.0, 1.0]
        axis = column[:2] / column[2]
        along = 1 if pillars.upright[0] else 0
        assert pillars.edge[0, k] == pytest.approx(axis[along] + 0.5, abs=1e-2 + 1e-5 * abs(axis[along]))


def test_a_full_map_fills_every_pillar_and_unfit_ones_none() -> None:
    asked = probability()
    full = [np.ones(camera.size[::-1], np.float32) for camera in asked.rig.cameras]
    chance = asked.chance(asked.pillars[0], full[0])
    centre = np.hypot(*asked.ground.reshape(-1, 2).T) < 0.5
    np.testing.assert_allclose(chance[centre], 1.0, atol=1e-6)
    assert np.nanmin(chance) >= asked.config.unseen_rate - 1e-9
    expected = 4 * np.log(1 / asked.config.covered_share)
    np.testing.assert_allclose(asked.log_ratio(full).reshape(-1)[centre], expected, atol=1e-5)
    refused(SourceError, "4, one a camera", asked.log_ratio, [None] * 3)
    refused(SourceError, "corner1", asked.log_ratio, [None, np.zeros((3, 3), np.float32), None, None])


def test_blind_views_hidden_pillars_and_outside_say_nothing() -> None:
    narrow = looking("narrow", (3.5, 3.5, 2.6), target=(-1.5, -1.5, 0.9), focal=260.0)
    views = (*corner_cameras()[:2], narrow)
    asked = probability(views)
    maps = list(likelihoods(views, people((1.5, -1.5))))
    unseen = np.isnan(asked.chance(asked.pillars[2], maps[2])).reshape(asked.ground.shape[:2])
    assert unseen.any() and not unseen.all()
    two, three = asked.log_ratio([*maps[:2], None]), asked.log_ratio(maps)
    np.testing.assert_array_equal(two[unseen], three[unseen])
    assert (two[~unseen] != three[~unseen]).any()
    np.testing.assert_array_equal(asked.log_ratio([None] * 3), 0.0)
    rig = rig_of(corner_cameras())
    triangle = np.array([[-2.0, -2.0], [2.0, -2.0], [-2.0, 2.0]])
    asked = DetectionProbability(replace(rig, grid=replace(rig.grid, polygon=triangle)), FEW, BodyConfig())
    said = asked.log_ratio([np.ones(camera.size[::-1], np.float32) for camera in rig.cameras])
    beyond = asked.ground.sum(-1) > 0.1
    assert np.isneginf(said[beyond]).all() and np.isfinite(said[~beyond & (asked.ground.sum(-1) < -0.1)]).all()


def test_no_view_has_a_veto_and_coarser_maps_say_the_same() -> None:
    views = corner_cameras()
    maps = list(likelihoods(views, people((0.25, -0.25))))
    maps[0][:] = 0.0
    asked = probability(views, replace(FEW, lattice_spacing=0.5))
    place = np.unravel_index(asked.log_ratio(maps).argmax(), asked.ground.shape[:2])
    assert np.hypot(*(asked.ground[place] - [0.25, -0.25])) < 0.3
    least = np.log(FEW.view_miss_rate / FEW.covered_share)
    assert (asked.log_ratio([np.zeros_like(m) for m in maps]) >= 4 * least - 1e-9).all()
    maps = list(likelihoods(views, people((0.4, -0.3), (-0.9, 0.8))))
    coarse = [m.reshape(m.shape[0] // 2, 2, m.shape[1] // 2, 2).mean((1, 3)) for m in maps]
    rig = rig_of(views)
    fine, half = DetectionProbability(rig, FEW, BodyConfig()), DetectionProbability(rig, FEW, BodyConfig(), [2] * 4)
    for k in range(4):
        one, other = fine.chance(fine.pillars[k], maps[k]), half.chance(half.pillars[k], coarse[k])
        seen = ~np.isnan(one) & ~np.isnan(other)
        assert np.abs(one - other)[seen].mean() < 0.04


@pytest.mark.parametrize("camera", (0, 1, 2))
def test_it_is_highest_at_people_through_a_lens_and_a_roll(camera: int) -> None:
    views = (
        corner_cameras(),
        tuple(rolled(view, 0.5) for view in corner_cameras()),
        tuple(looking(view.name, view.centre.tolist(), distortion=BARREL) for view in corner_cameras()),
    )[camera]
    standing = people((0.4, -0.3))
    asked = probability(views, replace(FEW, lattice_spacing=0.2))
    said = asked.log_ratio(likelihoods(views, standing))
    weight = np.where(said > 0, np.exp(said), 0.0)
    found = modes(weight, asked.ground, asked.spacing, 0.4)
    assert len(found) == 1 and np.hypot(*(found.ground[0] - standing[0, :2])) < 0.1
    assert np.sqrt(np.linalg.eigvalsh(found.covariance[0])).max() < 0.3


@st.composite
def lattices(draw: st.DrawFn) -> Floats:
    rows, columns = draw(st.integers(1, 7)), draw(st.integers(1, 7))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    return np.asarray(np.where(rng.random((rows, columns)) < 0.5, rng.random((rows, columns)) ** 3, 0.0))


@drawn(40, lattices(), numbers(0.6, 3.0))
def test_samples_move_as_the_formula_says(weight: Floats, reach: float) -> None:
    found, mode = np.empty((np.count_nonzero(weight), 2)), np.empty(np.count_nonzero(weight), np.int64)
    number = fill_modes(weight, reach, found, mode)
    expected, own = reference.mean_shift(weight, reach)
    assert number == len(expected)
    np.testing.assert_allclose(found[:number], expected, atol=1e-6)
    np.testing.assert_array_equal(mode, own)


@drawn(30, lattices(), numbers(0.2, 1.0))
@example(np.zeros((4, 5)), 0.4)
def test_modes_share_all_samples_out(weight: Floats, kernel: float) -> None:
    rows, columns = weight.shape
    ground = np.stack(np.meshgrid(1 + 0.25 * np.arange(columns), -2 + 0.25 * np.arange(rows)), -1)
    found = modes(weight, ground, 0.25, kernel)
    assert found.weight.sum() == pytest.approx(weight.sum()) and (np.diff(found.weight) <= 0).all()
    np.testing.assert_allclose(found.weight @ found.ground, (weight[..., None] * ground).sum((0, 1)), atol=1e-9)
    assert (np.linalg.eigvalsh(found.covariance) > 0.25**2 / 12 - 1e-9).all()


@compiled_only
def test_two_people_apart_are_two_modes_of_their_own_shape() -> None:
    axis = np.arange(-2, 2, 0.1)
    ground = np.stack(np.meshgrid(axis, axis), -1)
    places, spreads = np.array([[-0.83, 0.22], [0.71, -0.35]]), ((0.2, 0.1), (0.12, 0.12))
    weight = np.zeros(ground.shape[:2])
    for place, (sx, sy) in zip(places, spreads, strict=True):
        off = ground - place
        weight += np.exp(-0.5 * ((off[..., 0] / sx) ** 2 + (off[..., 1] / sy) ** 2))
    found = modes(np.where(weight > 1e-3, weight, 0.0), ground, 0.1, 0.4)
    np.testing.assert_allclose(found.ground, places, atol=0.02)
    np.testing.assert_allclose(found.peak, places, atol=0.02)
    for covariance, (sx, sy) in zip(found.covariance, spreads, strict=True):
        np.testing.assert_allclose(covariance, np.diag([sx**2, sy**2]), atol=4e-3)
    assert len(modes(weight, ground, 0.1, 3.0)) == 1
