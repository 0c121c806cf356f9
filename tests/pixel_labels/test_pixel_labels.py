"""Labels of pixels, and the appearance of people in them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import reference_pixel_labels as reference
from checks import drawn
from hypothesis import strategies as st
from scenes import corner_cameras, likelihoods, looking, people, room

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.bodies.outlines import outlines
from stseg.bodies.pillars import WIDTH, BodyTable
from stseg.config import BodyConfig, LabelConfig
from stseg.geometry import Camera
from stseg.graphcut.grid_energy import QUANTUM
from stseg.pixel_labels.appearance import SLICES, BodyRows, ColourSums, ViewAppearance, colour_log_ratios
from stseg.pixel_labels.label_likelihood import (
    LabelLikelihood,
    PersonPatches,
    PlacedPeople,
    pillar_patches,
    visible_shares,
)
from stseg.pixel_labels.pixel_energy import PixelEnergy, edge_costs, most_likely_labels, pixel_energy
from stseg.pixel_labels.views import ViewLabels, view_labels

EXACT = LabelConfig(samples=1, position_noise=1e-3, height_noise=0.0)
"""One pillar a person, just as the micro-scenes draw them."""
EXACT_BODY = BodyConfig(width_mean=WIDTH, width_spread=1e-9)
FEW = LabelConfig(samples=8, position_noise=0.03, height_noise=0.03)
"""Almost certain ones: the people of the micro-scenes have no arms and legs."""
BODY = BodyConfig(width_mean=WIDTH, width_spread=0.03)


def standing(everybody: Floats, spread: float = 0.0) -> PlacedPeople:
    covariance = np.tile(spread**2 * np.eye(2), (len(everybody), 1, 1))
    return PlacedPeople(everybody[:, :2], covariance, everybody[:, 2], np.arange(1, len(everybody) + 1))


def labels_of(camera: Camera, config: LabelConfig = FEW, body: BodyConfig = BODY) -> ViewLabels:
    return ViewLabels(camera, BodyTable.of(camera, room().grid), config, body)


def labels_in(camera: Camera, everybody: Floats) -> Labels:
    """Labels from the exact masks."""
    return labels_of(camera).label(standing(everybody), likelihoods([camera], everybody)[0], None)


def test_a_certain_pillar_is_its_outline_and_out_of_view_none() -> None:
    camera, everybody = corner_cameras()[0], people((0.3, -0.4), (1.2, 1.1, 1.6))
    table = BodyTable.of(camera, room().grid)
    patches = pillar_patches(table, standing(everybody), EXACT, EXACT_BODY)
    first, spans, _ = outlines(table, everybody[:, :2], everybody[:, 2], 1, (96, 128))
    for j in range(2):
        outline = np.zeros((96, 128))
        for k, (start, stop) in enumerate(spans[j]):
            outline[first[j] + k, start:stop] = 1
        left, top, right, bottom = patches.edges[j]
        share = patches.share[patches.first[j] : patches.first[j + 1]].reshape(bottom - top, right - left)
        assert np.abs(outline[top:bottom, left:right] - share).mean() < 0.005
        assert outline.sum() == outline[top:bottom, left:right].sum()
    camera, everybody = corner_cameras()[0], people((0.3, -0.4))
    sharp, wide = (pillar_patches(table, standing(everybody, spread), FEW, BODY).share for spread in (0.0, 0.2))
    assert wide.min() >= 0 and wide.max() <= 1 + 1e-6
    assert sharp.max() == pytest.approx(1.0) and (wide > 0).sum() > 1.3 * (sharp > 0).sum()
    assert wide.sum() == pytest.approx(sharp.sum(), rel=0.25)
    view = labels_of(looking("ahead", (0.0, 0.0, 1.5), target=(2.0, 0.0, 1.0)))
    behind = people((-1.5, 0.0))
    assert len(view.label_likelihood(standing(behind)).people.share) == 0
    bright = np.ones((96, 128), np.float32)
    assert not view.label(standing(behind), bright, None).any()
    assert not view.label(standing(behind[:0]), bright, None).any()


@drawn(20, st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_the_product_is_the_mean_over_all_combinations_of_draws(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = [rng.random((3, 2, 3)) < 0.6 for _ in range(count)]
    distance = rng.random(count)
    cover = np.concatenate([own.mean(0).ravel() for own in drawn]).astype(np.float32)
    patches = PersonPatches(np.tile([4, 7, 7, 9], (count, 1)), np.arange(count + 1) * 6, cover)
    shown = visible_shares(patches, distance)
    assert (shown.left, shown.top) == (4, 7)
    np.testing.assert_allclose(reference.dense(shown), reference.nearest_shares(drawn, distance), atol=1e-5)


def test_likely_labels_are_the_start_and_pairs_cost_the_same() -> None:
    shown = random_nearest(np.random.default_rng(3), 2, (3, 4))
    np.testing.assert_array_equal(most_likely_labels(shown), reference.dense(shown).argmax(0))
    across, down = edge_costs(None, (3, 4), LabelConfig(boundary_weight=3.0, colourless_factor=0.5))
    np.testing.assert_array_equal(across * QUANTUM, np.tile([1.5, 1.5, 1.5, 0.0], (3, 1)))
    np.testing.assert_array_equal(down * QUANTUM, np.repeat([[1.5], [1.5], [0.0]], 4, 1))


@drawn(20, st.integers(0, 2**32 - 1))
def test_weights_follow_the_sigmoid_and_are_not_negative(seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 60, (3, 4, 3)).astype(np.uint8)
    config = LabelConfig(boundary_weight=3.0, contrast_limit=40.0, contrast_slope=10.0)
    across, down = edge_costs(image, (3, 4), config)
    assert min(across.min(), down.min()) >= 0
    assert not across[:, -1].any() and not down[-1].any()
    for v, u in product(range(2), range(3)):
        for cost, other in ((across, image[v, u + 1]), (down, image[v + 1, u])):
            assert cost[v, u] * QUANTUM == pytest.approx(reference.adjacency(image[v, u], other, config), abs=QUANTUM)


def random_nearest(rng: np.random.Generator, count: int, shape: tuple[int, int]) -> LabelLikelihood:
    """People whose rectangles lie anywhere in a window."""
    rows, columns = shape
    top, left = rng.integers(0, rows, count), rng.integers(0, columns, count)
    edges = np.stack([left, top, rng.integers(left + 1, columns + 1), rng.integers(top + 1, rows + 1)], 1)
    edges = np.concatenate([edges, [[0, 0, columns, rows]]])[-count:] + np.tile([5, 2], 2)
    first = np.append(0, np.cumsum((edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])))
    share = rng.random(first[-1]).astype(np.float32)
    return visible_shares(PersonPatches(edges, first, share), rng.random(count))


def problem(seed: int, shape: tuple[int, int]) -> tuple[PixelEnergy, LabelLikelihood, Singles, Bytes, LabelConfig]:
    rng = np.random.default_rng(seed)
    config = LabelConfig(contrast_limit=200.0, contrast_slope=60.0, outlier_rate=0.1)
    config = replace(config, foreground_weight=float(rng.uniform(0, 4)), boundary_weight=float(rng.uniform(0, 2)))
    shown = random_nearest(rng, 2, shape)
    foreground = rng.random(shown.background.shape).astype(np.float32)
    image = rng.integers(0, 256, (*shown.background.shape, 3)).astype(np.uint8)
    ours = pixel_energy(shown, foreground, *edge_costs(image, shown.background.shape, config), config)
    return ours, shown, foreground, image, config


@drawn(40, st.integers(0, 2**32 - 1))
def test_the_energy_of_the_paper_with_pruned_labels(seed: int) -> None:
    ours, shown, foreground, image, config = problem(seed, (2, 3))
    shares, shape = reference.dense(shown), shown.background.shape
    empty = reference.energy(np.zeros(shape, int), foreground, image, shares, config)
    cell = np.repeat(np.arange(ours.energy.cells), np.diff(ours.energy.first))
    allowed = {(int(ours.pixel[p]), int(label)) for p, label in zip(cell, ours.energy.label, strict=True)}
    best_of_all = best_allowed = np.inf
    for flat in product(range(3), repeat=shape[0] * shape[1]):
        label = np.array(flat)
        if any(k and reference.dense(shown)[k].flat[p] == 0 and (p, k) not in allowed for p, k in enumerate(flat)):
            continue  # outside that person's rectangle
        theirs = reference.energy(label.reshape(shape), foreground, image, shares, config) - empty
        best_of_all = min(best_of_all, theirs)
        if all(k == 0 or (p, k) in allowed for p, k in enumerate(flat)):
            assert ours.energy.of(label[ours.pixel]) * QUANTUM == pytest.approx(theirs, abs=0.03)
            best_allowed = min(best_allowed, theirs)
    assert best_allowed == pytest.approx(best_of_all, abs=0.03)


def test_people_are_silhouettes_the_nearer_in_front() -> None:
    camera, everybody = corner_cameras()[1], people((0.2, 0.1))
    seen, label = likelihoods([camera], everybody)[0], labels_in(camera, everybody)
    assert (label[seen > 0.8] == 1).all() and not label[seen < 0.2].any()
    everybody = people((-0.5, 0.3), (0.6, -0.2, 1.8))
    views = view_labels(room(), FEW, BODY)
    for view, seen in zip(views, likelihoods(room().cameras, everybody), strict=True):
        label = view.label(standing(everybody), seen, None)
        for j in range(2):
            alone = likelihoods([view.camera], everybody[j : j + 1])[0] > 0.8
            other = likelihoods([view.camera], everybody[1 - j : 2 - j])[0] > 0.2
            assert (label[alone & ~other] == j + 1).mean() > 0.95
    # Of pixels that bodies fill, as in the tests above: those at their edges are between two answers.
    camera = corner_cameras()[0]
    everybody = people((-0.6, -0.6), (0.6, 0.62))  # on one line from the corner
    near, far = (likelihoods([camera], everybody[j : j + 1])[0] for j in range(2))
    label = labels_in(camera, everybody)
    both, behind = (near > 0.8) & (far > 0.8), (near < 0.2) & (far > 0.8)
    assert both.any() and (label[both] == 1).mean() > 0.95
    assert (label[behind] == 2).mean() > 0.9
    camera, everybody = corner_cameras()[2], people((-0.5, -0.5))
    blotch = likelihoods([camera], everybody)[0]
    blotch[:20, :20] = 1.0
    label = labels_of(camera).label(standing(everybody), blotch, None)
    np.testing.assert_array_equal(label, labels_in(camera, everybody))
    np.testing.assert_array_equal(labels_in(camera, everybody), labels_in(camera, everybody))


def test_colours_fill_holes_reject_specks_and_make_borders() -> None:
    camera, everybody = corner_cameras()[0], people((0.0, 0.0))
    seen = likelihoods([camera], everybody)[0]
    rows, columns = np.nonzero(seen > 0.5)
    hole, speck = (round(float(rows.mean())), round(float(columns.mean()))), (int(rows.mean()), columns.max() + 3)
    seen[hole], seen[speck] = 0.0, 1.0
    label = labels_of(camera).label(standing(everybody), seen, np.full((96, 128, 3), 80, np.uint8))
    assert label[hole] == 1 and label[speck] == 0
    camera, everybody = corner_cameras()[0], people((-0.1, 0.35), (0.35, -0.1))
    near, far = (likelihoods([camera], everybody[j : j + 1])[0] > 0.5 for j in range(2))
    image = np.full((96, 128, 3), 60, np.uint8)
    image[near], image[far & ~near] = 20, 200
    seen = likelihoods([camera], everybody)[0]
    view = labels_of(camera)
    off = everybody + np.array([0.06, -0.06, 0.0])  # to the side, as the camera sees it
    truth = np.where(near, 1, np.where(far, 2, 0))
    plain, coloured = (view.label(standing(off, 0.1), seen, colours) for colours in (None, image))
    assert (coloured != truth).sum() < (plain != truth).sum()


TRACKS = np.array([4, 9])


def two_rectangles(rng: np.random.Generator) -> tuple[LabelLikelihood, BodyRows, Bytes]:
    """Two people whose rectangles share a column of pixels, in a window with its corner at (3, 2)."""
    edges = np.array([[3, 2, 6, 14], [5, 2, 8, 14]])
    share = rng.random(72).astype(np.float32) * (rng.random(72) < 0.8)
    background = np.zeros((12, 5), np.float32)
    rows = BodyRows(np.array([2.0, 4.0]), np.array([14.0, 13.0]))
    image = rng.integers(0, 256, (12, 5, 3)).astype(np.uint8)
    return LabelLikelihood(3, 2, background, PersonPatches(edges, np.array([0, 36, 72]), share)), rows, image


def slice_of(v: int, j: int, rows: BodyRows) -> int:
    return int(np.clip(SLICES * (v + 0.5 - rows.head[j]) / (rows.feet[j] - rows.head[j]), 0, SLICES - 1))


def density(colour: Floats, t: int, s: int, worn: ViewAppearance) -> float:
    """p(c | j, s) / 256^-3."""
    off = colour - worn.mean[t, s]
    normal = worn.peak[t, s] * np.exp(-0.5 * off @ worn.precision[t, s] @ off)
    return float(0.9 * normal * 256.0**3 + 0.1)


@drawn(20, st.integers(0, 2**32 - 1))
def test_ratios_are_those_of_the_definition(seed: int) -> None:
    likelihood, rows, image = two_rectangles(np.random.default_rng(seed))
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
    np.testing.assert_allclose(found[0, :, :2], 0, atol=1e-6)  # of one person alone


def test_colours_are_learned_from_certain_pixels() -> None:
    likelihood, rows, image = two_rectangles(np.random.default_rng(2))
    sure = likelihood.people.share >= 0.9
    sums = ColourSums.of(TRACKS)
    for _ in range(2000):
        sums.add(likelihood, rows, TRACKS, image)
    assert sums.pixels.sum() == 2000 * sure.sum()
    worn = sums.appearance()
    for j, s in zip(*np.nonzero(sums.pixels), strict=True):
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
    view = labels_of(camera, config, BodyConfig(width_spread=0.03))
    placed = replace(standing(everybody, 0.05), track=TRACKS)
    foreground = likelihoods([camera], everybody)[0]
    truth: Ints = (np.arange(foreground.shape[1]) % 2)[None].repeat(foreground.shape[0], 0)
    colours = np.array([[200, 40, 40], [40, 40, 200]], np.uint8)
    mean = np.repeat(colours[:, None].astype(float), SLICES, 1)
    precision = np.tile(np.eye(3) / 100.0, (2, SLICES, 1, 1))
    worn = ViewAppearance(TRACKS, mean, precision, np.full((2, SLICES), (2 * np.pi * 100.0) ** -1.5))
    labels = view.label(placed, foreground, colours[truth], worn)
    inside = foreground > 0.5
    right = (labels == truth + 1)[inside].mean()
    blind = (view.label(placed, foreground, colours[truth]) == truth + 1)[inside].mean()
    assert right > 0.9 > blind
