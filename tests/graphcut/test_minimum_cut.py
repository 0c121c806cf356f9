"""The minimum cut: its energy by definition, its minimum by enumeration and by other solvers."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import reference_core as reference
from checks import compiled_only, drawn, refused
from hypothesis import strategies as st
from recordings import track
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow

from stseg.config import SegmentationConfig
from stseg.geometry import Grid
from stseg.graphcut.cut import minimum_cut, reduce
from stseg.graphcut.grid_energy import QUANTUM, GridEnergy
from stseg.graphcut.sign_sets import LABEL_ONE, UNDECIDED
from stseg.graphcut.solvers import SOLVERS, Solver, find_solver
from stseg.graphcut.sparse import CAPACITY_LIMIT, sparse_cut
from stseg.kernels.accelerate import COMPILED
from stseg.segmentation.cell_motion import successor_cells
from stseg.segmentation.cut_energy import build_energy, neighbourhood

TINY = [(1, 1, 3, 4), (2, 1, 2, 3), (2, 2, 1, 3), (3, 1, 2, 2), (2, 2, 3, 1), (1, 3, 2, 2), (4, 1, 1, 3), (12, 1, 1, 1)]
"""Volumes of at most twelve cells, with and without each of the axes."""


def window(
    seed: int, shape: tuple[int, ...], unary: int, capacity: int, drift: int = 1, neighbours: int = 8
) -> GridEnergy:
    """A random window in small whole numbers, so that minima tie; motion may leave the grid."""
    rng = np.random.default_rng(seed)
    offsets = neighbourhood(neighbours)
    motion = rng.integers(-drift, drift + 1, (shape[0] - 1, *shape[2:], 2))
    values = rng.integers(-unary, unary + 1, shape, np.int32)
    return GridEnergy(values, offsets, rng.integers(0, capacity + 1, len(offsets), np.int32), successor_cells(motion))


def smooth_window(seed: int, shape: tuple[int, ...], neighbours: int = 8, smoothness: float = 0.8) -> GridEnergy:
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
    return build_energy(
        log_odds, successor_cells(motion), grid, SegmentationConfig(smoothness=smoothness, neighbours=neighbours)
    )


@drawn(60, st.integers(0, 999), st.sampled_from(TINY), st.sampled_from((8, 80)))
def test_energy_by_definition(seed: int, shape: tuple[int, ...], neighbours: int) -> None:
    energy = window(seed, shape, 9, 5, neighbours=neighbours)
    labels = np.random.default_rng(seed).random(shape) < 0.5
    assert energy.of(labels) == reference.energy_of(energy, labels)
    assert energy.of(labels.astype(np.int32)) == energy.of(labels) and energy.of(np.zeros(shape, bool)) == 0
    assert energy.of(np.ones(shape, bool)) == -energy.unary.sum()
    assert sorted(zip(*(part.tolist() for part in energy.edges()), strict=True)) == sorted(reference.neighbours(energy))


def test_energy_of_log_odds_and_neighbourhoods() -> None:
    """Capacities by the formula, in quanta; unseen cells have unary term 0."""
    log_odds = np.array([1.5, np.nan, -1e9, 1e9], np.float32).reshape(1, 1, 1, 4)
    config = SegmentationConfig(smoothness=0.5, distance_scale=0.2, time_distance=0.3)
    grid = Grid((0, 0.4), (0, 0.1), cell=0.1, top=0.6, planes=3)
    energy = build_energy(log_odds, np.zeros((0, 1, 4), np.int32), grid, config)
    assert energy.unary.ravel().tolist()[:2] == [1500, 0]
    assert energy.unary.min() == -energy.unary.max() < -10_000
    distance = [{(0, 0, 0, 1): 0.1, (0, 0, 1, 0): 0.1}.get(tuple(o), 0.3) for o in energy.offsets.tolist()]
    expected = [0.5 * np.exp(-0.5 * (d / 0.2) ** 2) / QUANTUM for d in distance]
    np.testing.assert_allclose(energy.capacity, expected, atol=0.5)
    for neighbours in (8, 80):
        offsets = [tuple(offset) for offset in neighbourhood(neighbours).tolist()]
        assert len({*offsets, *(tuple(-step for step in offset) for offset in offsets)}) == neighbours
        assert [offset[0] for offset in offsets] == sorted(offset[0] for offset in offsets)


@drawn(60, st.integers(0, 999), st.integers(0, 3))
def test_successors_are_injective(seed: int, drift: int) -> None:
    rng = np.random.default_rng(seed)
    motion = rng.integers(-drift, drift + 1, (2, 4, 5, 2)) * (rng.random((2, 4, 5, 1)) < 0.4)
    ahead = successor_cells(motion)
    np.testing.assert_array_equal(ahead, reference.lead_ahead(motion))
    for frame in ahead:
        reached = frame[frame >= 0]
        assert len(np.unique(reached)) == len(reached)


@pytest.mark.parametrize("shape", TINY)
def test_the_cut_is_the_smallest_of_the_minima(shape: tuple[int, ...]) -> None:
    for seed in range(24 if COMPILED else 8):
        energy = window(seed, shape, unary=3, capacity=2, neighbours=(8, 80)[seed % 2])
        least, smallest = reference.least_energy(energy)
        occupied = minimum_cut(energy).occupied
        assert energy.of(occupied) == least, seed
        np.testing.assert_array_equal(occupied, smallest, err_msg=f"seed {seed}")
        np.testing.assert_array_equal(SOLVERS["pymaxflow"].grid(energy).occupied, smallest, err_msg=f"seed {seed}")


def flow_value(energy: GridEnergy) -> int:
    """The maximum flow from background to object by scipy, quanta."""
    size, unary = energy.unary.size, energy.unary.ravel()
    start, end, capacity = energy.edges()
    less, more = np.flatnonzero(unary < 0), np.flatnonzero(unary > 0)
    tails = np.concatenate([start, end, np.full(len(less), size), more])
    heads = np.concatenate([end, start, less, np.full(len(more), size + 1)])
    carries = np.concatenate([capacity, capacity, -unary[less], unary[more]]).astype(np.int32)
    graph = csr_array((carries, (tails, heads)), shape=(size + 2, size + 2))
    return int(maximum_flow(graph, size, size + 1).flow_value)


@pytest.mark.parametrize("shape", [(3, 2, 8, 9), (5, 3, 6, 7), (1, 4, 10, 10), (8, 1, 9, 8)])
@pytest.mark.parametrize("kind", ["whole numbers", "volume", "smooth volume"])
@pytest.mark.parametrize("neighbours", [8, 80])
def test_the_cut_is_that_of_other_solvers(shape: tuple[int, ...], kind: str, neighbours: int) -> None:
    for seed in range(3 if COMPILED else 1):
        if kind == "whole numbers":
            energy = window(seed, shape, 6, 2, 2, neighbours)
        else:
            strength = {8: 0.8, 80: 0.1}[neighbours] * (3 if kind == "smooth volume" else 1)
            energy = smooth_window(seed, shape, neighbours, strength)
        expected = SOLVERS["pymaxflow"].grid(energy).occupied
        # Least energy, relative to all background, is the least cut less what all background loses.
        assert energy.of(expected) == flow_value(energy) - int(energy.unary.clip(0).sum())
        cut = minimum_cut(energy)
        np.testing.assert_array_equal(cut.occupied, expected)
        assert cut.nodes <= energy.unary.size


@drawn(40, st.integers(0, 999), st.integers(1, 60), st.sampled_from((8, 80)))
def test_the_reduction_is_exact(seed: int, strength: int, neighbours: int) -> None:
    energy = window(seed, (3, 2, 4, 5), unary=strength, capacity=4, neighbours=neighbours)
    reduced = reduce(energy)
    np.testing.assert_array_equal(reduced.left, np.flatnonzero(reduced.state == UNDECIDED))
    expected = SOLVERS["pymaxflow"].grid(energy).occupied
    shape = (3, 3, 5, 6)
    state = reduced.state[: np.prod(shape)].reshape(shape)[:, 1:, 1:, 1:]
    np.testing.assert_array_equal(state[state != UNDECIDED] == LABEL_ONE, expected[state != UNDECIDED])


def test_strong_evidence_is_reduced_and_misfits_are_refused() -> None:
    energy = window(1, (3, 2, 5, 6), unary=1, capacity=1)
    strong = replace(energy, unary=np.where(energy.unary > 0, 100, -100).astype(np.int32))
    cut = minimum_cut(strong)
    assert cut.nodes == 0
    np.testing.assert_array_equal(cut.occupied, strong.unary > 0)
    energy = window(1, (1, 1, 2, 2), unary=1, capacity=1)
    refused(OverflowError, "16384", minimum_cut, replace(energy, capacity=np.full(4, 16384, np.int32)))


def test_smoothness_bridges_a_gap_along_the_motion() -> None:
    """A body moving two cells a frame is missed in one: edges along the motion bridge it, straight ones do not."""
    log_odds = np.full((5, 1, 1, 12), -2.0, np.float32)
    for t in range(5):
        log_odds[t, 0, 0, 2 * t : 2 * t + 2] = 2.0 if t != 2 else -0.2
    grid = Grid((0.0, 1.2), (0.0, 0.1), 0.1, 1.8, 1)
    moving = np.zeros((4, 1, 12, 2), np.int64)
    moving[..., 1] = 2
    config = SegmentationConfig(smoothness=0.5)
    followed = minimum_cut(build_energy(log_odds, successor_cells(moving), grid, config)).occupied
    straight = minimum_cut(build_energy(log_odds, successor_cells(np.zeros_like(moving)), grid, config)).occupied
    assert followed[2, 0, 0].nonzero()[0].tolist() == [4, 5] and not straight[2].any()


@drawn(100, st.integers(0, 9999), st.integers(1, 30), st.integers(0, 90))
def test_sparse_cut_of_any_graph(seed: int, nodes: int, edges: int) -> None:
    rng = np.random.default_rng(seed)
    unary = rng.integers(-9, 10, nodes)
    start, end = rng.integers(0, nodes, (2, edges))
    start, end = start[start != end], end[start != end]
    forward, backward = rng.integers(0, 6, (2, len(start)))
    occupied = sparse_cut(unary, start, end, forward, backward)
    np.testing.assert_array_equal(occupied, SOLVERS["pymaxflow"].sparse(unary, start, end, forward, backward))


def test_sparse_cut_of_extremes() -> None:
    start, end = np.array([0, 1]), np.array([1, 2])
    endless = np.array([10**15, -1, -(10**15)])
    one = np.ones(2, np.int64)
    assert sparse_cut(endless, start, end, 5 * one, 5 * one).tolist() == [True, False, False]
    assert sparse_cut(endless, start, end, np.array([5, 1]), one).tolist() == [True, True, False]
    none = np.zeros(0, np.int64)
    assert sparse_cut(np.array([1, 0, -1]), none, none, none, none).tolist() == [True, False, False]
    refused(OverflowError, "capacities", sparse_cut, endless, start, end, CAPACITY_LIMIT * one, one)


@compiled_only
def test_cuts_in_two_threads_at_once_agree() -> None:
    """Many windows in a row, so that the memory of one is reused by the next; a race would differ."""
    windows = [smooth_window(seed, (6, 3, 9, 9), smoothness=2.5) for seed in range(3)]
    alone = [minimum_cut(energy).occupied for energy in windows]
    assert any(reduce(energy).left.size > 200 for energy in windows)
    with ThreadPoolExecutor(2) as callers:
        for _ in range(60 if COMPILED else 3):
            results = [callers.submit(minimum_cut, energy) for energy in windows]
            for expected, result in zip(alone, results, strict=True):
                np.testing.assert_array_equal(result.result(timeout=60).occupied, expected)


@compiled_only
def test_real_windows(rig_path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cuts = Mock(side_effect=minimum_cut)
    monkeypatch.setitem(SOLVERS, "stseg", Solver(cuts, sparse_cut))
    assert track(rig_path, tmp_path / "run.h5", "--frames", "0:10") == 0
    assert cuts.called
    for (energy,), _ in cuts.call_args_list:
        expected = SOLVERS["pymaxflow"].grid(energy).occupied
        assert expected.any()
        np.testing.assert_array_equal(minimum_cut(energy).occupied, expected)


def test_pymaxflow_is_taken_where_kernels_are_not_compiled() -> None:
    assert find_solver("stseg") is SOLVERS["stseg" if COMPILED else "pymaxflow"]
    assert find_solver("pymaxflow") is SOLVERS["pymaxflow"]
