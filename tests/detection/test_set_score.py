"""Score of a set by definition, and gains of a set's state: the differences of scores."""

from __future__ import annotations

import numpy as np
import pytest
import reference_core as reference
from crafted_frames import PARAMETERS, hiders_of_cover, in_rooms, random_frame, scaled, two_births
from reference_core import best_pairs
from scipy.optimize import linear_sum_assignment

from stseg.bodies.outlines import paint_outlines
from stseg.detection.problem import BoxEvidence, PixelEvidence
from stseg.detection.score.box_state import clear_cache
from stseg.detection.score.scoring import box_score, fill_box_assignment, fill_set_scores, pixel_score, set_score
from stseg.detection.score.set_state import (
    SetState,
    add,
    assign_pixels_and_tracks,
    changed,
    gain,
    put,
    release,
    set_state,
    withdraw,
)
from stseg.detection.score.track_state import assign_track, track_gain, track_state


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
def test_sets_are_scored_as_each_by_itself(seed: int) -> None:
    frame = scaled(random_frame(seed, 6, 3))
    sets = np.array([[0, 1, 2], [5, 3, 0], [4, 2, 5]])
    totals, evidence, tracks = np.empty(3), np.empty((3, 4, 3)), np.empty((3, 3), np.int64)
    fill_set_scores(sets, frame.problem(), totals, evidence, tracks)
    for s, members in enumerate(sets):
        problem = frame.problem()
        assert totals[s] == set_score(members, 3, problem)
        np.testing.assert_array_equal(evidence[s], problem.view_evidence[:, :3])
        gains = frame.birth_cost[members, None] + frame.track_gain[members]
        pairs = [(a, track) for a, track in enumerate(tracks[s]) if track >= 0]
        best = sum(gains[pair] for pair in best_pairs(gains))
        assert sum(gains[pair] for pair in pairs) == pytest.approx(best)


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


def test_a_box_is_evidence_for_one_person() -> None:
    cover = np.zeros((1, 2, 2))
    boxes = BoxEvidence(np.zeros((1, 2, 1)), np.array([1]), hiders_of_cover(cover), np.ones((1, 2)), np.ones(2))
    pixels = random_frame(0, 2).pixels
    frame = two_births(boxes, pixels._replace(raster=np.zeros_like(pixels.raster)))
    assert frame.score([0]) - frame.score([]) == pytest.approx(PARAMETERS.prior_log_odds + PARAMETERS.box_log_ratio)
    missing = PARAMETERS.prior_log_odds + np.log(PARAMETERS.box_miss_rate)
    assert frame.score([0, 1]) - frame.score([0]) == pytest.approx(missing)


def test_a_pixel_belongs_to_the_nearest_body() -> None:
    spans = np.array([[[[0, 4]], [[2, 6]]]], np.int16)
    raster = np.array([[[1, 1, 1, 1, -5, -5]]], np.float32)
    first, area, distance = np.zeros((1, 2), np.int64), np.full((1, 2), 4.0), np.array([[3.0, 2.0]])
    frame = two_births(None, PixelEvidence(raster, np.zeros_like(raster), first, spans, area, distance))
    prior, weight = PARAMETERS.prior_log_odds, PARAMETERS.effective_observations
    nearest = prior + weight * (1 + 1 - 5 - 5) / 4
    assert frame.score([1]) == pytest.approx(nearest)
    assert frame.score([0, 1]) == pytest.approx(nearest + prior + weight * (1 + 1) / 4)


def test_pixels_weigh_no_more_than_in_the_largest_body() -> None:
    """A small far body in the head of a near one: two of eight pixels are a quarter of the near one's evidence."""
    spans = np.array([[[[0, 8]], [[0, 2]]]], np.int16)
    raster, scale = np.ones((1, 1, 8), np.float32), np.full((1, 1, 8), 8.0, np.float32)
    first, area, distance = np.zeros((1, 2), np.int64), np.array([[8.0, 2.0]]), np.array([[2.0, 6.0]])
    frame = two_births(None, PixelEvidence(raster, scale, first, spans, area, distance))
    evidence = [frame.score([i]) - PARAMETERS.prior_log_odds for i in range(2)]
    assert evidence == pytest.approx([PARAMETERS.effective_observations, PARAMETERS.effective_observations / 4])


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


# The state of a set


def assert_nearest_own_pixels(state: SetState) -> None:
    """Assert that each pixel is assigned to the nearest member that covers it."""
    pixels = state.problem.pixels
    for view, owner in enumerate(state.problem.owner.reshape(pixels.raster.shape)):
        nearest = np.full(owner.shape, -1)
        for j in sorted(state.members[: state.size[0]], key=lambda j: -pixels.distance[view, j]):
            nearest[reference.covered(pixels, view, j)] = j
        np.testing.assert_array_equal(owner, nearest)


@pytest.mark.parametrize("tracks", [0, 3])
@pytest.mark.parametrize("seed", range(20))
def test_gains_are_differences_of_scores(seed: int, tracks: int) -> None:
    """Members come and go: each gain is that of the plain score, cached or not, and for a member that is put back."""
    frame = scaled(in_rooms(random_frame(seed, 8, tracks), 4) if seed % 2 else random_frame(seed, 8, tracks))
    state, rng, cached = set_state(frame.problem()), np.random.default_rng(seed), 0
    clear_cache(state.boxes)
    assign_pixels_and_tracks(state)
    for moved in rng.integers(0, 8, 14).tolist():
        cached += int(state.boxes.is_cached.sum())
        if state.inside[moved]:
            withdraw(int(np.flatnonzero(state.members[: state.size[0]] == moved)[0]), state)
            changed(moved, state)
        else:
            add(moved, state)
        members = state.members[: state.size[0]].copy()
        assert sorted(members.tolist()) == np.flatnonzero(state.inside).tolist()
        assert_nearest_own_pixels(state)
        score = frame.score(members)
        for i in np.flatnonzero(~state.inside).tolist():
            expected = pytest.approx(frame.score([*members, i]) - score, abs=1e-9)
            assert gain(i, state, True) == expected
            assert gain(i, state, False) == expected
        for place, i in enumerate(members.tolist()):
            assert withdraw(place, state) == i
            assert gain(i, state, True) == pytest.approx(score - frame.score(np.delete(members, place)), abs=1e-9)
            put(i, place, state)
            np.testing.assert_array_equal(state.members[: len(members)], members)
    assert cached > 0
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
