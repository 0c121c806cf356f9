"""Expansion moves of many labels, and roof duality of two."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import reference_expansion as reference
from checks import compiled_only, drawn, refused
from hypothesis import strategies as st
from maxflow.fastmin import aexpansion_grid

from stseg.arrays import Ints
from stseg.graphcut import qpbo
from stseg.graphcut.expansion import LabelEnergy, Moves, expand
from stseg.graphcut.qpbo import QuadraticEnergy, minimise
from stseg.graphcut.solvers import SOLVERS
from stseg.graphcut.sparse import sparse_cut


def lattice(shape: tuple[int, ...]) -> tuple[Ints, Ints]:
    """Pairs of direct neighbours of a grid."""
    index = np.arange(np.prod(shape)).reshape(shape)
    sides = [(index.take(range(n - 1), a), index.take(range(1, n), a)) for a, n in enumerate(shape)]
    start, end = (np.concatenate([side[k].ravel() for side in sides]) for k in (0, 1))
    return start, end


def random_energy(seed: int, shape: tuple[int, ...], labels: int, weight: int, admissible: float = 0.7) -> LabelEnergy:
    """A random energy in small whole numbers, so that minima tie; weights of its own for each edge."""
    rng = np.random.default_rng(seed)
    start, end = lattice(shape)
    may = rng.random((int(np.prod(shape)), labels)) < admissible
    first = np.append(0, np.cumsum(may.sum(1)))
    strength = int(rng.integers(2, 12))
    cost = rng.integers(-strength, strength // 2 + 1, int(may.sum()))
    return LabelEnergy(first, np.nonzero(may)[1] + 1, cost, start, end, rng.integers(0, weight + 1, len(start)))


def some_start(energy: LabelEnergy, seed: int) -> Ints:
    """Any admissible labelling."""
    rng = np.random.default_rng(seed)
    return np.array([rng.choice(sorted(costs)) for costs in reference.costs(energy)])


TINY = [(2, 4), (2, 2, 2), (8,), (1, 7)]


@drawn(40, st.integers(0, 999), st.sampled_from(TINY))
def test_energy_by_definition(seed: int, shape: tuple[int, ...]) -> None:
    energy = random_energy(seed, shape, 3, 5)
    for labels in (some_start(energy, seed), energy.cheapest_labels()):
        assert energy.of(labels) == reference.energy_of(energy, labels)
    assert energy.of(np.zeros(energy.cells, np.int64)) == 0


def test_no_label_one_label_and_cells_outside_the_cut() -> None:
    energy = LabelEnergy(*(np.array(a) for a in ([0, 1, 1], [2], [-5], [0], [1], [1])))
    assert energy.of(np.array([2, 0])) == -4
    for labels in ([1, 0], [2, 2]):
        refused(ValueError, "inadmissible", expand, energy, np.array(labels))
    empty = np.zeros(0, np.int64)
    assert len(expand(LabelEnergy(np.zeros(1, np.int64), empty, empty, empty, empty, empty), empty)) == 0
    alone = LabelEnergy(np.zeros(4, np.int64), empty, empty, empty, empty, empty)
    assert expand(alone, np.zeros(3, np.int64)).tolist() == [0, 0, 0]
    assert len(minimise(QuadraticEnergy(empty, empty, empty, empty)).labels) == 0
    for seed in range(10):
        energy = random_energy(seed, (4, 6), 1, 3, admissible=1.0)
        cut = sparse_cut(-energy.cost, energy.start, energy.end, energy.weight, energy.weight)
        np.testing.assert_array_equal(expand(energy, np.zeros(energy.cells, np.int64)), cut)
    # Cells with label 0 in the binary cut of the best costs stay background.
    for seed in range(10):
        energy = random_energy(seed, (5, 7), 3, 3, admissible=0.8)
        best = np.array([max(0, *(-cost for cost in costs.values())) for costs in reference.costs(energy)])
        only = np.array([min([costs[k] for k in costs if k] or [9]) for costs in reference.costs(energy)])
        unary = np.where(best > 0, best, -only)
        inside = sparse_cut(unary, energy.start, energy.end, energy.weight, energy.weight)
        assert not expand(energy, np.where(inside, energy.cheapest_labels(), 0))[~inside].any()


@drawn(40, st.integers(0, 999), st.sampled_from(TINY), st.integers(0, 6))
def test_each_move_is_optimal_and_smallest(seed: int, shape: tuple[int, ...], weight: int) -> None:
    energy = random_energy(seed, shape, 3, weight)
    moves = Moves(energy, some_start(energy, seed))
    for alpha in (1, 2, 0, 3, 1, 2, 3, 0):
        if alpha not in moves.alphabet:
            continue
        all_ = list(reference.expansions(energy, moves.labels.copy(), alpha))
        best = min(all_, key=lambda labels: reference.energy_of(energy, labels))  # the first of several: the smallest
        before, start = energy.of(moves.labels), moves.labels.copy()
        changed = moves.move(alpha)
        np.testing.assert_array_equal(moves.labels, best)
        assert changed == (moves.labels != start).sum()
        assert energy.of(moves.labels) < before if changed else energy.of(moves.labels) == before


@drawn(30, st.integers(0, 999), st.sampled_from(TINY))
def test_no_expansion_improves_the_result(seed: int, shape: tuple[int, ...]) -> None:
    energy = random_energy(seed, shape, 3, 4)
    start = some_start(energy, seed)
    labels = expand(energy, start)
    least = reference.energy_of(energy, labels)
    assert least <= reference.energy_of(energy, start)
    for alpha in range(4):
        assert all(reference.energy_of(energy, other) >= least for other in reference.expansions(energy, labels, alpha))


@compiled_only
@pytest.mark.parametrize("shape", [(4, 5, 3), (3, 2, 4, 3)])
@pytest.mark.parametrize("weight", [0, 2, 6])
def test_pruning_changes_nothing(shape: tuple[int, ...], weight: int) -> None:
    """Cells dropped from a move change nothing: not the energy, not a label."""
    for seed in range(6):
        energy = random_energy(seed, shape, 4, weight)
        for start in (energy.cheapest_labels(), some_start(energy, seed), np.zeros(energy.cells, np.int64)):
            labels = expand(energy, start)
            np.testing.assert_array_equal(labels, reference.plain_expand(energy, start))
            np.testing.assert_array_equal(labels, expand(energy, start))


@compiled_only
@pytest.mark.parametrize("admissible", [0.6, 1.0])
def test_with_one_weight_the_result_is_that_of_aexpansion_grid(admissible: float) -> None:
    shape, labels = (3, 2, 4, 5), 4
    for seed in range(25):
        drawn, weight = random_energy(seed, shape, labels, 1, admissible), seed % 7
        energy = replace(drawn, weight=np.full(len(drawn.start), weight))
        table = np.full((energy.cells, labels + 1), 1e6)
        for p, costs in enumerate(reference.costs(energy)):
            table[p, list(costs)] = list(costs.values())
        start = table.argmin(1)
        np.testing.assert_array_equal(start, energy.cheapest_labels())
        differ = weight * (1.0 - np.eye(labels + 1))
        theirs = aexpansion_grid(table.reshape(*shape, -1), differ, labels=start.reshape(shape).copy()).ravel()
        ours = expand(energy, start)
        assert energy.of(ours) == energy.of(theirs)
        np.testing.assert_array_equal(ours, theirs)


def quadratic_energy(seed: int, nodes: int, edges: int, low: int, high: int) -> QuadraticEnergy:
    rng = np.random.default_rng(seed)
    start, end = rng.integers(0, nodes, (2, edges))
    kept = start != end
    weight = rng.integers(low, high + 1, edges)
    return QuadraticEnergy(rng.integers(-6, 7, nodes), start[kept], end[kept], weight[kept])


def least(energy: QuadraticEnergy) -> int:
    return min(energy.of(np.array(labels)) for labels in product((False, True), repeat=len(energy.unary)))


@drawn(60, st.integers(0, 9999), st.integers(1, 9), st.integers(0, 20), st.sampled_from([(-5, 0), (-5, 5), (0, 5)]))
def test_the_minimum_is_that_of_all_labellings(seed: int, nodes: int, edges: int, weights: tuple[int, int]) -> None:
    energy = quadratic_energy(seed, nodes, edges, *weights)
    for cut in (sparse_cut, SOLVERS["pymaxflow"].sparse):
        found = minimise(energy, cut)
        assert energy.of(found.labels) == least(energy) and found.gap == 0


@compiled_only
@drawn(30, seed=st.integers(0, 9999))
def test_the_gap_bounds_what_local_search_misses(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(qpbo, "COMPONENT_LIMIT", 0)
    energy = quadratic_energy(seed, 10, 30, -5, 5)
    found = minimise(energy)
    assert 0 <= energy.of(found.labels) - least(energy) <= found.gap
