"""Boxes, occluders and outlines of pillars by their definitions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import reference_core as reference
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scenes import corner_cameras, likelihoods, looking, people, room
from strategies import numbers

from stseg.arrays import Floats
from stseg.bodies.box_fit import PRIOR_NOISE, TOLERANCE, fill_inside, fill_match, half_square
from stseg.bodies.outlines import outlines, sums_inside
from stseg.bodies.pillar_index import PillarIndex, fill_fits
from stseg.bodies.pillars import BodyTable
from stseg.detection.evidence.occlusion import hiders_of
from stseg.detection.problem import BoxEvidence, no_rows

WIDTH, HEIGHT = 128.0, 96.0
EDGES = st.tuples(numbers(-60, 150), numbers(-80, 100), numbers(1, 60), numbers(2, 150)).map(
    lambda b: np.array([b[0], b[1], b[0] + b[2], b[1] + b[3]])
)


@settings(deadline=None)
@given(EDGES, EDGES)
def test_half_square_by_definition(body: Floats, box: Floats) -> None:
    expected = reference.half_square(body, box, TOLERANCE, WIDTH, HEIGHT)
    assert half_square(body, box, TOLERANCE, WIDTH, HEIGHT) == pytest.approx(expected, rel=1e-9)


def test_a_box_that_fits_costs_nothing_and_early_feet_little() -> None:
    body = np.array([50.0, 20.0, 62.0, 70.0])
    assert half_square(body, body, TOLERANCE, WIDTH, HEIGHT) == 0.0
    early, late = body + np.array([[0, 0, 0, -8], [0, 0, 0, 8]])
    late_cost, early_cost = (half_square(body, box, TOLERANCE, WIDTH, HEIGHT) for box in (late, early))
    assert late_cost == pytest.approx(16 * early_cost)


@settings(deadline=None)
@given(st.lists(EDGES, min_size=1, max_size=4).map(np.array), st.lists(EDGES, max_size=3), st.integers(0, 99))
@example(np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 5.0, 1.0, 16.0]]), [np.array([0.0, 0.0, 1.0, 40.0])], 0)  # far too tall
def test_matches_by_definition(bodies: Floats, found: list[Floats], seed: int) -> None:
    bodies[seed % len(bodies)] = np.nan if seed % 3 == 0 else bodies[0]
    edges = np.array(found).reshape(-1, 4)
    tolerance, belief = PRIOR_NOISE.of(np.random.default_rng(seed).uniform(0.1, 1, len(edges)))
    match, best = np.empty((len(bodies), len(edges))), np.full(len(bodies), -np.inf)
    fill_match(bodies, edges, tolerance, belief, WIDTH, HEIGHT, match)
    index = PillarIndex.of(bodies, (int(WIDTH), int(HEIGHT)))
    pillar, fit = np.empty(len(bodies), np.int32), np.empty(len(bodies))
    for one in zip(edges, tolerance, belief, strict=True):
        number = fill_fits(index, bodies, *one, WIDTH, HEIGHT, -30.0, pillar, fit)
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


@settings(deadline=None)
@given(st.lists(EDGES, min_size=1, max_size=4).map(np.array), st.integers(0, 99))
def test_inside_and_cover_by_definition(bodies: Floats, seed: int) -> None:
    bodies[seed % len(bodies)] = np.nan if seed % 3 == 0 else bodies[0]
    distance = np.random.default_rng(seed).uniform(2, 3, len(bodies))
    inside, base, everyone = np.empty(len(bodies)), seed % (len(bodies) + 1), range(len(bodies))
    fill_inside(bodies, WIDTH, HEIGHT, inside)
    views, away, sizes = np.stack([bodies] * 3), np.stack([distance] * 3), np.array([[WIDTH, HEIGHT]] * 3)
    blind = np.array([False, True, False])
    before = hiders_of(views[:, :base].copy(), away[:, :base].copy(), sizes, blind, no_rows(), 0)
    hiders = hiders_of(views, away, sizes, blind, before, base)
    left = reference.left_by_all(
        BoxEvidence(np.empty(0), np.zeros(0, np.int64), hiders, np.empty((3, len(bodies))), inside)
    )
    np.testing.assert_allclose(inside, [reference.inside(b, WIDTH, HEIGHT) for b in bodies], atol=1e-12)
    hidden = [[reference.cover(bodies, distance, WIDTH, HEIGHT, i, k) for k in everyone] for i in everyone]
    none_hidden = np.zeros_like(hidden)
    np.testing.assert_allclose(1 - left, np.stack([hidden, none_hidden, hidden]), atol=1e-12)
    assert all((np.diff(hiders.item[a:b]) > 0).all() for a, b in itertools.pairwise(hiders.start))


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


@settings(deadline=None)
@given(st.integers(0, 99), st.sampled_from([1, 3]))
def test_sums_inside_are_those_of_the_outlines(seed: int, step: int) -> None:
    chance, table = np.random.default_rng(seed), BodyTable.of(corner_cameras()[0], room().grid)
    many = (2, 3)
    ground, heights, widths = (
        chance.uniform(-3, 3, (*many, 2)),
        chance.uniform(1.4, 2, many),
        chance.uniform(0.8, 1.3, many),
    )
    shape = (-(-96 // step), -(-128 // step))
    values, owner = chance.normal(size=shape).astype(np.float32), chance.integers(-1, 3, shape, np.int16)
    sums, whole = sums_inside(table, ground, heights, widths, step, values, owner, np.arange(2))
    for person in range(2):
        first, spans, area = outlines(table, ground[person], heights[person], step, shape, widths[person])
        raster = np.where((owner < 0) | (owner == person), values, 0).astype(float)
        drawn = [
            sum(raster[first[i] + k, start:stop].sum() for k, (start, stop) in enumerate(spans[i]) if stop > start)
            for i in range(3)
        ]
        np.testing.assert_allclose(sums[person], drawn, atol=1e-9)
        np.testing.assert_array_equal(whole[person], area)


def test_outlines_outside_the_image() -> None:
    ahead = looking("ahead", (0.0, 0.0, 1.5), target=(2.0, 0.0, 1.0))
    table = BodyTable.of(ahead, room().grid)
    places = np.array([[-1.5, 0.0], [0.3, 1.9]])
    first, _, _ = outlines(table, places, np.array([1.7, 1.7]), 1, (96, 128))
    np.testing.assert_array_equal(first, [-1, -1])
