"""Score of a set by definition, and gains of a set's state: the differences of scores."""

import numpy as np
import pytest
import reference_core as reference
from crafted_frames import PARAMETERS, CraftedFrame, in_rooms, random_frame, scaled
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats
from stseg.bodies.outlines import paint_outlines
from stseg.detection.score.gains import gain
from stseg.detection.score.moves import add, fill_gains, put, release, remove, return_to, withdraw
from stseg.detection.score.scoring import box_score, fill_box_assignment, fill_set_score, pixel_score, set_score
from stseg.detection.score.set_state import Kept, SetState, set_state
from stseg.detection.score.track_state import assign_track, release_track, track_gain, track_state
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed


@pytest.mark.parametrize("tracks", [0, 3])
@pytest.mark.parametrize("seed", range(40))
def test_score_by_definition(seed: int, tracks: int) -> None:
    frame = scaled(random_frame(seed, 6, tracks))
    rng = np.random.default_rng(seed)
    for _ in range(3):
        members = rng.permutation(6)[: rng.integers(0, 7)].tolist()
        expected = reference.set_score(members, frame.problem())
        assert frame.score(members) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_a_score_has_its_evidence_and_tracks(seed: int) -> None:
    frame, members = scaled(random_frame(seed, 6, 3)), np.array([5, 3, 0])
    evidence, tracks, problem = np.empty((4, 3)), np.empty(3, np.int64), frame.problem()
    assert fill_set_score(members, frame.problem(), evidence, tracks) == set_score(members, 3, problem)
    np.testing.assert_array_equal(evidence, problem.view_evidence[:, :3])
    gains = frame.birth_cost[members, None] + frame.track_gain[members]
    pairs = [(a, track) for a, track in enumerate(tracks) if track >= 0]
    assert sum(gains[pair] for pair in pairs) == pytest.approx(sum(gains[pair] for pair in reference.best_pairs(gains)))


@pytest.mark.parametrize("seed", range(20))
def test_candidates_add_what_larger_sets_score_more(seed: int) -> None:
    frame, members, candidates = scaled(random_frame(seed, 8, 3)), np.array([5, 3, 0]), np.arange(8)
    gains, evidence, tracks = np.empty(8), np.empty((4, 8)), np.empty(8, np.int64)
    fill_gains(members, candidates, frame.problem(), gains, evidence, tracks)
    for i in candidates:
        others = members[members != i]
        larger, before = np.append(others, i), frame.score(others)
        assert gains[i] == pytest.approx(frame.score(larger) - before, abs=1e-9)
        if i not in members:
            expected, expected_tracks = np.empty((4, 4)), np.empty(4, np.int64)
            fill_set_score(larger, frame.problem(), expected, expected_tracks)
            np.testing.assert_allclose(evidence[:, i], expected[:, -1], atol=1e-12)
            assert tracks[i] == expected_tracks[-1]


@pytest.mark.parametrize("seed", range(5))
def test_boxes_of_all_views_are_assigned_as_of_each(seed: int) -> None:
    frame, members = scaled(random_frame(seed, 6)), np.array([5, 1, 3])
    boxes = np.empty((2, 4), np.int64)
    fill_box_assignment(members, frame.problem(), boxes)
    for view in range(2):
        member_of = np.full(4, -1)
        box_score(view, members, 3, frame.boxes, PARAMETERS, member_of, np.empty(3))
        np.testing.assert_array_equal(boxes[view], member_of)
    assert (boxes >= 0).any()


@pytest.mark.parametrize("seed", range(5))
def test_painted_pixels_are_those_of_the_score(seed: int) -> None:
    frame, members = scaled(random_frame(seed, 6)), np.array([5, 1, 3])
    pixels = frame.pixels
    for view in range(len(pixels.raster)):
        owner, parts = np.full(pixels.raster[view].size, -1), np.empty(3)
        pixel_score(view, members, 3, pixels, PARAMETERS, owner, parts)
        painted = np.full(pixels.raster[view].shape, -1, np.int16)
        farthest_first = np.argsort(pixels.distance[view][members], kind="stable")[::-1].copy()
        paint_outlines(farthest_first, pixels.first[view][members], pixels.spans[view][members], painted)
        assert (painted >= 0).any()
        np.testing.assert_array_equal(painted.ravel(), owner)


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
@pytest.mark.parametrize("seed", range(20))
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


@pytest.mark.parametrize("seed", range(20))
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
