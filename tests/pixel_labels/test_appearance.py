"""Colours that tracks wear, and what they say where bodies overlap."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import corner_cameras, likelihoods, people, room

from stseg.arrays import Bytes, Floats, Ints
from stseg.bodies.pillars import BodyTable
from stseg.config import BodyConfig, LabelConfig
from stseg.pixel_labels.appearance import SLICES, Appearance, BodyRows, ColourSums, colour_log_ratios
from stseg.pixel_labels.label_likelihood import LabelLikelihood, Patches, PlacedPeople
from stseg.pixel_labels.views import ViewLabels

TRACKS = np.array([4, 9])


def two_rectangles(rng: np.random.Generator) -> tuple[LabelLikelihood, BodyRows, Bytes]:
    """Two people whose rectangles share a column of pixels, in a window with its corner at (3, 2)."""
    edges = np.array([[3, 2, 6, 14], [5, 2, 8, 14]])
    share = rng.random(72).astype(np.float32) * (rng.random(72) < 0.8)
    background = np.zeros((12, 5), np.float32)
    rows = BodyRows(np.array([2.0, 4.0]), np.array([14.0, 13.0]))
    image = rng.integers(0, 256, (12, 5, 3)).astype(np.uint8)
    return LabelLikelihood(3, 2, background, Patches(edges, np.array([0, 36, 72]), share)), rows, image


def slice_of(v: int, j: int, rows: BodyRows) -> int:
    return int(np.clip(SLICES * (v + 0.5 - rows.head[j]) / (rows.feet[j] - rows.head[j]), 0, SLICES - 1))


def density(colour: Floats, t: int, s: int, worn: Appearance) -> float:
    """p(c | j, s) / 256^-3."""
    off = colour - worn.mean[t, s]
    normal = worn.peak[t, s] * np.exp(-0.5 * off @ worn.precision[t, s] @ off)
    return float(0.9 * normal * 256.0**3 + 0.1)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_ratios_are_those_of_the_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    likelihood, rows, image = two_rectangles(rng)
    sums = ColourSums.of(TRACKS)
    sums.add(likelihood, rows, TRACKS, image)
    worn = sums.appearance()
    found = colour_log_ratios(worn, likelihood, rows, TRACKS, image).reshape(2, 12, 3)
    share = likelihood.people.share.reshape(2, 12, 3)
    for v, u in product(range(2, 14), range(3, 8)):
        here = [j for j in range(2) if 0 <= u - (3, 5)[j] < 3 and share[j, v - 2, u - (3, 5)[j]] > 0]
        own = {j: density(image[v - 2, u - 3].astype(float), j, slice_of(v, j, rows), worn) for j in here}
        weight = {j: share[j, v - 2, u - (3, 5)[j]] for j in here}
        for j in here:
            mean = sum(weight[i] * own[i] for i in here) / sum(weight.values())
            assert found[j, v - 2, u - (3, 5)[j]] == pytest.approx(np.log(own[j] / mean), abs=1e-4)


def test_a_pixel_of_one_person_alone_says_nothing() -> None:
    likelihood, rows, image = two_rectangles(np.random.default_rng(1))
    worn = ColourSums.of(TRACKS).appearance()
    found = colour_log_ratios(worn, likelihood, rows, TRACKS, image).reshape(2, 12, 3)
    assert np.allclose(found[0, :, :2], 0, atol=1e-6)


def test_colours_are_learned_from_certain_pixels() -> None:
    rng = np.random.default_rng(2)
    likelihood, rows, image = two_rectangles(rng)
    sure = likelihood.people.share >= 0.9
    sums = ColourSums.of(TRACKS)
    for _ in range(2000):
        sums.add(likelihood, rows, TRACKS, image)
    assert sums.count.sum() == 2000 * sure.sum()
    worn = sums.appearance()
    for j, s in zip(*np.nonzero(sums.count), strict=True):
        pixels = [
            image[v - 2, u - 3]
            for i, (v, u) in enumerate(product(range(2, 14), range((3, 5)[j], (6, 8)[j])))
            if sure[36 * j + i] and slice_of(v, int(j), rows) == s
        ]
        np.testing.assert_allclose(worn.mean[j, s], np.mean(pixels, 0), atol=6.0)
    unseen = ColourSums.of(TRACKS).appearance()
    assert (unseen.mean == 127.5).all() and (unseen.peak < worn.peak.max()).all()


def test_where_two_stand_in_one_another_the_colour_decides() -> None:
    """Two people at one place but for 10 cm, far to the side of their true border: shirts tell them apart."""
    camera, everybody = corner_cameras()[0], people((0.05, 0.0), (-0.05, 0.0))
    config = LabelConfig(samples=16, boundary_weight=0.5)
    view = ViewLabels(camera, BodyTable.of(camera, room().grid), config, BodyConfig(width_spread=0.03))
    covariance = np.tile(0.05**2 * np.eye(2), (2, 1, 1))
    placed = PlacedPeople(everybody[:, :2], covariance, everybody[:, 2], TRACKS)
    foreground = likelihoods([camera], everybody)[0]
    truth: Ints = (np.arange(foreground.shape[1]) % 2)[None].repeat(foreground.shape[0], 0)
    colours = np.array([[200, 40, 40], [40, 40, 200]], np.uint8)
    mean = np.repeat(colours[:, None].astype(float), SLICES, 1)
    precision = np.tile(np.eye(3) / 100.0, (2, SLICES, 1, 1))
    worn = Appearance(TRACKS, mean, precision, np.full((2, SLICES), (2 * np.pi * 100.0) ** -1.5))
    labels = view.label(placed, foreground, colours[truth], worn)
    inside = foreground > 0.5
    right = (labels == truth + 1)[inside].mean()
    blind = (view.label(placed, foreground, colours[truth]) == truth + 1)[inside].mean()
    assert right > 0.9 > blind
