"""Bodies in views: the evidence of pixels and boxes, and the scale of blobs."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import reference_core as reference
from checks import drawn, numbers
from hypothesis import example
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, corner_cameras, likelihoods, looking, people, rig_of, room

import stseg
from stseg.arrays import Flags, Floats, Singles
from stseg.bodies.box_fit import (
    FEET_LIMIT,
    LOWER_EDGE,
    PRIOR_NOISE,
    ViewBoxes,
    add_own_fits,
    fill_inside,
    fill_match,
    half_square,
)
from stseg.bodies.covered_feet import are_feet_covered
from stseg.bodies.outlines import Pillars, outlines, sums_inside
from stseg.bodies.pillar_index import PillarIndex, fill_fits
from stseg.bodies.pillars import BodyTable
from stseg.bodies.views import PixelView, ViewObservation
from stseg.commands.simulate import simulate
from stseg.detection.detector import Detector
from stseg.detection.evidence.occlusion import occluders_of
from stseg.detection.prior import Prior
from stseg.detection.problem import BoxEvidence, no_rows
from stseg.io.track_csv import read_tracks_csv
from stseg.records.predicted_tracks import no_tracks

WIDTH, HEIGHT = 128.0, 96.0
TOLERANCE = reference.PRIOR_TOLERANCE
EDGES = st.tuples(numbers(-60, 150), numbers(-80, 100), numbers(1, 60), numbers(2, 150)).map(
    lambda b: np.array([b[0], b[1], b[0] + b[2], b[1] + b[3]])
)


@drawn(100, EDGES, EDGES)
def test_half_square_by_definition(body: Floats, box: Floats) -> None:
    expected = reference.half_square(body, box, TOLERANCE, WIDTH, HEIGHT)
    assert half_square(body, box, TOLERANCE, WIDTH, HEIGHT) == pytest.approx(expected, rel=1e-9)


def test_feet_far_above_are_hidden() -> None:
    """A box that ends late is as costly as its error; one that ends early at most as much as hidden feet are."""
    body = np.array([50.0, 10.0, 62.0, 70.0])
    moved = [body + np.array([0, 0, 0, rows]) for rows in (0, 2, -2, 20, -20, -40)]
    cost = [half_square(body, box, TOLERANCE, WIDTH, HEIGHT) for box in moved]
    limit = TOLERANCE[FEET_LIMIT] / TOLERANCE[LOWER_EDGE]
    assert cost[0] == 0.0 and cost[1] == pytest.approx(cost[2]) and cost[3] == pytest.approx(100 * cost[1])
    assert cost[4] == cost[5] == pytest.approx(limit**2 / 2)


@drawn(100, st.lists(EDGES, min_size=1, max_size=4).map(np.array), st.lists(EDGES, max_size=3), st.integers(0, 99))
@example(np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 5.0, 1.0, 16.0]]), [np.array([0.0, 0.0, 1.0, 40.0])], 0)  # far too tall
def test_matches_by_definition(bodies: Floats, found: list[Floats], seed: int) -> None:
    bodies[seed % len(bodies)] = np.nan if seed % 3 == 0 else bodies[0]
    edges = np.array(found).reshape(-1, 4)
    tolerance, belief = PRIOR_NOISE.of(np.random.default_rng(seed).uniform(0.1, 1, len(edges)), are_feet_covered(edges))
    match, best = np.empty((len(bodies), len(edges))), np.full(len(bodies), -np.inf)
    boxes = ViewBoxes(edges, tolerance, belief, WIDTH, HEIGHT)
    fill_match(bodies, boxes, match)
    index = PillarIndex.of(bodies, (int(WIDTH), int(HEIGHT)))
    pillar, fit = np.empty(len(bodies), np.int32), np.empty(len(bodies))
    for b in range(len(edges)):
        number = fill_fits(index, bodies, boxes, b, -30.0, pillar, fit)
        assert (fit[:number] > -30.0).all()
        np.maximum.at(best, pillar[:number], fit[:number])
    for i, body in enumerate(bodies):
        costs = [
            np.inf if np.isnan(body).any() else reference.half_square(body, *one, WIDTH, HEIGHT)
            for one in zip(edges, tolerance, strict=True)
        ]
        np.testing.assert_allclose(match[i], belief - np.array(costs).reshape(-1), rtol=1e-9)
    expected = match.max(1, initial=-np.inf)
    np.testing.assert_array_equal(best, np.where(expected > -30.0, expected, -np.inf))


@drawn(50, st.integers(0, 99))
def test_own_boxes_fit_as_they_match(seed: int) -> None:
    chance, table = np.random.default_rng(seed), BodyTable.of(corner_cameras()[0], room().grid)
    patch, heights = chance.uniform(-4, 4, (3, 2, 2)), chance.uniform(1.4, 2, (3, 4))
    edges, own, score = table.boxes_of(patch[:2, 0], heights[:2, 0]), np.array([1, -1, 0]), np.ones((3, 4, 2))
    boxes = ViewBoxes(edges, *PRIOR_NOISE.of(chance.uniform(0.1, 1, 2), are_feet_covered(edges)), WIDTH, HEIGHT)
    add_own_fits(table, patch, heights, own, boxes, -8.0, score)
    for j, k, place in np.ndindex(3, 4, 2):
        match = np.empty((1, 2))
        fill_match(table.boxes_of(patch[j, place : place + 1], heights[j, k : k + 1]), boxes, match)
        expected = 1.0 + max(match[0, own[j]], -8.0) if own[j] >= 0 else 1.0
        assert score[j, k, place] == pytest.approx(expected, abs=1e-9)


@drawn(100, st.lists(EDGES, min_size=1, max_size=4).map(np.array), st.integers(0, 99))
def test_inside_and_cover_by_definition(bodies: Floats, seed: int) -> None:
    bodies[seed % len(bodies)] = np.nan if seed % 3 == 0 else bodies[0]
    distance = np.random.default_rng(seed).uniform(2, 3, len(bodies))
    inside, base, everyone = np.empty(len(bodies)), seed % (len(bodies) + 1), range(len(bodies))
    fill_inside(bodies, WIDTH, HEIGHT, inside)
    views, away, sizes = np.stack([bodies] * 3), np.stack([distance] * 3), np.array([[WIDTH, HEIGHT]] * 3)
    blind = np.array([False, True, False])
    before = occluders_of(views[:, :base].copy(), away[:, :base].copy(), sizes, blind, no_rows(), 0)
    occluders = occluders_of(views, away, sizes, blind, before, base)
    left = reference.left_by_all(BoxEvidence(np.empty(0), np.zeros(0, np.int64), occluders, np.empty((3, len(bodies)))))
    np.testing.assert_allclose(inside, [reference.inside(b, WIDTH, HEIGHT) for b in bodies], atol=1e-12)
    hidden = [[reference.cover(bodies, distance, WIDTH, HEIGHT, i, k) for k in everyone] for i in everyone]
    none_hidden = np.zeros_like(hidden)
    np.testing.assert_allclose(1 - left, np.stack([hidden, none_hidden, hidden]), atol=1e-12)
    assert all((np.diff(occluders.item[a:b]) > 0).all() for a, b in itertools.pairwise(occluders.start))


@pytest.mark.parametrize("step", [1, 3])
def test_an_outline_is_the_silhouette(step: int) -> None:
    camera = corner_cameras()[0]
    standing = people((0.3, -0.4), (1.2, 1.1, 1.6))
    rows, columns = -(-96 // step), -(-128 // step)
    table = BodyTable.of(camera, room().grid)
    first, spans, area = outlines(table, standing[:, :2], standing[:, 2], step, (rows, columns))
    for j, raster in enumerate(likelihoods([camera], standing[k : k + 1])[0] for k in range(2)):
        fine = np.pad(raster, ((0, rows * step - 96), (0, columns * step - 128)))
        silhouette = fine.reshape(rows, step, columns, step).mean((1, 3))
        filled = np.zeros((rows, columns))
        for k, (start, stop) in enumerate(spans[j]):
            filled[first[j] + k, start:stop] = 1
        edge = (silhouette > 0.0) & (silhouette < 1.0)
        assert (filled == (silhouette > 0.5))[~edge].all()
        assert area[j] == pytest.approx(silhouette.sum(), rel=0.15)


@drawn(100, st.integers(0, 99), st.sampled_from([1, 3]))
def test_sums_inside_are_those_of_the_outlines(seed: int, step: int) -> None:
    chance, table = np.random.default_rng(seed), BodyTable.of(corner_cameras()[0], room().grid)
    ground, heights = chance.uniform(-3, 3, (2, 3, 2)), chance.uniform(1.4, 2, (2, 3))
    widths, ground[:, 1] = chance.uniform(0.8, 1.3, (2, 3)), ground[:, 0]
    shape = (-(-96 // step), -(-128 // step))
    values, owner = chance.normal(size=shape).astype(np.float32), chance.integers(-1, 3, shape, np.int16)
    sums, whole = sums_inside(table, Pillars(ground, heights, widths), step, values, owner, np.arange(2))
    for person in range(2):
        first, spans, area = outlines(table, ground[person], heights[person], step, shape, widths[person])
        raster = np.where((owner < 0) | (owner == person), values, 0).astype(float)
        drawn = [
            sum(raster[first[i] + k, start:stop].sum() for k, (start, stop) in enumerate(spans[i]) if stop > start)
            for i in range(3)
        ]
        np.testing.assert_allclose(sums[person], drawn, atol=1e-9)
        np.testing.assert_array_equal(whole[person], area)


def test_outside_the_image_or_view_nothing_has_a_scale() -> None:
    ahead = looking("ahead", (0.0, 0.0, 1.5), target=(2.0, 0.0, 1.0))
    table = BodyTable.of(ahead, room().grid)
    places = np.array([[-1.5, 0.0], [0.3, 1.9]])
    first, _, _ = outlines(table, places, np.array([1.7, 1.7]), 1, (96, 128))
    np.testing.assert_array_equal(first, [-1, -1])
    detector = detector_for(2)
    nothing = np.zeros(room().cameras[0].size[::-1], np.float32)
    assert not scales(detector, [None, detector.observe([nothing, nothing])[1]]).any()


CROWD = people((-1.2, -0.3, 1.75), (-0.2, 1.2, 1.6), (0.4, -1.1, 1.8))


def detector_for(cameras: int) -> Detector:
    return Detector(rig_of(room().cameras[:cameras]), ["pixels"] * cameras, FEW_HEIGHTS, BODY)


def scales_by_definition(detector: Detector, observations: list[ViewObservation]) -> list[Singles]:
    views, lattice = [view for view in detector.views if isinstance(view, PixelView)], detector.pixel_lattice.outlines
    cells = len(detector.lattice_ground.reshape(-1, 2))
    mean = np.zeros((len(views), cells))
    inside: list[Flags] = []
    common = [slice((3 * k + 1) * cells, (3 * k + 2) * cells) for k in range(len(views))]
    for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
        first, area = lattice.first[common[k]], lattice.area[common[k]]
        spans = [lattice.spans[slice(*lattice.start[i : i + 2])] for i in range(common[k].start, common[k].stop)]
        inside_cell = np.zeros((cells, *view.shape), bool)
        for cell in range(cells):
            for row, (left, right) in enumerate(spans[cell]):
                if right > left:
                    inside_cell[cell, first[cell] + row, left:right] = True
        mean[k] = np.where(first < 0, 0.0, (inside_cell * observation.raster).sum((1, 2)) / np.maximum(area, 1e-9))
        inside.append(inside_cell)
    config = detector.config
    worth = config.prior_log_odds + config.effective_observations * mean.sum(0) > 0
    certain = np.log((1 - config.pixel_miss_rate) / config.pixel_clutter_rate)
    explained = [worth * lattice.area[part] * own / certain for part, own in zip(common, mean, strict=True)]
    return [(own * value[:, None, None]).max(0) for own, value in zip(inside, explained, strict=True)]


def scales(detector: Detector, observations: Sequence[ViewObservation | None]) -> Singles:
    return detector.evidence(observations, Prior.of(None, FEW_HEIGHTS, BODY, detector.border)).scales


@pytest.mark.parametrize("cameras", [1, 2])
def test_scale_is_what_the_largest_body_explains(cameras: int) -> None:
    detector = detector_for(cameras)
    observations = [one for one in detector.observe(likelihoods(room().cameras[:cameras], CROWD)) if one is not None]
    found = scales(detector, observations)
    for scale, expected in zip(found, scales_by_definition(detector, observations), strict=True):
        np.testing.assert_allclose(scale, expected, rtol=1e-4, atol=1e-3)
        assert scale.max() > 0


@pytest.mark.parametrize("place", [(-1.0, 0.0), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.0)])
def test_a_near_body_is_no_small_one_at_the_far_border(place: tuple[float, float]) -> None:
    """Its head holds a whole body there, where births cost nothing."""
    near_body = people((*place, 1.75))
    found = detector_for(1).explain(likelihoods(room().cameras[:1], near_body), no_tracks()).people.ground
    assert np.hypot(*(found - near_body[:, :2]).T).max() < 0.5


@pytest.mark.parametrize("source", ["boxes", "masks"])
def test_animals_are_found(tmp_path: Path, source: str) -> None:
    simulate(tmp_path / "a", scene="animals", seconds=3.0, size="240,180")
    run = stseg.track(tmp_path / "a" / f"rig_{source}.toml", volume="none")
    assert 0.5 < np.median(run.tracks["height"]) < 0.7
    scores = stseg.evaluate(run.trajectory, read_tracks_csv(tmp_path / "a" / "truth.csv"), frames=run.frames)
    assert scores.moda is not None and scores.moda > 95
