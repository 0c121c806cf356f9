"""The volume of a frame: clutter, sampling, likelihood per plane and fusion by definition, and what they mean."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import reference_core as reference
from checks import compiled_only, drawn, numbers
from hypothesis import example
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, boxes, corner_cameras, detector_of, evidence_of, found, looking, people, rig_of
from strategies import rigs

from stseg.arrays import Boxes, Floats, Ints, Singles
from stseg.bodies.box_fit import PRIOR_NOISE, ViewBoxes
from stseg.bodies.pillar_index import PillarIndex
from stseg.bodies.pillars import BodyTable
from stseg.config import OccupancyConfig
from stseg.geometry import Grid, Rig
from stseg.geometry.sampling import Sampling, SamplingKind
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, sum_of
from stseg.occupancy.box_planes import CellFit, Vicinity, fill_fit, fill_levels, level_of_match, plane_likelihood
from stseg.occupancy.clutter import clutter, clutter_weights
from stseg.occupancy.fusion import ErrorRates, log_odds_terms
from stseg.occupancy.shown_cells import CellTables, ShownCells
from stseg.occupancy.volume import Occupancy
from stseg.records.people import Explanation

COARSE = rig_of(corner_cameras(), cell=0.5, planes=3)
PIXELS, BOXES = ["pixels"] * 4, ["boxes"] * 4
CONFIG = OccupancyConfig()
PRIOR = float(np.log(CONFIG.occupied_share / (1 - CONFIG.occupied_share)))
RATES = ErrorRates(FEW_HEIGHTS.pixel_miss_rate, FEW_HEIGHTS.pixel_clutter_rate, FEW_HEIGHTS.pixel_clutter_rate)


def explained(rig: Rig, standing: Floats, owner: Sequence[Ints] | None = None, step: int = 1) -> Explanation:
    """An explanation in which these pixels are whose; nobody's where it is not said."""
    views, (width, height) = len(rig.cameras), rig.cameras[0].size
    blank = np.full((-(-height // step), -(-width // step)), -1, np.int16)
    owners = (blank,) * views if owner is None else tuple(np.asarray(o, np.int16) for o in owner)
    free = (np.zeros(0, np.int64),) * views
    somebody, nobody = found(standing, views=views), found(people(), views=views)
    return Explanation(somebody, nobody, owners, (step,) * views, free, np.full(views, np.nan))


def flat(value: float) -> Singles:
    """A map of one likelihood."""
    return np.full((96, 128), value, np.float32)


def noise(seed: int) -> list[Singles]:
    """A random map for each view, with edges of different strength."""
    rng = np.random.default_rng(seed)
    return [(rng.random((96, 128)) ** (k + 1)).astype(np.float32) for k in range(4)]


@drawn(100, st.integers(1, 20), st.integers(1, 20), st.integers(1, 25), st.integers(0, 99))
def test_clutter_by_definition(height: int, width: int, side: int, seed: int) -> None:
    likelihood = np.random.default_rng(seed).random((height, width)).astype(np.float32)
    assert clutter(likelihood, side) == pytest.approx(reference.clutter(likelihood, side), abs=1e-7)


@drawn(100, st.lists(st.just(np.nan) | numbers(0, 0.5), max_size=6), numbers(0, 0.5))
@example([0.1, 0.1, 0.1], 0.0)  # a view that sees nothing does not silence the others
def test_weights_fall_with_clutter_down_to_the_median(others: list[float], clutter: float) -> None:
    clutters = np.array([*others, clutter])
    weights, awake = clutter_weights(clutters), ~np.isnan(clutters)
    assert (weights[~awake] == 0).all() and weights[awake].mean() == pytest.approx(1.0)
    floor = max(float(np.median(clutters[awake])), 1e-6)
    share = weights[awake] * np.maximum(clutters[awake], floor)
    np.testing.assert_allclose(share, share[0])
    assert clutter_weights(np.array([np.nan, np.nan])).tolist() == [0.0, 0.0]


KINDS: list[SamplingKind] = ["point", "footprint"]


@compiled_only
@drawn(15, rigs(most=2), st.sampled_from(KINDS))
def test_cells_are_looked_up_where_they_project(rig: Rig, kind: SamplingKind) -> None:
    sampling = Sampling.of(rig, kind)
    counts = rig.grid.inside()
    assert sampling.footprint.shape == (len(rig.cameras), *rig.grid.shape, 4)
    rng = np.random.default_rng(0)
    for i, camera in enumerate(rig.cameras):
        for _ in range(40):
            z, y, x = (int(rng.integers(0, n)) for n in rig.grid.shape)
            place, ahead = camera.project(rig.grid.ground[y, x], rig.grid.heights[z])
            box = sampling.footprint[i, z, y, x].astype(int)
            if ahead and counts[y, x] and camera.inside(place):
                first, stop = box[:2], box[:2] + box[2:]
                assert (box[2:] == 1).all() or kind == "footprint"
                assert (box[2:] >= 1).all()
                assert (first >= 0).all()
                assert (stop <= camera.size).all()
                clipped = (first == 0) | (stop == camera.size)
                off = np.abs((first + stop - 1) / 2 - place)
                assert (off[~clipped] <= 0.5 + 1e-9).all()
                assert (off[box[2:] == 1] <= 0.5 + 1e-9).all() or clipped.any()
            else:
                assert (box == 0).all()
            away = np.hypot(*(rig.grid.ground[y, x] - camera.centre[:2]))
            assert sampling.distance[i, y, x] == pytest.approx(away, rel=1e-6)
    np.testing.assert_array_equal(sampling.views(), (sampling.footprint[..., 2] > 0).sum(0))


@pytest.mark.parametrize("distortion", [None, (-0.2, 0.03)])
def test_a_footprint_has_the_spread_of_the_cells_image(distortion: Sequence[float] | None) -> None:
    camera = looking("near", (-1.5, -1.2, 2.2), size=(640, 480), focal=420.0, distortion=distortion)
    rig = rig_of([camera], cell=0.1, planes=2)
    footprint = Sampling.of(rig, "footprint").footprint[0, 1]
    within = (np.stack(np.meshgrid(*[np.arange(10)] * 2), -1).reshape(-1, 2) - 4.5) / 10 * rig.grid.cell
    image, _ = camera.project(rig.grid.ground[:, :, None] + within, rig.grid.heights[1])
    sides = image.std(2) * np.sqrt(12 / 0.99)  # of a box of the same variances; the lattice's is 0.99 of the cell's
    left_top, right_bottom = footprint[..., :2], footprint[..., :2] + footprint[..., 2:]
    whole = (left_top > 0).all(-1) & (right_bottom < camera.size).all(-1)
    assert whole.sum() > 500 and footprint[whole][:, 2:].max() > 20
    np.testing.assert_allclose(footprint[whole][:, 2:], sides[whole], atol=0.51, rtol=0.02)


@drawn(15, st.integers(0, 999))
def test_likelihood_per_plane_by_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = corner_cameras()[seed % 4]
    grid = Grid((-2, 2), (-2, 2), cell=1.0, top=1.8, planes=4)
    standing = people(*rng.uniform((-1.8, -1.8, 1.5), (1.8, 1.8, 1.9), (3, 3)))
    found = boxes(camera, standing)
    shaken = Boxes(found.pixel + rng.normal(0, 2, found.pixel.shape), rng.uniform(0.2, 1, len(found)))
    tried = np.array([1.5, 1.65, 1.8])
    bodies = BodyTable.of(camera, grid).boxes(grid.ground.reshape(-1, 2), tried).reshape(3, 4, 4, 4)
    box_owner = rng.integers(-1, 2, len(found))
    near_person = rng.integers(-1, 2, (4, 4))
    edges = np.concatenate([shaken.pixel[:, :2], shaken.pixel[:, :2] + shaken.pixel[:, 2:]], 1)
    edges = edges.clip(0, [camera.size[0] - 1, camera.size[1] - 1] * 2)
    pillars, height = bodies.reshape(-1, 4).astype(np.float32), np.array([1.7, 1.6, 1.8])
    prior = -0.5 * ((tried - height[:, None]) / 0.1) ** 2
    tolerance, _ = PRIOR_NOISE.of(np.ones(len(found)), np.zeros(len(found), bool))
    view = ViewBoxes(edges, tolerance, np.log(shaken.score), 128.0, 96.0)
    fit = CellFit.unfilled(3, 16)
    index, cells = PillarIndex.of(pillars, camera.size), Vicinity.of(near_person, 2)
    fill_fit(index, pillars, prior[0], prior[1:], view, box_owner, cells, fit)
    rates, levels = ErrorRates(0.1, 0.2, 0.3), np.empty((4, 16), np.int16)
    levels[:] = level_of_match(0.0, rates.miss, rates.clutter)
    levels[2, 5] = UNSEEN
    every = np.arange(levels.size, dtype=np.int32)
    person = np.tile(near_person.ravel(), 4).astype(np.int32)
    listed = ShownCells(every, np.append(every, 64).astype(np.int32), every, every, np.zeros(0), person)
    marked = fit.found | (near_person.ravel() >= 0)
    fill_levels(fit, tried, grid.heights, listed, marked, every % 16, rates, levels.reshape(-1))
    for cell, (y, x) in enumerate(np.ndindex(4, 4)):
        free = [b for b in range(len(found)) if box_owner[b] in (-1, near_person[y, x])]
        clutter_rate = rates.clutter if near_person[y, x] < 0 else rates.near_clutter
        for z, plane in enumerate(grid.heights):
            tall = float(height[near_person[y, x] + 1])
            pillars_here = np.asarray(bodies[:, y, x].astype(np.float32), float)
            best = reference.plane_likelihood(pillars_here, tried, plane, tall, 0.1, shaken, free, camera.size)
            expected = TOP_LEVEL * plane_likelihood(best, rates.miss, clutter_rate) if (z, cell) != (2, 5) else UNSEEN
            assert levels[z, cell] == pytest.approx(expected, abs=0.6)


@pytest.mark.parametrize(("near_person", "clutter"), [(-1, 0.01), (0, 0.2)])
def test_a_box_says_as_much_as_its_match_is_worth(near_person: int, clutter: float) -> None:
    """The terms of the rates by which L was made give back m + M (1 - m) / b, and an empty cell counts as M."""
    match, rates = np.linspace(0.05, 0.9, 18).astype(np.float32).reshape(-1, 1, 1), ErrorRates(0.15, 0.01, 0.2)
    likelihood = np.array([plane_likelihood(float(m), rates.miss, clutter) for m in match.flat]).reshape(match.shape)
    said = log_odds_terms(rates)[near_person + 1, np.rint(likelihood * TOP_LEVEL).astype(int)]
    np.testing.assert_allclose(said, np.log(0.15 + match * 0.85 / clutter), atol=0.02)
    erring = clutter * likelihood / (clutter * likelihood + (1 - clutter) * (1 - likelihood))
    np.testing.assert_allclose(erring, match, atol=0.2 * clutter)


def test_terms_and_sums_at_the_end_of_their_numbers() -> None:
    terms = log_odds_terms(ErrorRates(0.2, 0.07, 0.4))
    np.testing.assert_allclose(terms[:, 0], np.log([0.2 / 0.93, 0.2 / 0.6]), rtol=1e-5)
    np.testing.assert_allclose(terms[:, TOP_LEVEL], np.log([0.8 / 0.07, 0.8 / 0.4]), rtol=1e-5)
    assert (np.diff(terms) > 0).all()
    levels = np.random.default_rng(0).integers(0, TOP_LEVEL + 1, (8, 9))
    whole = np.pad(levels.cumsum(0).cumsum(1), ((1, 0), (1, 0))) + 2**32 - 40_000
    sums = (whole % 2**32).astype(np.uint32)
    assert (np.diff(sums.astype(float), axis=1) < 0).any()
    with np.errstate(over="ignore"):
        assert sum_of(sums, 2, 1, 9, 7) == levels[1:7, 2:9].sum()


LEVEL = 0.01
"""Nats: what rounding likelihoods to levels may do to the log-odds of four views."""


def volume_by_definition(
    rig: Rig, maps: Sequence[Singles | None], explanation: Explanation, kind: SamplingKind
) -> Floats:
    """The frame's log-odds, cell by cell."""
    sides = [max(min(camera.size) // 4, 8) for camera in rig.cameras]
    unrest = [np.nan if m is None else reference.clutter(m, side) for m, side in zip(maps, sides, strict=True)]
    weights = clutter_weights(np.array(unrest))
    sampling, people_at = Sampling.of(rig, kind), explanation.people.ground
    centres = [camera.centre[:2] for camera in rig.cameras]
    volume = np.full(rig.grid.shape, np.nan)
    for z, y, x in np.ndindex(*rig.grid.shape):
        footprints, place = sampling.footprint[:, z, y, x], rig.grid.ground[y, x]
        if (footprints[:, 2] == 0).all():
            continue
        reached = np.hypot(*(people_at - place).T)
        near_person = int(reached.argmin()) if len(people_at) and reached.min() <= CONFIG.person_radius else -1
        terms, shares, speaking = [], [], []
        for i, (centre, shown) in enumerate(zip(centres, maps, strict=True)):
            if shown is None or footprints[i, 2] == 0:
                continue
            away, people_away = float(np.hypot(*(place - centre))), np.hypot(*(people_at - centre).T)
            box = footprints[i].tolist()
            levels = np.asarray(np.rint(shown * TOP_LEVEL) / TOP_LEVEL, np.float32)  # a map in whole levels
            share, mean = reference.left_to_cell(levels, box, explanation, i, near_person, away, people_away)
            if share > 0:
                terms.append(reference.log_odds_term(mean, RATES))
                shares.append(share)
                speaking.append(weights[i])
        volume[z, y, x] = PRIOR if near_person < 0 else 0.0
        if terms:
            volume[z, y, x] += CONFIG.effective_observations * reference.fused(terms, speaking, shares)
    return volume


CORNERS = ((-3, -3), (3, -3), (3, 3))
PARTIAL = rig_of([looking(f"cam{x}{y}", (x, y, 2.6), focal=200.0) for x, y in CORNERS], cell=0.5, planes=3)
"""None to all three of its cameras see a cell."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("blind", [(), (2,), range(3)])
@pytest.mark.parametrize("step", [1, 3])
def test_fusion_by_definition(kind: SamplingKind, blind: Sequence[int], step: int) -> None:
    rng = np.random.default_rng(step)
    shape = (-(-96 // step), -(-128 // step))
    owner = [np.where(rng.random(shape) < 0.6, -1, rng.integers(0, 2, shape)) for _ in range(3)]
    explanation = explained(PARTIAL, people((-0.8, 0.3), (1.0, -0.6)), owner, step)
    maps = [None if view in blind else shown for view, shown in enumerate(noise(step)[:3])]
    occupancy = Occupancy(PARTIAL, PIXELS[:3], replace(CONFIG, sampling=kind), FEW_HEIGHTS, BODY)
    assert np.unique(occupancy.views).tolist() == [0, 1, 2, 3]
    fused = occupancy.fuse(maps, explanation).dense()
    assert fused.dtype == np.float32
    np.testing.assert_allclose(fused, volume_by_definition(PARTIAL, maps, explanation, kind), atol=LEVEL)


@compiled_only
@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_cells_at_which_nothing_is_shown_are_fused_as_all_others(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With every block marked, no cell has a representative; rates are the same up to the order of sums."""
    rig = rig_of(corner_cameras(), cell=0.1, planes=3)
    standing = people((-1.6, 0.3), (1.4, -1.6))
    seen = evidence_of(kind, rig.cameras, standing)
    if kind == "pixels":
        seen = [np.where(view > 0.5, view, np.float32(0)) for view in map(np.asarray, seen)]
    explanation = detector_of(rig, kind).explain(seen, None)
    occupancy = Occupancy(rig, [kind] * 4, CONFIG, FEW_HEIGHTS, BODY)
    some, every = occupancy.new_error_rates(), occupancy.new_error_rates()
    sparse = occupancy.fuse_and_learn(some, seen, explanation)
    assert 0 < len(sparse.cell) < 0.8 * sparse.of_cell.size
    monkeypatch.setattr(CellTables, "nothing_marked", lambda self: np.ones(len(self.reach[0]), bool))
    whole = occupancy.fuse_and_learn(every, seen, explanation)
    assert len(whole.cell) == (occupancy.views > 0).sum()
    np.testing.assert_array_equal(sparse.dense(), whole.dense())
    np.testing.assert_allclose(some.counts.sums, every.counts.sums, rtol=1e-9)
    np.testing.assert_array_equal(some.filled.sums, every.filled.sums)


@compiled_only
@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_a_person_is_a_column_of_occupied_cells(kind: str) -> None:
    rig = rig_of(corner_cameras())
    standing = people((-0.8, 0.3), (0.9, -0.6))
    seen = evidence_of(kind, rig.cameras, standing)
    explanation = detector_of(rig, kind).explain(seen, None)
    fused = Occupancy(rig, [kind] * 4, CONFIG, FEW_HEIGHTS, BODY).fuse(seen, explanation).dense()
    away = np.hypot(*np.moveaxis(rig.grid.ground[:, :, None] - standing[:, :2], -1, 0)).min(2)
    assert fused.shape == rig.grid.shape
    assert (fused[:3, away < 0.15] > 0).all()  # the uppermost plane is above them
    assert (fused[:, away > 0.6] < 0).all()
    # A volume from nobody's evidence holds nobody.
    empty = evidence_of(kind, rig.cameras, people())
    nobody = detector_of(rig, kind).explain(empty, None)
    assert (Occupancy(rig, [kind] * 4, CONFIG, FEW_HEIGHTS, BODY).fuse(empty, nobody).dense() < PRIOR).all()


def line_of_sight() -> tuple[Rig, Explanation]:
    """One camera; a person in the middle of the room explains all that it sees."""
    rig = rig_of([looking("west", (-4.0, 0.0, 2.4))])
    return rig, explained(rig, people((0.0, 0.0)), [np.zeros((96, 128), np.int64)])


def test_explained_and_hidden_evidence_speaks_less_elsewhere() -> None:
    rig, explanation = line_of_sight()
    occupancy = Occupancy(rig, PIXELS[:1], CONFIG, FEW_HEIGHTS, BODY)
    fused = occupancy.fuse([flat(1.0)], explanation).dense()
    nobodys = occupancy.fuse([flat(0.0)], explained(rig, people())).dense()
    seen = occupancy.views[0] > 0
    away = np.hypot(*np.moveaxis(rig.grid.ground, -1, 0))
    in_front = seen & (rig.grid.ground[..., 0] < -0.5)
    np.testing.assert_allclose(fused[0][in_front], nobodys[0][in_front], rtol=1e-6)
    assert (fused[0][in_front] < PRIOR).all() and (fused[0][seen & (away < 0.3)] > 1.0).all()
    behind = (occupancy.views[0] > 0) & (rig.grid.ground[..., 0] > 0.6)
    assert behind.any()
    for value in (0.0, 1.0):
        fused = occupancy.fuse([flat(value)], explanation).dense()
        np.testing.assert_allclose(fused[0][behind], PRIOR, rtol=1e-6)
    rig = rig_of(corner_cameras()[:1])
    occupancy = Occupancy(rig, BOXES[:1], CONFIG, FEW_HEIGHTS, BODY)
    explanation = explained(rig, people((0.0, 0.0)))
    half = replace(explanation.people, found_share=np.array([[0.5]]))
    nothing = evidence_of("boxes", rig.cameras, people())
    whole_says = occupancy.fuse(nothing, explanation).dense()
    half_says = occupancy.fuse(nothing, replace(explanation, people=half)).dense()
    near_person = np.hypot(*np.moveaxis(rig.grid.ground, -1, 0)) <= CONFIG.person_radius
    assert (whole_says[0][near_person] < -CONFIG.effective_observations).all()
    np.testing.assert_allclose(half_says[0][near_person], whole_says[0][near_person] / 2, rtol=1e-5)
    np.testing.assert_array_equal(half_says[0][~near_person], whole_says[0][~near_person])


@compiled_only
def test_the_same_frame_twice() -> None:
    occupancy = Occupancy(COARSE, PIXELS, CONFIG, FEW_HEIGHTS, BODY)
    explanation = explained(COARSE, people((0.2, 0.3)))
    first = occupancy.fuse(noise(1), explanation).dense()
    occupancy.fuse(noise(2), explanation)
    np.testing.assert_array_equal(first, occupancy.fuse(noise(1), explanation).dense())


def test_cells_kept_from_the_frame_before_are_those_of_this_one() -> None:
    footprint = Sampling.of(COARSE, "footprint").footprint
    kept = CellTables(footprint)
    marked = kept.nothing_marked()
    assert marked.size > 1
    for block in (0, 0, -1, 0):
        marked[:] = False
        marked[block] = True  # in place: what is kept is no view of it
        near_person = np.full(COARSE.grid.shape[1:], block).reshape(-1)
        fresh = CellTables(footprint).cells_at(marked, near_person)
        assert len(fresh.in_volume)
        for own, other in zip(kept.cells_at(marked, near_person), fresh, strict=True):
            np.testing.assert_array_equal(own, other)
