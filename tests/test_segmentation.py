"""The cut: its energy by definition, its minimum by trying all and by other solvers, and the blobs that it leaves."""

from __future__ import annotations

from dataclasses import replace

import maxflow
import numpy as np
import pytest
import reference_core as reference
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow
from strategies import numbers

from stseg.arrays import Flags, Floats
from stseg.config import SegmentationConfig
from stseg.geometry import Grid
from stseg.segmentation.blobs import Blobs, find_blobs
from stseg.segmentation.cut import minimum_cut
from stseg.segmentation.energy import QUANTUM, Energy, build_energy
from stseg.segmentation.motion import motion_field
from stseg.segmentation.reduction import reduce

GRID = Grid((0.0, 2.0), (0.0, 1.5), cell=0.1, top=1.8, planes=4)
TINY = [(1, 1, 3, 4), (2, 1, 2, 3), (2, 2, 1, 3), (3, 1, 2, 2), (2, 2, 3, 1), (1, 3, 2, 2), (4, 1, 1, 3), (12, 1, 1, 1)]
"""Volumes of at most twelve cells, with and without each of the axes."""


def window(seed: int, shape: tuple[int, ...], unary: int, capacity: int, drift: int = 1) -> Energy:
    """A random window in small whole numbers, so that minima tie; motion may leave the grid."""
    rng = np.random.default_rng(seed)
    frames, _, rows, columns = shape
    across, along, up, ahead = (int(c) for c in rng.integers(0, capacity + 1, 4))
    motion = rng.integers(-drift, drift + 1, (frames - 1, rows, columns, 2))
    return Energy(rng.integers(-unary, unary + 1, shape), across, along, up, ahead, motion)


def smooth_window(seed: int, shape: tuple[int, ...]) -> Energy:
    """A random window as occupied volumes are: blobs, weak borders, cells that no view sees, motion of many cells."""
    rng = np.random.default_rng(seed)
    frames, planes, rows, columns = shape
    log_odds = rng.normal(-0.3, 1.0, shape).astype(np.float32)
    for _ in range(3):
        y, x = rng.uniform(0, rows), rng.uniform(0, columns)
        away = np.hypot(np.arange(rows)[:, None] - y, np.arange(columns) - x)
        log_odds += (2.5 * np.exp(-((away / 2) ** 2))).astype(np.float32)
    log_odds[rng.random(shape) < 0.05] = np.nan
    motion = rng.integers(-2, 3, (frames - 1, rows, columns, 2))
    grid = Grid((0.0, columns * 0.1), (0.0, rows * 0.1), 0.1, 1.8, planes)
    return build_energy(log_odds, motion, grid, SegmentationConfig(smoothness=0.8))


# The energy


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 999), st.sampled_from(TINY))
def test_energy_by_definition(seed: int, shape: tuple[int, ...]) -> None:
    energy = window(seed, shape, 9, 5)
    labels = np.random.default_rng(seed).random(shape) < 0.5
    assert energy.of(labels) == reference.energy_of(energy, labels)
    assert energy.of(labels.astype(np.int32)) == energy.of(labels)
    assert energy.of(np.zeros(shape, bool)) == 0
    assert energy.of(np.ones(shape, bool)) == -energy.unary.sum()


def test_energy_of_log_odds() -> None:
    """Capacities by METHODS 4 in quanta; what no view sees costs and earns nothing."""
    log_odds = np.array([1.5, np.nan, -1e9, 1e9], np.float32).reshape(1, 1, 1, 4)
    config = SegmentationConfig(smoothness=0.5, spread=0.2, step=0.3)
    grid = Grid((0, 0.4), (0, 0.1), cell=0.1, top=0.6, planes=3)
    energy = build_energy(log_odds, np.zeros((0, 1, 4, 2), np.int64), grid, config)
    assert energy.unary.ravel().tolist()[:2] == [1500, 0]
    assert energy.unary.min() == -energy.unary.max() < -10_000
    expected = [0.5 * np.exp(-0.5 * (d / 0.2) ** 2) / QUANTUM for d in (0.1, 0.1, 0.3, 0.3)]
    np.testing.assert_allclose((energy.along, energy.across, energy.up, energy.ahead), expected, atol=0.5)


# The minimum


@pytest.mark.parametrize("shape", TINY)
def test_the_cut_is_the_smallest_of_the_minima(shape: tuple[int, ...]) -> None:
    for seed in range(60):
        energy = window(seed, shape, unary=3, capacity=2)
        least, smallest = reference.least_energy(energy)
        occupied = minimum_cut(energy).occupied
        assert energy.of(occupied) == least, seed
        np.testing.assert_array_equal(occupied, smallest, err_msg=f"seed {seed}")


def by_plain_graph(energy: Energy) -> Flags:
    """The cut of the whole grid, nothing decided beforehand; ties to the background."""
    graph = maxflow.GraphInt(energy.unary.size, 8 * energy.unary.size)
    graph.add_nodes(energy.unary.size)
    for p, u in enumerate(energy.unary.ravel().tolist()):
        graph.add_tedge(p, max(-u, 0), max(u, 0))
    for p, q, b in reference.neighbours(energy):
        graph.add_edge(p, q, b, b)
    graph.maxflow()
    segments = [graph.get_segment(p) for p in range(energy.unary.size)]
    return np.array(segments, bool).reshape(energy.unary.shape)


def flow_value(energy: Energy) -> int:
    """The maximum flow from background to object by scipy, quanta."""
    size, unary = energy.unary.size, energy.unary.ravel()
    edges = [(p, q, b) for p, q, b in reference.neighbours(energy) if b]
    pairs = [*edges, *((q, p, b) for p, q, b in edges)]
    pairs += [(size, int(p), int(-unary[p])) for p in np.flatnonzero(unary < 0)]
    pairs += [(int(p), size + 1, int(unary[p])) for p in np.flatnonzero(unary > 0)]
    start, end, capacity = np.array(pairs).T
    graph = csr_array((capacity.astype(np.int32), (start, end)), shape=(size + 2, size + 2))
    return int(maximum_flow(graph, size, size + 1).flow_value)


@pytest.mark.parametrize("shape", [(3, 2, 8, 9), (5, 3, 6, 7), (1, 4, 10, 10), (8, 1, 9, 8)])
@pytest.mark.parametrize("kind", ["whole numbers", "volume"])
def test_the_cut_is_that_of_other_solvers(shape: tuple[int, ...], kind: str) -> None:
    for seed in range(3):
        energy = smooth_window(seed, shape) if kind == "volume" else window(seed, shape, 6, 2, drift=2)
        cut = minimum_cut(energy)
        np.testing.assert_array_equal(cut.occupied, by_plain_graph(energy))
        # Least energy, relative to all background, is the least cut less what all background loses.
        assert energy.of(cut.occupied) == flow_value(energy) - int(energy.unary.clip(0).sum())
        assert cut.nodes <= energy.unary.size


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 999), st.integers(1, 60))
def test_what_is_decided_beforehand_is_right(seed: int, strength: int) -> None:
    energy = window(seed, (3, 2, 5, 6), unary=strength, capacity=4)
    left = reduce(energy)
    sure = ~left.open
    np.testing.assert_array_equal(left.occupied[sure], by_plain_graph(energy).ravel()[sure])
    assert left.open[left.start].all()
    assert left.open[left.end].all()


def test_strong_evidence_leaves_nothing_to_cut() -> None:
    energy = window(1, (3, 2, 5, 6), unary=1, capacity=1)
    strong = replace(energy, unary=np.where(energy.unary > 0, 100, -100))
    cut = minimum_cut(strong)
    assert cut.nodes == 0
    np.testing.assert_array_equal(cut.occupied, strong.unary > 0)


@pytest.mark.parametrize("seed", range(5))
def test_no_other_labelling_has_less_energy(seed: int) -> None:
    energy = smooth_window(seed, (4, 3, 8, 8))
    occupied = minimum_cut(energy).occupied
    least = energy.of(occupied)
    rng = np.random.default_rng(seed)
    for share in (0.02, 0.2, 0.5):
        for _ in range(20):
            assert energy.of(rng.random(occupied.shape) < share) >= least
            assert energy.of(occupied ^ (rng.random(occupied.shape) < share)) >= least
    for _ in range(50):
        other = occupied.copy()
        other.flat[rng.integers(other.size)] ^= True
        assert energy.of(other) >= least
    assert least <= energy.of(energy.unary > 0)


def test_smoothness_bridges_a_gap_along_the_motion() -> None:
    """A walker of two cells a frame, missed in one frame: the edges in time follow, straight ones would not."""
    log_odds = np.full((5, 1, 1, 12), -2.0, np.float32)
    for t in range(5):
        log_odds[t, 0, 0, 2 * t : 2 * t + 2] = 2.0 if t != 2 else -0.2
    grid = Grid((0.0, 1.2), (0.0, 0.1), 0.1, 1.8, 1)
    moving = np.zeros((4, 1, 12, 2), np.int64)
    moving[..., 1] = 2
    config = SegmentationConfig(smoothness=0.5)
    followed = minimum_cut(build_energy(log_odds, moving, grid, config)).occupied
    straight = minimum_cut(build_energy(log_odds, np.zeros_like(moving), grid, config)).occupied
    assert followed[2, 0, 0].nonzero()[0].tolist() == [4, 5]
    assert not straight[2].any()


# Motion


def test_cells_near_a_person_move_with_them() -> None:
    now = np.array([[0.55, 0.55], [1.45, 0.95]])
    then = np.array([[1.25, 0.85], [0.85, 0.45]])
    motion = motion_field(now, then, np.array([4, 7]), np.array([7, 4]), 0.25, GRID)
    assert motion[5, 5].tolist() == [-1, 3]
    assert motion[9, 14].tolist() == [-1, -2]
    assert motion[6, 6].tolist() == [-1, 3]
    assert not motion[0, 0].any()
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - now, -1, 0)).min(2)
    np.testing.assert_array_equal(motion.any(2), away <= 0.25)


def test_whoever_is_not_found_again_stays() -> None:
    here = np.array([[0.55, 0.55]])
    for chains_then in ([], [9]):
        then = np.tile([[1.0, 1.0]], (len(chains_then), 1))
        motion = motion_field(here, then, np.array([3]), np.array(chains_then, np.int64), 0.3, GRID)
        assert motion.shape == (15, 20, 2)
        assert not motion.any()
    assert not motion_field(np.zeros((0, 2)), here, np.zeros(0, np.int64), np.array([3]), 0.3, GRID).any()


# Blobs


def disc(*places: tuple[float, float], radius: float = 0.22, tall: int = 3) -> Flags:
    """Occupied cells around places, up to the plane `tall`, bool (plane, y, x)."""
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - np.array(places), -1, 0)).min(2)
    occupied = np.zeros(GRID.shape, bool)
    occupied[: tall + 1] = away <= radius
    return occupied


def blobs_of(occupied: Flags, *standing: tuple[float, float], strength: Floats | float = 2.0) -> Blobs:
    log_odds = np.where(occupied, strength, -3.0).astype(np.float32)
    return find_blobs(occupied, log_odds, np.array(standing).reshape(-1, 2), 0.4, GRID)


def test_a_person_is_a_blob() -> None:
    place = (0.85, 0.75)
    found = blobs_of(disc(place, tall=2), place)
    assert found.person.tolist() == [0]
    np.testing.assert_allclose(found.ground[0], place, atol=1e-9)  # a symmetric mass has its centroid in the middle
    assert found.extent[0] == pytest.approx((found.cells == 1).sum() * 0.01)
    assert found.height[0] == pytest.approx(1.2)
    assert found.mass[0] == pytest.approx(2.0)
    np.testing.assert_array_equal(found.cells > 0, disc(place).any(0))
    assert len(found.touches) == 0
    spread = np.linalg.eigvalsh(found.covariance[0])
    assert ((spread > 0) & (spread < 0.1**2)).all()


def test_the_centroid_follows_the_mass() -> None:
    place = (0.85, 0.75)
    heavier = np.where(GRID.ground[..., 0] > 0.85, 6.0, 1.0)
    found = blobs_of(disc(place), place, strength=heavier)
    assert found.ground[0, 0] > 0.88
    assert found.ground[0, 1] == pytest.approx(0.75)


def test_touching_people_are_divided() -> None:
    left, right = (0.65, 0.75), (1.05, 0.75)
    found = blobs_of(disc(left, right), right, left)
    assert sorted(found.person.tolist()) == [0, 1]
    assert found.touches.tolist() == [[0, 1]]
    for blob, who in enumerate(found.person):
        x = (right, left)[who][0]
        cells = GRID.ground[found.cells == blob + 1]
        assert (np.abs(cells[:, 0] - x) <= 0.2 + 1e-9).all()
    np.testing.assert_array_equal(found.cells > 0, disc(left, right).any(0))


def test_a_piece_without_a_person_is_kept() -> None:
    found = blobs_of(disc((0.45, 0.75), (1.55, 0.75)), (0.45, 0.75))
    assert sorted(found.person.tolist()) == [-1, 0]
    assert len(found.touches) == 0
    unknown = found.person.tolist().index(-1)
    np.testing.assert_allclose(found.ground[unknown], (1.55, 0.75), atol=1e-9)


def test_people_without_cells_are_no_blobs() -> None:
    found = blobs_of(disc((0.45, 0.75)), (0.45, 0.75), (1.8, 0.2))
    assert found.person.tolist() == [0]
    empty = blobs_of(np.zeros(GRID.shape, bool), (0.45, 0.75))
    assert len(empty.person) == len(empty.ground) == 0
    assert not empty.cells.any()
    assert empty.touches.shape == (0, 2)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(numbers(0, 2), numbers(0, 1.5)), max_size=4), st.integers(0, 999))
def test_blobs_partition_what_is_occupied(standing: list[tuple[float, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random(GRID.shape) < 0.08
    log_odds = rng.normal(0, 2, GRID.shape).astype(np.float32)
    log_odds[rng.random(GRID.shape) < 0.1] = np.nan
    found = find_blobs(occupied, log_odds, np.array(standing).reshape(-1, 2), 0.4, GRID)
    number = len(found.person)
    np.testing.assert_array_equal(found.cells > 0, occupied.any(0))
    assert np.unique(found.cells[found.cells > 0]).tolist() == list(range(1, number + 1))
    held = found.person[found.person >= 0]
    assert len(np.unique(held)) == len(held)
    assert np.isfinite(found.ground).all()
    assert (np.linalg.eigvalsh(found.covariance) > 0).all()
    assert found.extent.sum() == pytest.approx(occupied.any(0).sum() * 0.01)
