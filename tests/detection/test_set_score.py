"""Score of a set by definition, and gains of a set's state: the differences of scores."""

import numpy as np
import pytest
import reference_core as reference
from checks import examples
from crafted_frames import PARAMETERS, CraftedFrame, in_rooms, random_frame, scaled
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats, Ints
from stseg.bodies.outlines import paint_outlines
from stseg.detection.score.gains import gain
from stseg.detection.score.moves import add, fill_gains, fill_rises, put, release, remove, return_to, withdraw
from stseg.detection.score.set_state import Kept, SetState, set_state
from stseg.detection.score.track_state import assign_track, release_track, track_gain, track_state
from stseg.kernels.accelerate import COMPILED, kernel
from stseg.kernels.pointed_tuples import pointed


@pytest.mark.parametrize("tracks", [0, 3])
@pytest.mark.parametrize("seed", range(examples(40)))
def test_score_by_definition(seed: int, tracks: int) -> None:
    frame = scaled(random_frame(seed, 6, tracks))
    rng = np.random.default_rng(seed)
    for _ in range(3):
        members = rng.permutation(6)[: rng.integers(0, 7)].tolist()
        expected = reference.set_score(members, frame.problem())
        assert frame.score(members) == pytest.approx(expected, abs=1e-5)


def additions(frame: CraftedFrame, members: Ints, candidates: Ints) -> tuple[Floats, Floats, Ints, Ints]:
    """Gains, evidence, boxes and tracks of candidates in the set of the members."""
    number = len(candidates)
    gains, evidence, boxes = np.empty(number), np.empty((4, number)), np.full((4, number), -1)
    fill_gains(members, candidates, frame.problem(), gains, evidence, boxes, tracks := np.empty(number, np.int64))
    return gains, evidence, boxes, tracks


@pytest.mark.parametrize("seed", range(examples(20)))
def test_candidates_add_what_larger_sets_score_more(seed: int) -> None:
    """Each has the evidence, box and track that it has as a member."""
    frame, members, candidates = scaled(random_frame(seed, 8, 3)), np.array([5, 3, 0]), np.arange(8)
    gains, *found = additions(frame, members, candidates)
    boxes, tracks = alone = np.full((4, 8), -1), np.empty(8, np.int64)
    fill_gains(members, candidates, frame.problem(), np.empty(0), np.empty((4, 8)), boxes, tracks)
    assert all(np.array_equal(*pair) for pair in zip(alone, found[1:], strict=True))
    for i in candidates:
        others = members[members != i]
        larger, before = np.append(others, i), frame.score(others)
        assert gains[i] == pytest.approx(frame.score(larger) - before, abs=1e-9)
        for of_each, expected in zip(found, additions(frame, larger, larger)[1:], strict=True):
            np.testing.assert_allclose(of_each[..., i], expected[..., -1], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_members_have_tracks_boxes_and_the_nearest_pixels(seed: int) -> None:
    frame, members = scaled(random_frame(seed, 6, 3)), np.array([5, 3, 0, 1])
    _, evidence, boxes, tracks = additions(frame, members, members)
    gains = frame.birth_cost[members, None] + frame.track_gain[members]
    pairs = [(a, track) for a, track in enumerate(tracks) if track >= 0]
    assert sum(gains[pair] for pair in pairs) == pytest.approx(sum(gains[pair] for pair in reference.best_pairs(gains)))
    assert (boxes[:2] >= 0).any()
    for view, own in enumerate(boxes[:2]):
        match = frame.boxes.match[view, members, own]
        np.testing.assert_allclose(evidence[view][own >= 0], PARAMETERS.box_log_ratio + match[own >= 0])
        assert len(set(own[own >= 0])) == (own >= 0).sum()
    frame, members = scaled(random_frame(seed, 6)), np.array([5, 1, 3])
    pixels = frame.pixels
    for view in range(len(pixels.raster)):
        painted, nearest = np.full((2, *pixels.raster[view].shape), -1, np.int16)
        farthest_first = np.argsort(pixels.distance[view][members], kind="stable")[::-1].copy()
        paint_outlines(farthest_first, pixels.first[view][members], pixels.spans[view][members], painted)
        for a in farthest_first:
            nearest[reference.covered(pixels, view, members[a])] = a
        assert (painted >= 0).any()
        np.testing.assert_array_equal(painted, nearest)


def assert_nearest_own_pixels(state: SetState) -> None:
    """Assert that each pixel is assigned to the nearest member that covers it."""
    pixels = state.problem.pixels
    for view, owner in enumerate(state.problem.owner.reshape(pixels.raster.shape)):
        nearest = np.full(owner.shape, -1)
        for j in sorted(state.members[: state.size[0]], key=lambda j: -pixels.distance[view, j]):
            nearest[reference.covered(pixels, view, j)] = j
        np.testing.assert_array_equal(owner, nearest)


@kernel
def move(i: int, place: int, whole: SetState) -> None:
    """Remove candidate i if it is a member, else add it at a place."""
    state = pointed(whole)
    if not state.inside[i]:
        add(i, place, state)
        return
    for a in range(state.size[0] - 1, -1, -1):
        if state.members[a] == i:
            remove(a, state)


@kernel
def fill_all_gains(place: int, whole: SetState, gains: Floats) -> None:
    """Fill gains (candidate,); those of candidates outside alone while the member at a place is absent, -1 for none."""
    state = pointed(whole)
    absent = withdraw(place, state) if place >= 0 else -1
    for i in range(len(gains)):
        if absent < 0 or not (state.inside[i] or i == absent):
            gains[i] = gain(i, absent, state)
    if absent >= 0:
        put(absent, place, state)


def gains_by_score(frame: CraftedFrame, members: list[int]) -> Floats:
    """Gain of each candidate outside a set, and what each member is worth, nats."""
    others = [[j for j in members if j != i] for i in range(len(frame.birth_cost))]
    return np.array([frame.score([*rest, i]) - frame.score(rest) for i, rest in enumerate(others)])


def assert_kept_gains(state: SetState, frame: CraftedFrame) -> int:
    """Assert that gains that are kept are those of a fresh state, and these of the plain score; returns how many."""
    members, kept = state.members[: state.size[0]].tolist(), state.is_known.copy()
    fresh, gains = set_state(frame.problem()), np.empty(len(state.inside))
    for a, j in enumerate(members):
        move(j, a, fresh)
    fill_all_gains(-1, fresh, gains)
    np.testing.assert_allclose(gains, gains_by_score(frame, members), rtol=0, atol=1e-9)
    np.testing.assert_allclose(state.gains[kept], fresh.gains[kept], rtol=0, atol=1e-9)
    return int(kept.sum())


@pytest.mark.parametrize("tracks", [0, 3])
@pytest.mark.parametrize("seed", range(examples(20) if COMPILED else 1))
def test_gains_are_differences_of_scores(seed: int, tracks: int) -> None:
    """Members come and go, one in place of another, and back: the gains that are kept are those of the plain score."""
    frame = scaled(in_rooms(random_frame(seed, 8, tracks), 4) if seed % 2 else random_frame(seed, 8, tracks))
    state, rng, kept, gains = set_state(frame.problem()), np.random.default_rng(seed), 0, np.empty(8)
    for k, moved in enumerate(rng.integers(0, 8, 20).tolist()):
        if k % 5 == 0:
            before = Kept(state.kept.numbers.copy(), state.kept.values.copy(), state.kept.flags.copy())
            score = frame.score(state.members[: state.size[0]])
        move(moved, int(rng.integers(0, state.size[0] + 1)), state)
        members = state.members[: state.size[0]].tolist()
        assert sorted(members) == np.flatnonzero(state.inside).tolist()
        assert_nearest_own_pixels(state)
        assert state.total[0] == pytest.approx(frame.score(members) - frame.score([]), abs=1e-9)
        kept += assert_kept_gains(state, frame)
        fill_all_gains(-1, state, gains)
        np.testing.assert_allclose(gains, gains_by_score(frame, members), rtol=0, atol=1e-9)
        for place, absent in enumerate(members):
            fill_all_gains(place, state, gains)
            outside = ~state.inside
            expected = gains_by_score(frame, [j for j in members if j != absent])
            np.testing.assert_allclose(gains[outside], expected[outside], rtol=0, atol=1e-9)
            assert state.members[: len(members)].tolist() == members
        if k % 5 == 4:
            return_to(before, state)
            assert frame.score(state.members[: state.size[0]]) == score
            assert_nearest_own_pixels(state)
            kept += assert_kept_gains(state, frame)
    assert kept > 0
    release(state)
    assert (state.problem.owner == -1).all()


@pytest.mark.parametrize("seed", range(examples(20)))
def test_rises_of_exchanges_are_differences_of_scores(seed: int) -> None:
    frame, rng = scaled(random_frame(seed, 8, 3)), np.random.default_rng(seed)
    order, leaving, rises = rng.permutation(8), rng.random((6, 8)) < 0.4, np.empty(6)
    members, joining = order[:5], rng.choice(order[5:], 6)
    fill_rises(members, leaving, joining, frame.problem(), rises)
    after = [[*members[~left[members]], i] for left, i in zip(leaving, joining, strict=True)]
    np.testing.assert_allclose(rises, [frame.score(one) - frame.score(members) for one in after], rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(examples(20)))
def test_tracks_assigned_one_by_one_have_the_greatest_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gains, birth_cost = rng.normal(-3, 4, (7, 5)), rng.uniform(0, 5, 7)
    state, positive = track_state(gains, birth_cost), np.maximum(gains + birth_cost[:, None], 0)
    sums = [0.0]
    for i in range(7):
        added = track_gain(i, state)
        assign_track(i, state)
        sums.append(positive[: i + 1][linear_sum_assignment(-positive[: i + 1])].sum())
        assert added == pytest.approx(sums[-1] - sums[-2], abs=1e-9)
        assigned = np.flatnonzero(state.member_of >= 0)
        assert positive[state.member_of[assigned], assigned].sum() == pytest.approx(sums[-1], abs=1e-9)
        assert len(set(state.member_of[assigned].tolist())) == len(assigned)
    inside = np.ones(7, bool)
    for i in rng.permutation(7).tolist():
        inside[i] = False
        release_track(i, inside, state)
        assigned = np.flatnonzero(state.member_of >= 0)
        best = positive[inside][linear_sum_assignment(-positive[inside])].sum()
        assert inside[state.member_of[assigned]].all()
        assert positive[state.member_of[assigned], assigned].sum() == pytest.approx(best, abs=1e-9)
        assert state.member_gain[assigned].sum() == pytest.approx(best, abs=1e-9)
        assert len(set(state.member_of[assigned].tolist())) == len(assigned)
