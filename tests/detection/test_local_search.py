"""The search for the best set: exhaustively on small problems, merges and splits, and restarts."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import reference_core as reference
from checks import examples, in_ci
from crafted_frames import in_rooms, random_frame
from scenes import BODY, FEW_HEIGHTS, boxes, expecting, likelihoods, people, room

from stseg.arrays import Boxes, Floats, Ints, Singles, ViewEvidence
from stseg.bodies.outlines import outlines
from stseg.detection.detector import Detector
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.explanation import explained_frame
from stseg.detection.prior import Prior
from stseg.detection.score.set_state import set_state
from stseg.detection.search.best_set import ENUMERATION_LIMIT, GAIN_LIMIT, find_best_set
from stseg.detection.search.groups import fill_groups, mark_interacting
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.merge_moves import merged
from stseg.detection.search.refined_people import refined_members
from stseg.detection.search.restarts import restarted
from stseg.evaluation.sequence import match
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks


@pytest.mark.parametrize("tracks", [0, 4])
@pytest.mark.parametrize("seed", range(examples(40)))
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


@pytest.mark.parametrize(("number", "tracks", "rooms"), [(7, 0, 1), (7, 3, 1), (9, 0, 3)])
@pytest.mark.parametrize("seed", range(examples(20)))
def test_of_few_candidates_the_best_set_is_found(seed: int, number: int, tracks: int, rooms: int) -> None:
    """Also of nine in three groups, though more than can be enumerated stand there."""
    frame = random_frame(seed, number, tracks)
    frame = frame if rooms == 1 else in_rooms(frame, rooms)
    best = max(frame.score(chosen) for chosen in reference.subsets(number))
    assert frame.score(frame.best_set()) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("tracks", [0, 4])
def test_of_more_candidates_swaps_find_the_best_set(tracks: int) -> None:
    """Simple moves alone, which cannot trade one person for two, miss the best of some of these crafted frames."""
    frames = [random_frame(seed, 10, tracks) for seed in range(20)]
    best = np.array([max(f.score(s) for s in reference.subsets(10)) for f in frames])
    efforts = ((0, 0), (4, ENUMERATION_LIMIT))
    simple, swapped = (np.array([f.score(f.best_set((), *effort)) for f in frames]) for effort in efforts)
    np.testing.assert_allclose(swapped, best, atol=1e-6)
    assert (simple < best - 1e-6).any() and (simple > best - 2.6).all()


@pytest.mark.parametrize("limit", [0, 5, 20])
def test_a_search_that_ends_at_its_limit_loses_nothing(limit: int) -> None:
    frame, members = random_frame(3, 10, 2), np.arange(11)
    count, unfinished = find_best_set(members, 3, frame.problem(), 0, 4, limit)
    assert unfinished == 10 and frame.score(members[:count]) >= frame.score(range(3))
    assert find_best_set(np.arange(11), 3, frame.problem(), 0, 4, GAIN_LIMIT)[1] == 0


@pytest.mark.parametrize("seed", range(examples(20)))
def test_groups_interact_within_and_their_scores_add_up(seed: int) -> None:
    frame = in_rooms(random_frame(seed, 9, 2), 3)
    problem = frame.problem()
    interacts, group = np.empty((9, 9), bool), np.empty(9, np.int64)
    for i, linked in enumerate(interacts):
        mark_interacting(i, set_state(problem), linked)
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


PAIRS = [(width, distance) for width in (1.0, 1.3, 1.6) for distance in (0.3, 0.4, 0.5, 0.59)]
"""Width of a silhouette beside a common one, and distance of two members on it, metres."""


@cache
def detector(*kinds: str) -> Detector:
    return Detector(room(), kinds or ["pixels"] * 4, FEW_HEIGHTS, BODY)


def box_detector() -> Detector:
    return detector(*["boxes"] * 4)


def silhouettes(ground: Floats, width: float) -> list[Singles]:
    """Views of the room's cameras of people 1.7 m high at ground (n, 2), so wide relative to the common silhouette."""
    views = []
    for view in detector().views:
        raster = np.zeros(view.camera.size[::-1], np.float32)
        tall, wide = np.full(len(ground), 1.7), np.full(len(ground), width)
        for first, spans in zip(*outlines(view.table, ground, tall, 1, raster.shape[:2], wide)[:2], strict=True):
            for k, (start, stop) in enumerate(spans):
                raster[first + k, start:stop] = 1.0
        views.append(raster)
    return views


def estimate_of(
    own_detector: Detector, views: Sequence[ViewEvidence], predicted: PredictedTracks | None, pool: Candidates | None
) -> MapEstimate:
    """The best set of a pool, or of the predicted tracks alone."""
    prior = Prior.of(predicted, own_detector.config, own_detector.body, own_detector.border)
    evidence, pool = own_detector.evidence(own_detector.observe(views), prior), pool or prior.pool()
    return MapEstimate.of_search(evidence, pool, np.arange(len(pool)))


def pool_at(ground: Floats) -> Candidates:
    """Candidates of mean size at ground (n, 2)."""
    return Candidates(ground, np.full(len(ground), 1.7), np.full(len(ground), BODY.width_mean))


def members_at(ground: Floats, views: list[Singles]) -> MapEstimate:
    return estimate_of(detector(), views, None, pool_at(ground)).with_members(np.arange(len(ground)))


def pair(distance: float) -> Floats:
    return np.asarray(np.array([[0.1, -0.2]]) + np.array([[-0.5], [0.5]]) * distance * np.array([[0.8, 0.6]]))


@pytest.mark.parametrize("distance", [0.3, 0.36, 0.42])
def test_two_members_on_one_wide_silhouette_become_one_body(distance: float) -> None:
    before = members_at(pair(distance), silhouettes(pair(0.0)[:1], 1.5))
    after = merged(before)
    assert len(after.members) == 1
    body = after.pool.at(after.members)
    assert np.hypot(*(body.ground[0] - pair(0.0)[0])) < 0.15
    assert body.width[0] > BODY.width_mean + BODY.width_spread
    assert after.total > before.total


@pytest.mark.parametrize("distance", [0.45, 0.5, 0.55])
def test_two_people_side_by_side_stay_two(distance: float) -> None:
    before = members_at(pair(distance), silhouettes(pair(distance), 1.0))
    np.testing.assert_array_equal(merged(before).members, before.members)


def test_two_half_a_metre_apart_are_two_within_the_hard_core() -> None:
    standing = np.column_stack([pair(0.5), [1.7, 1.7]])
    found = detector().explain(likelihoods(room().cameras, standing), None).people.ground
    assert len(found) == 2
    away = np.hypot(*np.moveaxis(standing[:, None, :2] - found, -1, 0))
    assert away.min(0).max() < 0.12 and away.min(1).max() < 0.12
    core = FEW_HEIGHTS.minimum_distance - 0.05
    assert detector().parameters.hard_core == pytest.approx(core)
    assert detector("pixels", "boxes", "boxes", "boxes").parameters.hard_core == pytest.approx(core)
    assert detector(*["boxes"] * 4).parameters.hard_core == 0.0


def test_third_far_and_boxed_members_are_no_part_of_a_merge() -> None:
    ground = np.concatenate([pair(0.3), [[1.2, 1.0]]])
    views = [
        np.maximum(*both) for both in zip(silhouettes(ground[2:], 1.0), silhouettes(pair(0.0)[:1], 1.5), strict=True)
    ]
    after = merged(members_at(ground, views))
    assert len(after.members) == 2 and 2 in after.members
    far = members_at(pair(0.7), silhouettes(pair(0.7), 1.0))
    assert merged(far) is far
    seen = [boxes(camera, people(*pair(0.5))) for camera in room().cameras]
    close_pair = estimate_of(box_detector(), seen, None, pool_at(pair(0.5)))
    assert len(close_pair.members) == 2 and merged(close_pair) is close_pair


@pytest.mark.parametrize(("width", "distance"), PAIRS)
def test_a_merge_is_the_better_of_both_sets_by_the_plain_score(width: float, distance: float) -> None:
    before = members_at(pair(distance), silhouettes(pair(0.0)[:1], width))
    after = merged(before)
    leading = before.members_score.view_evidence.sum(0).argmax()
    alone = refined_members(before.with_members(before.members[[leading]])).pool
    np.testing.assert_array_equal(after.pool.ground[2], alone.ground[0])
    sets = ([0, 1], [2], [3])  # both; one at the leading member's place; one between them
    scores = [reference.set_score(members, after.problem) for members in sets]
    assert after.members.tolist() == sets[int(np.argmax(scores))]
    assert after.total == pytest.approx(max(scores), abs=1e-3)


def nearest_pair(ground: Floats) -> float:
    """Distance of the two nearest of some places, metres; infinite for fewer than two."""
    distance = np.hypot(*np.moveaxis(ground[:, None] - ground, -1, 0)) + np.diag(np.full(len(ground), np.inf))
    return float(distance.min(initial=np.inf))


def crowd(seed: int) -> Floats:
    """Six people about the middle of the room, some nearer to each other than bodies are wide."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-0.8, 0.8, (6, 2)), rng.uniform(1.6, 1.8, 6)])


def twins(standing: Floats) -> PredictedTracks:
    doubled = np.repeat(standing, 2, axis=0)
    doubled[::2, 0] -= 0.08
    doubled[1::2, 0] += 0.08
    return expecting(*doubled)


def crowded(kinds: Sequence[str], seed: int) -> Iterator[tuple[Sequence[ViewEvidence], PredictedTracks | None]]:
    """A crowd in silhouettes that are too wide and in boxes: in a first frame, and with two tracks on each person."""
    standing = crowd(seed)
    shown, wider = likelihoods(room().cameras, standing), np.ones((5, 5), np.uint8)
    masks = [np.asarray(cv2.dilate(raster, wider), np.float32) for raster in shown]
    views: list[ViewEvidence] = [
        mask if kind == "pixels" else boxes(camera, standing)
        for kind, mask, camera in zip(kinds, masks, room().cameras, strict=True)
    ]
    yield views, None
    yield views, twins(standing)


@pytest.mark.parametrize("observations", [4.0, 40.0])
@pytest.mark.parametrize("kinds", [["pixels"] * 4, ["pixels", "boxes"] * 2], ids=["pixels", "mixed"])
@pytest.mark.parametrize("seed", [0, 1, *in_ci(*range(2, 6))])
def test_no_two_members_or_refined_places_are_within_the_core(
    observations: float, kinds: list[str], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Each view speaks for ten views in the second case, which outvote any cost of crowding but the core.
    own_detector = Detector(room(), kinds, replace(FEW_HEIGHTS, effective_observations=observations), BODY)
    final: list[Floats] = []

    def recorded_explanation(estimate: MapEstimate) -> Explanation:
        final.append(estimate.pool.ground[estimate.members])
        return explained_frame(estimate)

    monkeypatch.setattr("stseg.detection.detector.explained_frame", recorded_explanation)
    refined = [own_detector.explain(views, predicted).people.ground for views, predicted in crowded(kinds, seed)]
    assert len(final) == 2
    for ground in [*final, *refined]:
        assert len(ground) > 2 and nearest_pair(ground) >= own_detector.parameters.hard_core


def separate_places(rng: np.random.Generator, number: int, least: float) -> Floats:
    standing = list[Floats]()
    while len(standing) < number:
        place = rng.uniform(-1.6, 1.6, 2)
        if all(np.hypot(*(place - other)) > least for other in standing):
            standing.append(place)
    return np.array(standing)


def misplaced_tracks(rng: np.random.Generator, ground: Floats) -> PredictedTracks:
    """Tracks of people, the first three beside where they stand."""
    predicted = ground.copy()
    predicted[:3] += rng.normal(0, 0.6, (3, 2))
    return expecting(*predicted.clip(-1.7, 1.7))


def box_crowd(seed: int) -> tuple[Floats, list[Boxes], PredictedTracks]:
    """Eight people, three boxes in four of each, and tracks of which three went astray."""
    rng = np.random.default_rng(seed)
    ground = separate_places(rng, 8, 0.4)
    views = [boxes(camera, people(*ground)) for camera in room().cameras]
    views = [found.of(rng.random(len(found)) > 0.25) for found in views]
    return ground, views, misplaced_tracks(rng, ground)


def of_tracks(views: Sequence[Boxes | None], predicted: PredictedTracks) -> MapEstimate:
    return estimate_of(box_detector(), views, predicted, None)


@pytest.mark.parametrize("seed", [9, 19, 31])
def test_people_are_found_whose_boxes_a_ghost_holds(seed: int) -> None:
    ground, views, predicted = box_crowd(seed)
    found = box_detector().explain(views, predicted).people
    assert len(found) == len(ground) and len(match(distances(ground, found.ground), 0.3)[0]) == len(ground)


@pytest.mark.parametrize("seed", [8, 31, 37])
def test_key_frames_leave_the_set_of_misplaced_tracks(seed: int) -> None:
    rng, rig = np.random.default_rng(seed), replace(room(), cameras=room().cameras[:2])
    ground = separate_places(rng, 5, 0.5)
    predicted = misplaced_tracks(rng, ground)
    views = likelihoods(rig.cameras, people(*ground))
    rig_detector, hits = Detector(rig, ["pixels"] * 2, FEW_HEIGHTS, BODY), []
    for frame in range(2):  # the first is a key frame
        found = rig_detector.explain_next(rig_detector.new_estimates(), frame, views, predicted).people
        hits.append(len(match(distances(ground, found.ground), 0.3)[0]))
    assert hits[0] == len(ground) > hits[1]


@pytest.mark.parametrize("seed", range(6))
def test_no_set_becomes_less_likely(seed: int) -> None:
    _, views, predicted = box_crowd(seed)
    before = of_tracks(views, predicted)
    after = restarted(before, box_detector().lattice_ground, 3)
    assert after.total >= before.total


def box_tables(estimate: MapEstimate) -> list[Floats | Ints]:
    boxes = estimate.problem.boxes
    return [boxes.match, boxes.boxes, *boxes.occluders, boxes.inside]


@pytest.mark.parametrize("seed", range(3))
def test_boxes_and_places_are_those_of_the_pool_without_cache(seed: int) -> None:
    _, views, predicted = box_crowd(seed)
    partly_blind: list[Boxes | None] = [views[0], None, *views[2:]]
    before = of_tracks(partly_blind, predicted)
    empty_set = before.with_members(before.members[:0])
    peaks = lattice_candidates(empty_set, box_detector().lattice_ground)
    found = before.with_more(peaks.at([0])).with_more(peaks)
    whole = MapEstimate.of_search(before.evidence, found.pool, before.members)
    assert len(found.pool) == len(before.pool) + 1 + len(peaks) > len(before.pool) + 2
    np.testing.assert_array_equal(found.members, before.members)
    for table, made_whole in zip(box_tables(found), box_tables(whole), strict=True):
        np.testing.assert_array_equal(table, made_whole)
    np.testing.assert_array_equal(found.problem.track_gain, whole.problem.track_gain)
    searched = before.searched_with(peaks, before.members)
    again = MapEstimate.of_search(before.evidence, searched.pool, before.members)
    np.testing.assert_array_equal(searched.members, again.members)
    # Members who take other boxes, since others are gone, are not where they were.
    estimate = of_tracks(views, predicted)
    refined_members(estimate)
    for one in (estimate, estimate.with_members(estimate.members[::2].copy())):
        anew = replace(one, evidence=replace(one.evidence))
        kept, by_itself = refined_members(one), refined_members(anew)
        np.testing.assert_array_equal(kept.pool.ground, by_itself.pool.ground)
        np.testing.assert_array_equal(kept.covariance, by_itself.covariance)


def test_more_candidates_have_the_pixels_of_a_whole_pool() -> None:
    ground = separate_places(np.random.default_rng(3), 5, 0.5)
    before = estimate_of(detector(), likelihoods(room().cameras, people(*ground)), expecting(*ground[:2]), None)
    peaks = lattice_candidates(before, detector().lattice_ground)
    found = before.with_more(peaks.at([0])).with_more(peaks.at([1])).problem
    whole = MapEstimate.of_search(before.evidence, before.pool.joined_with(peaks.at([0, 1])), before.members).problem
    tables = [[*problem.pixels[:-1], *problem.pixels.overlapping] for problem in (found, whole)]
    for table, made_whole in zip(*tables, strict=True):
        np.testing.assert_array_equal(table, made_whole)
    for name in ("size_prior", "birth_cost", "track_gain", "ground", "breadth"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
    assert len(found.ground) == 4


def test_strong_members_are_not_searched_again() -> None:
    views = [boxes(camera, people((-1, -1), (1, 1))) for camera in room().cameras]
    before = of_tracks(views, expecting((-1, -1), (1, 1)))
    assert (before.losses > 12).all() and restarted(before, box_detector().lattice_ground, 3) is before
