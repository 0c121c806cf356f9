"""Quadratic binary energies: by enumeration, persistency, the bound."""

from __future__ import annotations

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.graphcut import qpbo
from stseg.graphcut.qpbo import QuadraticEnergy, minimise
from stseg.graphcut.solvers import SOLVERS
from stseg.graphcut.sparse import sparse_cut


def random_energy(seed: int, nodes: int, edges: int, low: int, high: int) -> QuadraticEnergy:
    rng = np.random.default_rng(seed)
    start, end = rng.integers(0, nodes, (2, edges))
    kept = start != end
    weight = rng.integers(low, high + 1, edges)
    return QuadraticEnergy(rng.integers(-6, 7, nodes), start[kept], end[kept], weight[kept])


def least(energy: QuadraticEnergy) -> int:
    return min(energy.of(np.array(labels)) for labels in product((False, True), repeat=len(energy.unary)))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 9999), st.integers(1, 9), st.integers(0, 20), st.sampled_from([(-5, 0), (-5, 5), (0, 5)]))
def test_the_minimum_is_that_of_all_labellings(seed: int, nodes: int, edges: int, weights: tuple[int, int]) -> None:
    energy = random_energy(seed, nodes, edges, *weights)
    for cut in (sparse_cut, SOLVERS["pymaxflow"].sparse):
        found = minimise(energy, cut)
        assert energy.of(found.labels) == least(energy)
        assert found.gap == 0
    if weights[1] == 0:
        assert found.undecided == 0


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 9999))
def test_the_gap_bounds_what_local_search_misses(seed: int) -> None:
    energy = random_energy(seed, 10, 30, -5, 5)
    kept, qpbo.ENUMERATION_LIMIT = qpbo.ENUMERATION_LIMIT, 0
    try:
        found = minimise(energy)
    finally:
        qpbo.ENUMERATION_LIMIT = kept
    missed = energy.of(found.labels) - least(energy)
    assert 0 <= missed <= found.gap


def test_no_variables() -> None:
    none = np.zeros(0, np.int64)
    assert len(minimise(QuadraticEnergy(none, none, none, none)).labels) == 0
