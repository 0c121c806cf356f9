"""Merge moves and the hard core: a wide silhouette is one body, two people are two, and no two stand in one place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import reference_core as reference
from scenes import BODY, FEW_HEIGHTS, boxes, expecting, likelihoods, room

from stseg.arrays import Floats, Singles, ViewEvidence
from stseg.bodies.outlines import outlines
from stseg.detection.detector import Detector
from stseg.detection.explanation import explained_frame
from stseg.detection.prior import Prior
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.merge_moves import merged
from stseg.detection.search.refined_people import refined_members
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks

PAIRS = [(width, distance) for width in (1.0, 1.3, 1.6) for distance in (0.3, 0.4, 0.5, 0.59)]
"""Width of a silhouette beside a common one, and distance of two members on it, metres."""


@cache
def detector(*kinds: str) -> Detector:
    return Detector(room(), kinds or ["pixels"] * 4, FEW_HEIGHTS, BODY)


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


def members_at(ground: Floats, views: list[Singles]) -> MapEstimate:
    """An estimate with members of mean size at ground (n, 2)."""
    own_detector = detector()
    prior = Prior.of(None, own_detector.config, own_detector.body, own_detector.border)
    evidence = own_detector.evidence(own_detector.observe(views), prior)
    pool = Candidates(ground, np.full(len(ground), 1.7), np.full(len(ground), BODY.width_mean))
    members = np.arange(len(ground))
    return MapEstimate.of_search(evidence, pool, members).with_members(members)


def pair(distance: float) -> Floats:
    """Two places at a distance, about a point near the middle of the room; float64 (2, 2), metres."""
    return np.asarray(np.array([[0.1, -0.2]]) + np.array([[-0.5], [0.5]]) * distance * np.array([[0.8, 0.6]]))


@pytest.mark.parametrize("distance", [0.3, 0.36, 0.42])
def test_two_members_on_one_wide_silhouette_become_one_body(distance: float) -> None:
    before = members_at(pair(distance), silhouettes(pair(0.0)[:1], 1.5))
    after = merged(before)
    assert len(after.members) == 1
    body = after.pool.at(after.members)
    assert np.hypot(*(body.ground[0] - pair(0.0)[0])) < 0.15
    assert body.width[0] > BODY.width_mean + BODY.width_spread
    assert after.members_score.total > before.members_score.total


@pytest.mark.parametrize("distance", [0.45, 0.5, 0.55])
def test_two_people_side_by_side_stay_two(distance: float) -> None:
    before = members_at(pair(distance), silhouettes(pair(distance), 1.0))
    np.testing.assert_array_equal(merged(before).members, before.members)


def test_two_people_half_a_metre_apart_are_found_as_two() -> None:
    standing = np.column_stack([pair(0.5), [1.7, 1.7]])
    found = detector().explain(likelihoods(room().cameras, standing), None).people.ground
    assert len(found) == 2
    away = np.hypot(*np.moveaxis(standing[:, None, :2] - found, -1, 0))
    assert away.min(0).max() < 0.12 and away.min(1).max() < 0.12


def test_a_third_person_is_no_part_of_a_merge() -> None:
    ground = np.concatenate([pair(0.3), [[1.2, 1.0]]])
    views = [
        np.maximum(*both) for both in zip(silhouettes(ground[2:], 1.0), silhouettes(pair(0.0)[:1], 1.5), strict=True)
    ]
    after = merged(members_at(ground, views))
    assert len(after.members) == 2 and 2 in after.members


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
    assert after.members_score.total == pytest.approx(max(scores), abs=1e-3)


def test_members_far_apart_and_members_in_boxes_are_left_alone() -> None:
    far = members_at(pair(0.7), silhouettes(pair(0.7), 1.0))
    assert merged(far) is far
    own_detector = detector(*["boxes"] * 4)
    views = [boxes(camera, np.column_stack([pair(0.5), [1.7, 1.7]])) for camera in room().cameras]
    prior = Prior.of(None, own_detector.config, own_detector.body, own_detector.border)
    evidence = own_detector.evidence(own_detector.observe(views), prior)
    close_pair = MapEstimate.of_search(evidence, Candidates(pair(0.5), np.full(2, 1.7), np.full(2, 0.42)), np.arange(2))
    assert len(close_pair.members) == 2
    assert merged(close_pair) is close_pair


# The hard core


def test_the_hard_core_stands_where_a_view_delivers_pixels() -> None:
    core = FEW_HEIGHTS.minimum_distance - 0.05
    assert detector().parameters.hard_core == pytest.approx(core)
    assert detector("pixels", "boxes", "boxes", "boxes").parameters.hard_core == pytest.approx(core)
    assert detector(*["boxes"] * 4).parameters.hard_core == 0.0


def nearest_pair(ground: Floats) -> float:
    """Distance of the two nearest of some places, metres; infinite for fewer than two."""
    distance = np.hypot(*np.moveaxis(ground[:, None] - ground, -1, 0)) + np.diag(np.full(len(ground), np.inf))
    return float(distance.min(initial=np.inf))


def crowd(seed: int) -> Floats:
    """Six people about the middle of the room, some nearer to each other than bodies are wide."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-0.8, 0.8, (6, 2)), rng.uniform(1.6, 1.8, 6)])


def twins(standing: Floats) -> PredictedTracks:
    """Two predicted tracks for each person, 0.16 m apart."""
    doubled = np.repeat(standing, 2, axis=0)
    doubled[::2, 0] -= 0.08
    doubled[1::2, 0] += 0.08
    return expecting(*doubled)


def dilated(raster: Singles) -> Singles:
    """A map with foreground two pixels wider on all sides."""
    return np.asarray(cv2.dilate(raster, np.ones((5, 5), np.uint8)), np.float32)


def crowded(kinds: Sequence[str], seed: int) -> Iterator[tuple[Sequence[ViewEvidence], PredictedTracks | None]]:
    """A crowd in silhouettes that are too wide and in boxes: in a first frame, and with two tracks on each person."""
    standing = crowd(seed)
    masks = [dilated(raster) for raster in likelihoods(room().cameras, standing)]
    views: list[ViewEvidence] = [
        mask if kind == "pixels" else boxes(camera, standing)
        for kind, mask, camera in zip(kinds, masks, room().cameras, strict=True)
    ]
    yield views, None
    yield views, twins(standing)


@pytest.mark.parametrize("observations", [4.0, 40.0])
@pytest.mark.parametrize("kinds", [["pixels"] * 4, ["pixels", "boxes"] * 2], ids=["pixels", "mixed"])
@pytest.mark.parametrize("seed", range(4))
def test_no_two_members_stand_within_the_hard_core(
    observations: float, kinds: list[str], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Each view speaks for ten views in the second case, which outvote any cost of crowding but the core.
    own_detector = Detector(room(), kinds, replace(FEW_HEIGHTS, effective_observations=observations), BODY)
    final: list[Floats] = []

    def recorded_explanation(estimate: MapEstimate) -> Explanation:
        final.append(estimate.pool.ground[estimate.members])
        return explained_frame(estimate)

    monkeypatch.setattr("stseg.detection.detector.explained_frame", recorded_explanation)
    for views, predicted in crowded(kinds, seed):
        own_detector.explain(views, predicted)
    assert len(final) == 2
    for ground in final:
        assert len(ground) > 2
        assert nearest_pair(ground) >= own_detector.parameters.hard_core


@pytest.mark.parametrize("seed", range(6))
def test_no_two_refined_places_are_within_the_hard_core(seed: int) -> None:
    own_detector = detector()
    for views, predicted in crowded(["pixels"] * 4, seed):
        assert nearest_pair(own_detector.explain(views, predicted).people.ground) >= own_detector.parameters.hard_core
