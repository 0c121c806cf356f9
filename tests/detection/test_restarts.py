"""Restarts of the search: people whose boxes a followed ghost holds are found, and no set becomes less likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, boxes, expecting, likelihoods, people, room

from stseg.arrays import Boxes, Floats, Ints
from stseg.detection.detector import Detector
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.prior import Prior
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.refined_people import refined_members
from stseg.detection.search.restarts import restarted
from stseg.evaluation.matching import distances, match
from stseg.records.predicted_tracks import PredictedTracks


@cache
def detector() -> Detector:
    return Detector(room(), ["boxes"] * 4, FEW_HEIGHTS, BODY)


def standing_apart(rng: np.random.Generator, number: int, least: float) -> Floats:
    standing = list[Floats]()
    while len(standing) < number:
        place = rng.uniform(-1.6, 1.6, 2)
        if all(np.hypot(*(place - other)) > least for other in standing):
            standing.append(place)
    return np.array(standing)


def astray(rng: np.random.Generator, ground: Floats) -> PredictedTracks:
    """Tracks of people, the first three beside where they stand."""
    expected = ground.copy()
    expected[:3] += rng.normal(0, 0.6, (3, 2))
    return expecting(*expected.clip(-1.7, 1.7))


def crowd(seed: int) -> tuple[Floats, list[Boxes], PredictedTracks]:
    """Eight people, three boxes in four of each, and tracks of which three went astray."""
    rng = np.random.default_rng(seed)
    ground = standing_apart(rng, 8, 0.4)
    seen = [boxes(camera, people(*ground)) for camera in room().cameras]
    seen = [found.of(rng.random(len(found)) > 0.25) for found in seen]
    return ground, seen, astray(rng, ground)


def of_tracks(seen: Sequence[Boxes | None], expected: PredictedTracks) -> MapEstimate:
    """The best set of the predicted tracks alone."""
    asked = detector()
    prior = Prior.of(expected, asked.config, asked.body, asked.border)
    evidence = asked.evidence(asked.observe(seen), prior)
    return MapEstimate.of_search(evidence, prior.pool(), np.arange(len(expected)))


@pytest.mark.parametrize("seed", [9, 19, 31])
def test_people_whose_boxes_a_followed_ghost_holds_are_found(seed: int) -> None:
    ground, seen, expected = crowd(seed)
    found = detector().explain(seen, expected).people
    assert len(found) == len(ground)
    assert len(match(distances(ground, found.ground), 0.3)[0]) == len(ground)


@pytest.mark.parametrize("seed", [8, 31, 37])
def test_key_frames_of_two_views_leave_the_set_into_which_tracks_lead(seed: int) -> None:
    rng, rig = np.random.default_rng(seed), replace(room(), cameras=room().cameras[:2])
    ground = standing_apart(rng, 5, 0.5)
    expected = astray(rng, ground)
    seen = likelihoods(rig.cameras, people(*ground))
    asked, hits = Detector(rig, ["pixels"] * 2, FEW_HEIGHTS, BODY), []
    for frame in range(2):  # the first is a key frame
        found = asked.explain_next(asked.new_estimates(), frame, seen, expected).people
        hits.append(len(match(distances(ground, found.ground), 0.3)[0]))
    assert hits[0] == len(ground) > hits[1]


@pytest.mark.parametrize("seed", range(6))
def test_no_set_becomes_less_likely(seed: int) -> None:
    _, seen, expected = crowd(seed)
    before = of_tracks(seen, expected)
    after = restarted(before, detector().lattice_ground)
    assert after.members_score.total >= before.members_score.total


def box_tables(estimate: MapEstimate) -> list[Floats | Ints]:
    boxes = estimate.problem.boxes
    return [boxes.match, boxes.boxes, *boxes.hiders, boxes.inside, boxes.visible_past]


@pytest.mark.parametrize("seed", range(3))
def test_more_candidates_have_the_evidence_of_a_pool_that_is_made_whole(seed: int) -> None:
    _, seen, expected = crowd(seed)
    shown: list[Boxes | None] = [seen[0], None, *seen[2:]]
    before = of_tracks(shown, expected)
    nobody = before.with_members(before.members[:0])
    fresh = lattice_candidates(nobody, detector().lattice_ground)
    found = before.with_more(fresh.at([0])).with_more(fresh)
    whole = MapEstimate.of_search(before.evidence, found.pool, before.members)
    assert len(found.pool) == len(before.pool) + 1 + len(fresh) > len(before.pool) + 2
    np.testing.assert_array_equal(found.members, before.members)
    for table, made_whole in zip(box_tables(found), box_tables(whole), strict=True):
        np.testing.assert_array_equal(table, made_whole)
    np.testing.assert_array_equal(found.problem.track_gain, whole.problem.track_gain)
    searched = before.searched_with(fresh, before.members)
    np.testing.assert_array_equal(
        searched.members, MapEstimate.of_search(before.evidence, searched.pool, before.members).members
    )


@pytest.mark.parametrize("seed", range(3))
def test_refined_places_are_those_of_a_frame_in_which_none_is_known(seed: int) -> None:
    """Members who take other boxes, since others are gone, are not where they were."""
    _, seen, expected = crowd(seed)
    estimate = of_tracks(seen, expected)
    refined_members(estimate)
    for one in (estimate, estimate.with_members(estimate.members[::2])):
        anew = replace(one, evidence=replace(one.evidence))
        found, by_itself = refined_members(one), refined_members(anew)
        np.testing.assert_array_equal(found.pool.ground, by_itself.pool.ground)
        np.testing.assert_array_equal(found.covariance, by_itself.covariance)


def test_more_candidates_have_the_pixels_of_a_pool_that_is_made_whole() -> None:
    ground = standing_apart(np.random.default_rng(3), 5, 0.5)
    asked = Detector(room(), ["pixels"] * 4, FEW_HEIGHTS, BODY)
    prior = Prior.of(expecting(*ground[:2]), asked.config, asked.body, asked.border)
    seen = asked.observe(likelihoods(room().cameras, people(*ground)))
    before = MapEstimate.of_search(asked.evidence(seen, prior), prior.pool(), np.arange(2))
    fresh = lattice_candidates(before, asked.lattice_ground)
    found = before.with_more(fresh.at([0])).with_more(fresh.at([1])).problem
    whole = MapEstimate.of_search(before.evidence, before.pool.joined_with(fresh.at([0, 1])), before.members).problem
    for table, made_whole in zip(found.pixels, whole.pixels, strict=True):
        np.testing.assert_array_equal(table, made_whole)
    for name in ("size_prior", "birth_cost", "track_gain", "ground", "breadth"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
    assert len(found.ground) == 4


def test_sure_members_are_not_sought_again() -> None:
    seen = [boxes(camera, people((-1, -1), (1, 1))) for camera in room().cameras]
    before = of_tracks(seen, expecting((-1, -1), (1, 1)))
    assert (before.losses > 12).all()
    assert restarted(before, detector().lattice_ground) is before
