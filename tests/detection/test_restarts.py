"""Restarts of the search: people are found though a ghost holds their boxes, and no score falls."""

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


def crowd(seed: int) -> tuple[Floats, list[Boxes], PredictedTracks]:
    """Eight people, three boxes in four of each, and tracks of which three went astray."""
    rng = np.random.default_rng(seed)
    ground = separate_places(rng, 8, 0.4)
    views = [boxes(camera, people(*ground)) for camera in room().cameras]
    views = [found.of(rng.random(len(found)) > 0.25) for found in views]
    return ground, views, misplaced_tracks(rng, ground)


def of_tracks(views: Sequence[Boxes | None], predicted: PredictedTracks) -> MapEstimate:
    """The best set of the predicted tracks alone."""
    rig_detector = detector()
    prior = Prior.of(predicted, rig_detector.config, rig_detector.body, rig_detector.border)
    evidence = rig_detector.evidence(rig_detector.observe(views), prior)
    return MapEstimate.of_search(evidence, prior.pool(), np.arange(len(predicted)))


@pytest.mark.parametrize("seed", [9, 19, 31])
def test_people_are_found_whose_boxes_a_ghost_holds(seed: int) -> None:
    ground, views, predicted = crowd(seed)
    found = detector().explain(views, predicted).people
    assert len(found) == len(ground)
    assert len(match(distances(ground, found.ground), 0.3)[0]) == len(ground)


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
    _, views, predicted = crowd(seed)
    before = of_tracks(views, predicted)
    after = restarted(before, detector().lattice_ground)
    assert after.members_score.total >= before.members_score.total


def box_tables(estimate: MapEstimate) -> list[Floats | Ints]:
    boxes = estimate.problem.boxes
    return [boxes.match, boxes.boxes, *boxes.hiders, boxes.inside, boxes.visible_past]


@pytest.mark.parametrize("seed", range(3))
def test_more_candidates_have_the_boxes_of_a_whole_pool(seed: int) -> None:
    _, views, predicted = crowd(seed)
    partly_blind: list[Boxes | None] = [views[0], None, *views[2:]]
    before = of_tracks(partly_blind, predicted)
    empty_set = before.with_members(before.members[:0])
    peaks = lattice_candidates(empty_set, detector().lattice_ground)
    found = before.with_more(peaks.at([0])).with_more(peaks)
    whole = MapEstimate.of_search(before.evidence, found.pool, before.members)
    assert len(found.pool) == len(before.pool) + 1 + len(peaks) > len(before.pool) + 2
    np.testing.assert_array_equal(found.members, before.members)
    for table, made_whole in zip(box_tables(found), box_tables(whole), strict=True):
        np.testing.assert_array_equal(table, made_whole)
    np.testing.assert_array_equal(found.problem.track_gain, whole.problem.track_gain)
    searched = before.searched_with(peaks, before.members)
    np.testing.assert_array_equal(
        searched.members, MapEstimate.of_search(before.evidence, searched.pool, before.members).members
    )


@pytest.mark.parametrize("seed", range(3))
def test_refined_places_are_those_without_a_cache(seed: int) -> None:
    """Members who take other boxes, since others are gone, are not where they were."""
    _, views, predicted = crowd(seed)
    estimate = of_tracks(views, predicted)
    refined_members(estimate)
    for one in (estimate, estimate.with_members(estimate.members[::2])):
        anew = replace(one, evidence=replace(one.evidence))
        found, by_itself = refined_members(one), refined_members(anew)
        np.testing.assert_array_equal(found.pool.ground, by_itself.pool.ground)
        np.testing.assert_array_equal(found.covariance, by_itself.covariance)


def test_more_candidates_have_the_pixels_of_a_whole_pool() -> None:
    ground = separate_places(np.random.default_rng(3), 5, 0.5)
    rig_detector = Detector(room(), ["pixels"] * 4, FEW_HEIGHTS, BODY)
    prior = Prior.of(expecting(*ground[:2]), rig_detector.config, rig_detector.body, rig_detector.border)
    views = rig_detector.observe(likelihoods(room().cameras, people(*ground)))
    before = MapEstimate.of_search(rig_detector.evidence(views, prior), prior.pool(), np.arange(2))
    peaks = lattice_candidates(before, rig_detector.lattice_ground)
    found = before.with_more(peaks.at([0])).with_more(peaks.at([1])).problem
    whole = MapEstimate.of_search(before.evidence, before.pool.joined_with(peaks.at([0, 1])), before.members).problem
    for table, made_whole in zip(found.pixels, whole.pixels, strict=True):
        np.testing.assert_array_equal(table, made_whole)
    for name in ("size_prior", "birth_cost", "track_gain", "ground", "breadth"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
    assert len(found.ground) == 4


def test_strong_members_are_not_searched_again() -> None:
    views = [boxes(camera, people((-1, -1), (1, 1))) for camera in room().cameras]
    before = of_tracks(views, expecting((-1, -1), (1, 1)))
    assert (before.losses > 12).all()
    assert restarted(before, detector().lattice_ground) is before
