"""Search of the best set: by trying all sets, by single moves, and group by group."""

from __future__ import annotations

import numpy as np
import pytest
import reference_core as reference
from crafted_frames import in_rooms, random_frame

from stseg.detection.score.set_state import set_state
from stseg.detection.search.best_set import ENUMERATION_LIMIT
from stseg.detection.search.groups import fill_groups, fill_interactions


@pytest.mark.parametrize("tracks", [0, 4])
@pytest.mark.parametrize("seed", range(40))
def test_no_single_move_helps(seed: int, tracks: int) -> None:
    frame = random_frame(seed, 10, tracks)
    start = [] if seed % 2 else [0, 3]
    members = frame.best_set(start)
    assert len(set(members)) == len(members)
    score = frame.score(members) + 1e-6
    assert score >= frame.score(start)
    others = [i for i in range(10) if i not in members]
    for leaving in members:
        without = [i for i in members if i != leaving]
        assert score >= frame.score(without)
        rivals = [i for i in others if np.hypot(*(frame.ground[i] - frame.ground[leaving])) <= 0.7]
        assert all(score >= frame.score([*without, i]) for i in rivals)
    assert all(score >= frame.score([*members, i]) for i in others)


@pytest.mark.parametrize("tracks", [0, 3])
@pytest.mark.parametrize("seed", range(20))
def test_of_few_candidates_the_best_set_is_found(seed: int, tracks: int) -> None:
    frame = random_frame(seed, 7, tracks)
    best = max(frame.score(chosen) for chosen in reference.subsets(7))
    assert frame.score(frame.best_set()) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("tracks", [0, 4])
def test_of_more_candidates_swaps_find_the_best_set(tracks: int) -> None:
    """Simple moves alone, which cannot trade one person for two, miss the best of some of these crafted frames."""
    frames = [random_frame(seed, 10, tracks) for seed in range(20)]
    best = np.array([max(f.score(s) for s in reference.subsets(10)) for f in frames])
    efforts = ((0, 0), (4, ENUMERATION_LIMIT))
    simple, swapped = (np.array([f.score(f.best_set((), *effort)) for f in frames]) for effort in efforts)
    np.testing.assert_allclose(swapped, best, atol=1e-6)
    assert (simple < best - 1e-6).any()
    assert (simple > best - 2.6).all()


@pytest.mark.parametrize("seed", range(20))
def test_groups_interact_within_and_their_scores_add_up(seed: int) -> None:
    frame = in_rooms(random_frame(seed, 9, 2), 3)
    problem = frame.problem()
    interacts, group = np.empty((9, 9), bool), np.empty(9, np.int64)
    fill_interactions(set_state(problem), interacts)
    expected = [[i == j or reference.interact(i, j, problem) for j in range(9)] for i in range(9)]
    np.testing.assert_array_equal(interacts, expected)
    number = fill_groups(set_state(problem), group)
    assert number == len(set(group.tolist())) >= 3
    assert list(dict.fromkeys(group.tolist())) == list(range(number))
    assert not interacts[group[:, None] != group].any()
    rng = np.random.default_rng(seed)
    for _ in range(5):
        members = rng.permutation(9)[: rng.integers(1, 10)]
        parts = [frame.score(members[group[members] == g]) for g in range(number)]
        assert frame.score(members) == pytest.approx(sum(parts), abs=1e-5)


@pytest.mark.parametrize("seed", range(10))
def test_each_group_is_decided_by_itself(seed: int) -> None:
    """The best set of nine candidates in three groups is found, though more than can be enumerated stand there."""
    frame = in_rooms(random_frame(seed, 9), 3)
    best = max(frame.score(s) for s in reference.subsets(9))
    assert frame.score(frame.best_set()) == pytest.approx(best, abs=1e-6)
