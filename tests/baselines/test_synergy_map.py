"""Plain localisation: means over footprints and fusion by definition, any reference plane, any number of views."""

import cv2
import numpy as np
import pytest
import reference_core as reference
from checks import compiled_only, drawn, refused
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, found, likelihoods, looking, people, rig_of
from scipy.special import logit

from stseg.arrays import Floats, Singles
from stseg.baselines.khan_shah_2009.synergy_map import Localiser, fill_means, synergy_terms
from stseg.config import OccupancyConfig
from stseg.errors import SourceError
from stseg.geometry import Camera, Grid, Rig
from stseg.geometry.sampling import Sampling, SamplingKind
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, fill_summed_area, sum_of
from stseg.occupancy.fusion import ErrorRates, log_odds_terms
from stseg.occupancy.volume import Occupancy
from stseg.records.people import Explanation

RATES = ErrorRates(0.2, 0.07, 0.07)
OCCUPIED = 0.02
KINDS: list[SamplingKind] = ["point", "footprint"]
COARSE = rig_of(corner_cameras(), cell=0.5, planes=3)


def noise(seed: int, views: int = 4) -> list[Singles]:
    """A random map in whole levels for each view."""
    level = np.random.default_rng(seed).random((views, 96, 128)) ** np.arange(1, views + 1)[:, None, None] * TOP_LEVEL
    return list((np.rint(level) / TOP_LEVEL).astype(np.float32))


@drawn(30, st.integers(1, 30), st.integers(1, 30), st.integers(0, 999))
def test_means_over_footprints_by_definition(width: int, height: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    likelihood = rng.random((height, width)).astype(np.float32)
    first = rng.integers(0, (width, height), (6, 2))
    boxes = np.concatenate([first, rng.integers(1, np.array([width, height]) - first + 1)], 1)
    footprint = np.append(boxes, [[0] * 4], 0).astype(np.int16).reshape(1, 1, -1, 4)
    sums, levels = np.empty((height + 1, width + 1), np.uint32), np.empty((1, 1, 7), np.int16)
    fill_summed_area(likelihood, 0, 0, sums)
    fill_means(sums, footprint, 0, 0, levels)
    assert levels[0, 0, -1] == UNSEEN
    for (left, top, wide, high), level in zip(boxes, levels[0, 0], strict=False):
        mean = likelihood[top : top + high, left : left + wide].mean()
        assert level / TOP_LEVEL == pytest.approx(mean, abs=1.01 / TOP_LEVEL)


@pytest.mark.parametrize("value", [-0.5, 1.5, np.nan])
def test_what_is_no_likelihood_becomes_one(value: float) -> None:
    maps = [np.full((96, 128), value, np.float32)] * 4
    assert np.isfinite(Localiser(COARSE, "footprint").synergy(maps, np.ones(4), 0.05)).all()


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("blind", [None, 1])
def test_localisation_by_definition(kind: SamplingKind, blind: int | None) -> None:
    rig = rig_of([looking(f"cam{x}{y}", (x, y, 2.6), focal=150.0) for x, y in ((-3, -3), (3, -3), (3, 3))])
    maps: list[Singles | None] = [*noise(3, 3)]
    if blind is not None:
        maps[blind] = None
    weights, rates = np.array([0.5, 1.0, 2.0]), [RATES, ErrorRates(0.1, 0.02, 0.1), ErrorRates(0.3, 0.2, 0.3)]
    localiser = Localiser(rig, kind)
    synergy = localiser.synergy(maps, weights, 0.05)
    log_odds = localiser.log_odds(maps, weights, rates, OCCUPIED)
    footprint, n_vis = Sampling.of(rig, kind).footprint, localiser.views(maps)
    static = (footprint[..., 2] > 0).sum(0)
    assert set(np.unique(n_vis)) >= {0, 1, 2}
    for cell in np.ndindex(*rig.grid.shape):
        seeing = [i for i, seen in enumerate(maps) if seen is not None and footprint[(i, *cell)][2] > 0]
        assert n_vis[cell] == len(seeing)
        assert np.isnan(synergy[cell]) == np.isnan(log_odds[cell]) == (static[cell] == 0)
        if seeing:
            means = [
                np.mean([maps[i][v, u] for v, u in reference.pixels_of(footprint[(i, *cell)])])  # type: ignore[index]
                for i in seeing
            ]
            weight, whole = weights[seeing].tolist(), [1.0] * len(seeing)
            by_eq_7 = reference.fused(np.log(np.maximum(means, 0.05)).tolist(), weight, whole)
            terms = [reference.log_odds_term(float(m), rates[i]) for m, i in zip(means, seeing, strict=True)]
            assert synergy[cell] == pytest.approx(by_eq_7, abs=0.01)
            assert log_odds[cell] == pytest.approx(logit(OCCUPIED) + reference.fused(terms, weight, whole), abs=0.02)


def test_nobody_explained_is_the_plain_localisation() -> None:
    maps = noise(5)
    nobody = found(people())
    owner, free = (np.full((96, 128), -1, np.int16),) * 4, (np.zeros(0, np.int64),) * 4
    explanation = Explanation(nobody, nobody, owner, (1,) * 4, free, np.full(4, np.nan))
    localiser = Localiser(COARSE, "footprint")
    clutter = FEW_HEIGHTS.pixel_clutter_rate
    rates = [ErrorRates(FEW_HEIGHTS.pixel_miss_rate, clutter, clutter)] * 4
    config = OccupancyConfig(sampling="footprint", effective_observations=1.0)
    plain = localiser.log_odds(maps, localiser.clutter_weights(maps), rates, config.occupied_share)
    explained = Occupancy(COARSE, ["pixels"] * 4, config, FEW_HEIGHTS, BODY)
    np.testing.assert_array_equal(explained.fuse([*maps], explanation).dense(), plain)


def test_terms_and_sums_at_the_end_of_their_numbers() -> None:
    terms = log_odds_terms(ErrorRates(0.2, 0.07, 0.4))
    np.testing.assert_allclose(terms[:, 0], np.log([0.2 / 0.93, 0.2 / 0.6]), rtol=1e-5)
    np.testing.assert_allclose(terms[:, TOP_LEVEL], np.log([0.8 / 0.07, 0.8 / 0.4]), rtol=1e-5)
    assert (np.diff(terms) > 0).all()
    np.testing.assert_allclose(synergy_terms(0.05)[:, 0], np.log(0.05), rtol=1e-5)
    assert (synergy_terms(0.05)[:, TOP_LEVEL] == 0).all()
    levels = np.random.default_rng(0).integers(0, TOP_LEVEL + 1, (8, 9))
    whole = np.pad(levels.cumsum(0).cumsum(1), ((1, 0), (1, 0))) + 2**32 - 40_000
    sums = (whole % 2**32).astype(np.uint32)
    assert (np.diff(sums.astype(float), axis=1) < 0).any()
    with np.errstate(over="ignore"):
        assert sum_of(sums, 2, 1, 9, 7) == levels[1:7, 2:9].sum()


def test_maps_that_do_not_fit_and_planes_by_default() -> None:
    localiser = Localiser(COARSE, "point")
    refused(SourceError, "found 3, expected 4", localiser.synergy, noise(0, 3), np.ones(3), 0.05)
    with pytest.raises(SourceError, match="corner1"):
        localiser.synergy([noise(0)[0], np.zeros((9, 9), np.float32), None, None], np.ones(4), 0.05)
    assert Grid((0, 1), (0, 1)).planes == 10
    for planes in (1, 3, 25):
        rig = rig_of(corner_cameras()[:1], cell=1.0, planes=planes)
        assert Localiser(rig).synergy(noise(1, 1), np.ones(1), 0.05).shape == (planes, 4, 4)


def test_people_are_where_the_volume_is_highest() -> None:
    standing = people((0.3, -0.4))
    rig = rig_of(corner_cameras(), cell=0.1, planes=5)
    localiser = Localiser(rig)
    maps = list(likelihoods(rig.cameras, standing))
    volume = localiser.log_odds(maps, localiser.clutter_weights(maps), [RATES] * 4, OCCUPIED)
    peak = rig.grid.ground.reshape(-1, 2)[np.nan_to_num(volume[:4], nan=-99).mean(0).argmax()]
    assert np.hypot(*(peak - standing[0, :2])) < 0.15


def test_near_views_do_not_alias_and_far_ones_do_not_blur() -> None:
    """Stripes finer than a cell are half foreground to a footprint, and all or nothing to a point."""
    camera = looking("near", (-1.0, -1.0, 2.0), size=(640, 480), focal=420.0)
    rig = rig_of([camera], cell=0.25, planes=1)
    stripes = np.zeros((480, 640), np.float32)
    stripes[:, ::2] = 1.0
    spread = {kind: np.nanstd(Localiser(rig, kind).log_odds([stripes], np.ones(1), [RATES], 0.5)) for kind in KINDS}
    assert spread["footprint"] < 0.2 * spread["point"]
    # A cell smaller than a pixel is the pixel that shows it.
    rig = rig_of([looking("far", (-30.0, -30.0, 9.0), focal=75.0)], cell=0.25)
    maps = noise(7, 1)
    point, footprint = (Localiser(rig, kind).synergy(maps, np.ones(1), 0.05) for kind in KINDS)
    np.testing.assert_array_equal(point, footprint)


def box_mask(camera: Camera, low: Floats, high: Floats) -> Singles:
    """The silhouette of a box of the world."""
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), -1).reshape(-1, 3)
    pixel, _ = camera.project(corners[:, :2], corners[:, 2])
    mask = np.zeros(camera.size[::-1], np.float32)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.rint(pixel).astype(np.int32)), 1.0)
    return mask


def test_a_wall_is_as_good_a_reference_plane_as_the_ground() -> None:
    """The cells of a cube, as planes above the ground and as planes before its wall y = -1.1, are the same cells."""
    cameras = [looking(f"cam{k}", (x, y, 2.2), (0, 0, 0.9)) for k, (x, y) in enumerate([(-4, 3), (0, 5), (4, 3.5)])]
    masks = [box_mask(camera, np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.1, 1.5])) for camera in cameras]
    ground = Grid((-1.2, 1.2), (-1.2, 1.2), 0.2, 2.2, 12)
    upright = Rig("ground", 5.0, ground, tuple(cameras))
    # x of the wall runs to the world's -x, y up, its normal into the room along +y: a right-handed frame.
    wall_axes = [np.array([-1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([0, 1.0, 0])]
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = np.column_stack(wall_axes), (0.0, -1.1, 0.0)
    before = [Camera.from_projection(c.name, c.size, c.projection @ frame) for c in cameras]
    wall = Rig("wall", 5.0, Grid((-1.2, 1.2), (-0.1, 2.3), 0.2, 2.2, 12), tuple(before))
    weights, rates = np.ones(3), [RATES] * 3
    from_ground = Localiser(upright, "point").log_odds(masks, weights, rates, OCCUPIED)  # z, y, x
    from_wall = Localiser(wall, "point").log_odds(masks, weights, rates, OCCUPIED)  # y, z, -x
    np.testing.assert_allclose(from_wall[:, :, ::-1].swapaxes(0, 1), from_ground, atol=1e-5)
    meant = Localiser(wall, "footprint").log_odds(masks, weights, rates, OCCUPIED)[:, :, ::-1].swapaxes(0, 1)
    z, y, x = np.meshgrid(ground.heights, ground.ground_y, ground.ground_x, indexing="ij")
    within = (np.abs(x) < 0.25) & (y > -0.25) & (y < 0.05) & (z > 0.05) & (z < 1.45)
    beside = (np.abs(x) > 0.9) | (z > 2.1)
    assert within.sum() > 10 and (meant[within] > 0).all()
    assert (meant[beside] < 0).all()


def fine_views(views: int) -> Localiser:
    """So many cameras in one place, above fine cells of one plane."""
    cameras = [looking(f"cam{k}", (0.0, -3.5, 2.6), focal=60.0) for k in range(views)]
    return Localiser(rig_of(cameras, cell=0.04, planes=1), "point")


@compiled_only
@pytest.mark.parametrize("views", [1, 2, 3, 5, 8])
def test_empty_cells_are_not_occupied_in_many_views(views: int) -> None:
    """With the true rates, at most pi / (1 - pi) of the empty cells come to log-odds above 0 (Markov's inequality)."""
    rng, localiser = np.random.default_rng(views), fine_views(views)
    empty = [(rng.random((96, 128)) < RATES.clutter).astype(np.float32) for _ in range(views)]
    bodies = [(rng.random((96, 128)) > RATES.miss).astype(np.float32) for _ in range(views)]
    pi, equal = 0.1, np.ones(views)
    false = np.nanmean(localiser.log_odds(empty, equal, [RATES] * views, pi) > 0)
    hit = np.nanmean(localiser.log_odds(bodies, equal, [RATES] * views, pi) > 0)
    assert false < 1.2 * pi / (1 - pi) and hit > 0.6


@compiled_only
def test_cells_of_few_views_fill_under_a_mean_alone() -> None:
    """A level of the mean that is right for four views is cleared by chance where two see the cell."""
    rng = np.random.default_rng(0)
    false_mean, false_u = {}, {}
    for views in (2, 4, 8):
        localiser = fine_views(views)
        empty = [(rng.random((96, 128)) < RATES.clutter).astype(np.float32) for _ in range(views)]
        equal = np.ones(views)
        mean = localiser.synergy(empty, equal, 0.05) / views
        false_mean[views] = np.mean(mean > -1.6)  # passed by half of the views
        false_u[views] = np.mean(localiser.log_odds(empty, equal, [RATES] * views, OCCUPIED) > 0)
    assert false_mean[2] > 4 * false_mean[4] > 4 * false_mean[8] and max(false_u.values()) < 0.02
