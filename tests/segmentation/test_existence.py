"""Existence over a window: gaps are bridged, ghosts that never continue go, one body is one candidate."""

from dataclasses import replace
from itertools import product
from unittest.mock import Mock

import numpy as np
import pytest
from checks import cases, drawn, frozen
from hypothesis import strategies as st
from scenes import room
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

from stseg.arrays import Floats, Ints
from stseg.config import Config
from stseg.graphcut.sparse import sparse_cut
from stseg.records.border import Border
from stseg.segmentation import paths as paths_module
from stseg.segmentation.candidate_links import LinkModel, WindowCandidates
from stseg.segmentation.existence import Existence, ExistenceModel
from stseg.segmentation.paths import best_paths, path_marginals
from stseg.trackers.window_existence import tracks_of

CONFIG = Config()
RIG = room()
LINKS = LinkModel(RIG.frame_rate, 1.0, CONFIG.detection.prior_log_odds, CONFIG.motion, CONFIG.body)
MODEL = ExistenceModel(LINKS, 0.4, Border.of(RIG), CONFIG.detection, CONFIG.body)
WALK = np.column_stack([np.linspace(-0.6, 0.6, 9), np.zeros(9)])


def candidates(*rows: tuple[int, float, float, float, int]) -> WindowCandidates:
    """Rows of frame, x, y, evidence of the views, track."""
    table = np.array(sorted(rows))
    n = len(table)
    covariance = np.tile(np.eye(2) * 0.05**2, (n, 1, 1))
    frame, track = table[:, 0].astype(np.int64), table[:, 4].astype(np.int64)
    return WindowCandidates(len(WALK), frame, table[:, 1:3], covariance, np.full(n, 1.7), table[:, 3], track)


def decide(found: WindowCandidates) -> Existence:
    return MODEL.decide(found, sparse_cut)


def walk(evidence: Floats, track: int = 1, off: float = 0.0) -> list[tuple[int, float, float, float, int]]:
    """A person who crosses the room, with the evidence of each frame; rejected where it is below 5 nats."""
    return [(t, x, y + off, e, track * (e > 5)) for t, ((x, y), e) in enumerate(zip(WALK, evidence, strict=True))]


@cases()
def test_who_stays_and_who_goes(evidence: list[float], other: list[list[float]], gone: int) -> None:
    found = candidates(*walk(np.array(evidence)), *frozen(other))
    real = decide(found).real
    assert real[(found.track < 2) & (found.evidence > 0)].all() and (~real).sum() == gone


def test_rejected_candidates_alone_are_nobody() -> None:
    found = candidates(*walk(np.full(9, 7.0), track=0), *walk(np.full(9, 9.0), off=1.0))
    decision = decide(found)
    assert decision.real.all()
    assert (tracks_of(found, decision, np.ones(18, bool)) == found.track).all()
    none, numbers = np.zeros(0), np.zeros(0, np.int64)
    empty = WindowCandidates(9, numbers, np.zeros((0, 2)), np.zeros((0, 2, 2)), none, none, numbers)
    assert len(decide(empty).real) == 0
    found = replace(candidates(*walk(np.full(9, 3.0), off=0.1)), height=np.full(9, 1.05))
    assert decide(found).real.all()


def test_only_the_last_frame_of_a_window_has_free_deaths() -> None:
    """A glimpse in the middle pays for birth and death, though nothing is seen later; in the last frame it may stay."""
    glimpse = candidates((3, 0.0, 0.0, 12.0, 1))
    assert not decide(glimpse).real.any() and decide(replace(glimpse, frames=4)).real.all()


def test_candidates_are_added_in_paths_one_for_a_body() -> None:
    weak = np.array([12.0, 12.0, 3.0, 3.0, 3.0, 3.0, 3.0, 12.0, 12.0])
    double = [(t, x, 0.2, 2.0, 0) for t, (x, _) in enumerate(WALK) if 2 <= t <= 6]
    found = candidates(*walk(weak), *double)
    decision = decide(found)
    assert np.bincount(found.frame[decision.real]).tolist() == [1] * 9
    assert (found.ground[decision.real, 1] == 0).all()
    weak = np.array([3.0, 3.0, 12.0, 12.0, 3.0, 12.0, 12.0, 3.0, 3.0])
    found = candidates(*walk(weak))
    decision = decide(found)
    assert decision.real.all() and (decision.log_odds > 3).all()
    doubtful = replace(decision, log_odds=np.full(9, 2.9))
    for one, inside, before in ((doubtful, True, 1), (doubtful, False, 0), (decision, False, 1)):
        assert tracks_of(found, one, np.full(9, inside)).tolist() == [before] * 2 + [1] * 5 + [0] * 2


def greatest_gain(gain: Floats, start: Ints, end: Ints, bonus: Floats) -> float:
    """Greatest total over all sets of links that form paths, by trying all."""
    best = 0.0
    for chosen in range(1 << len(start)):
        links = [k for k in range(len(start)) if chosen >> k & 1]
        if len({start[k] for k in links}) < len(links) or len({end[k] for k in links}) < len(links):
            continue
        joined = {*start[links].tolist(), *end[links].tolist()}
        alone = sum(max(g, 0.0) for i, g in enumerate(gain.tolist()) if i not in joined)
        best = max(best, alone + sum(gain[i] for i in joined) + float(bonus[links].sum()))
    return best


@drawn(40, st.integers(0, 9999))
def test_paths_are_those_of_greatest_gain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gain = rng.uniform(-4, 2, 6)
    pairs = np.array([(i, j) for i in range(6) for j in range(i + 1, 6) if rng.random() < 0.5]).reshape(-1, 2)
    start, end = pairs.astype(np.int64).T
    bonus = rng.uniform(0, 4, len(start))
    successor = best_paths(gain, start, end, bonus)
    chosen = successor[start] == end
    joined = np.unique(np.concatenate([start[chosen], end[chosen]]))
    alone = np.setdiff1d(np.arange(6), joined)
    total = gain[joined].sum() + bonus[chosen].sum() + gain[alone].clip(0).sum()
    np.testing.assert_allclose(total, greatest_gain(gain, start, end, bonus), atol=1e-9)


@drawn(30, st.integers(0, 9999))
def test_marginals_are_those_of_all_labellings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gain, bonus = rng.uniform(-3, 3, 5), rng.uniform(0, 3, 3)
    start, end = np.array([0, 1, 3]), np.array([1, 2, 4])  # two paths
    choices = np.array(list(product((0, 1), repeat=5)))
    weight = np.exp(choices @ gain + (choices[:, start] * choices[:, end]) @ bonus)
    share = (weight[:, None] * choices).sum(0) / weight.sum()
    np.testing.assert_allclose(path_marginals(gain, start, end, bonus), np.log(share / (1 - share)), atol=1e-9)


def test_paths_are_matched_by_whole_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """By rounded sums the matching of scipy 1.17 did not end: of a film by three cameras, with 681 candidates."""
    matching = Mock(side_effect=min_weight_full_bipartite_matching)
    monkeypatch.setattr(paths_module, "min_weight_full_bipartite_matching", matching)
    rng = np.random.default_rng(5)
    best_paths(rng.normal(size=6), np.array([0, 0, 1, 3]), np.array([1, 2, 3, 5]), rng.random(4))
    ((table,), _) = matching.call_args
    assert np.array_equal(table.data, np.rint(table.data)) and table.data.min() >= 1
