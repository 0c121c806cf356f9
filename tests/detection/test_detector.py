"""The detector on named scenes: who is found, by which evidence, and which ghosts are rejected."""

from functools import cache

import numpy as np
import pytest
from checks import compiled_only
from scenes import (
    BODY,
    FEW_HEIGHTS,
    body_points,
    boxes,
    detector_of,
    evidence_of,
    expecting,
    looking,
    people,
    rig_of,
    room,
)

from stseg.arrays import Floats, Ints, ViewEvidence
from stseg.config import BodyConfig
from stseg.detection.detector import Detector
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import no_tracks

KINDS = ("pixels", "boxes")


@cache
def room_detector(kind: str) -> Detector:
    return detector_of(room(), kind)


def assert_found(explanation: Explanation, standing: Floats, within: float = 0.12) -> Ints:
    """Assert that just these people were found; for each the index of the person found there."""
    found = explanation.people
    assert len(found) == len(standing), found.ground
    away = np.hypot(*np.moveaxis(standing[:, None, :2] - found.ground, -1, 0))
    index = np.asarray(away.argmin(1), np.int64)
    assert len(set(index.tolist())) == len(standing)
    assert away.min(1).max() < within, (found.ground, standing)
    return index


@pytest.mark.parametrize("kind", KINDS)
def test_two_people_apart(kind: str) -> None:
    standing = people((-0.83, 0.31), (0.9, -0.62, 1.8))
    explanation = room_detector(kind).explain(evidence_of(kind, room().cameras, standing), None)
    index = assert_found(explanation, standing)
    found = explanation.people
    np.testing.assert_allclose(found.height[index], standing[:, 2], atol=0.11)
    assert (found.evidence > 5).all() and (found.view_evidence > 0.5).all()
    assert found.view_evidence.shape == found.found_share.shape == (4, 2)
    spread = np.linalg.eigvalsh(found.covariance)
    assert ((spread > 0) & (spread < 0.17**2)).all()
    assert (explanation.ghosts.evidence < 0).all()


@pytest.mark.parametrize(
    "place", [(0.0, 0.0), *(pytest.param(place, marks=compiled_only) for place in ((-0.5, 0.2), (0.3, -0.4)))]
)
def test_a_child_is_found_though_its_height_is_not_tried(place: tuple[float, float]) -> None:
    standing = people((*place, 1.0))
    explanation = room_detector("pixels").explain(evidence_of("pixels", room().cameras, standing), None)
    assert_found(explanation, standing)
    np.testing.assert_allclose(explanation.people.height, 1.0, atol=0.11)


@pytest.mark.parametrize("tall", [1.0, *(pytest.param(k, marks=compiled_only) for k in (1.1, 1.2, 1.4, 1.66, 1.97))])
def test_bodies_of_all_heights_are_found_by_boxes(tall: float) -> None:
    cameras = tuple(looking(f"{x}{y}", (x, y, 2.4), size=(640, 480), focal=375.0) for x in (-3, 3) for y in (-3, 3))
    standing = people((0.3, -0.4, tall), (-0.8, 0.3, 1.75))
    detector = Detector(rig_of(cameras), ["boxes"] * 4, FEW_HEIGHTS, BodyConfig())
    explanation = detector.explain(evidence_of("boxes", cameras, standing), None)
    index = assert_found(explanation, standing)
    np.testing.assert_allclose(explanation.people.height[index], standing[:, 2], atol=0.08)


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_pixels_boxes_and_tracks_are_assigned_to_people(kind: str) -> None:
    rig = room()
    standing = people((-0.7, -0.7), (0.8, 0.8))
    explanation = room_detector(kind).explain(evidence_of(kind, rig.cameras, standing), None)
    nearest, far = assert_found(explanation, standing)
    points = body_points(np.array([-0.7, -0.7, 1.5]))
    pixel, _ = rig.cameras[0].project(points[::20, :2], points[::20, 2])
    u, v = np.rint(pixel / explanation.raster_step[0]).astype(int).T
    owner = explanation.pixel_assignment[0][v, u]
    assert (owner == nearest).mean() > 0.8 and not (owner == far).any()
    assert set(np.unique(explanation.pixel_assignment[2]).tolist()) == {-1, 0, 1}
    for owners in explanation.box_assignment:
        assert sorted(owners.tolist()) == ([nearest, far] if nearest < far else [far, nearest]) * (kind == "boxes")
    # A person continues one track at most, and a track is one person at most; heights tell two apart.
    standing = people((-0.3, 0.0, 1.8), (0.35, 0.1, 1.6), (-1.2, -1.1))
    expected = expecting((0.05, 0.05, 1.6), (0.0, 0.05, 1.8))
    explanation = room_detector(kind).explain(evidence_of(kind, room().cameras, standing), expected)
    index = assert_found(explanation, standing)
    assert explanation.people.track_index[index].tolist() == [1, 0, -1]
    # The prior of a track is higher than that of any birth, and that of a birth inside is lower.
    first, second, birth = explanation.people.prior[index]
    assert min(first, second) > FEW_HEIGHTS.prior_log_odds > birth + 3


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_without_views_detects_nobody(kind: str) -> None:
    detector, expected = room_detector(kind), expecting((0.4, -0.3))
    learned, seen = detector.new_estimates(), evidence_of(kind, room().cameras, people((0.4, -0.3)))
    assert len(detector.explain_next(learned, 0, seen, expected).people) == 1
    blind = detector.explain_next(learned, 1, [None] * 4, expected)
    assert not len(blind.people) and not len(blind.ghosts) and learned.frames == 2
    seen[1] = None
    found = detector.explain_next(learned, 2, seen, expected).people
    assert len(found) == 1 and found.view_evidence[1, 0] == 0


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_who_is_hidden_by_others_in_some_views_stays(kind: str) -> None:
    rig = room()
    standing = people((-0.5, -0.5, 1.8), (0.1, 0.1, 1.6))
    views = evidence_of(kind, rig.cameras, standing)
    if kind == "boxes":
        views[0] = boxes(rig.cameras[0], standing[:1])
    explanation = room_detector(kind).explain(views, None)
    nearest, far = assert_found(explanation, standing)
    if kind == "boxes":
        assert explanation.box_assignment[0].tolist() == [nearest]
        assert explanation.people.found_share[0, far] < 0.3 < 0.9 < explanation.people.found_share[0, nearest]
        assert explanation.people.view_evidence[0, far] > -1.0  # a box that is not expected is not missed
    hidden = people((0.0, 1.0, 1.6))
    nearer = people((-0.92, -0.18, 1.8), (0.93, -0.17, 1.8))  # on the lines to the first two cameras
    standing = np.concatenate([hidden, nearer])
    views = evidence_of(kind, rig.cameras, standing)
    if kind == "boxes":
        views[:2] = [boxes(camera, nearer) for camera in rig.cameras[:2]]
    assert_found(room_detector(kind).explain(views, None), standing, within=0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_track_proposes_and_a_frame_decides_empty_or_not(kind: str) -> None:
    views = evidence_of(kind, room().cameras, people())
    explanation = room_detector(kind).explain(views, None)
    assert len(explanation.people) == 0 and len(explanation.ghosts) == 0
    assert all((owner == -1).all() for owner in explanation.pixel_assignment)
    # A track of the frame before is rejected, too.
    explanation = room_detector(kind).explain(views, expecting((0.2, 0.4)))
    assert len(explanation.people) == 0 and len(explanation.ghosts) == 1
    assert explanation.ghosts.evidence[0] < 0 and explanation.people.view_evidence.shape == (4, 0)
    standing = people((0.2, 0.4))
    views = evidence_of(kind, room().cameras, standing)
    assert_found(room_detector(kind).explain(views, expecting((0.25, 0.35), (-1.2, 1.1))), standing)


def only(explanation: Explanation) -> tuple[float, float, int]:
    """Evidence, prior and track of the one person found."""
    names = ("evidence", "prior", "track_index")
    (evidence,), (prior,), (track,) = (getattr(explanation.people, name) for name in names)
    return float(evidence), float(prior), int(track)


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_births_cost_inside_and_nothing_in_the_first_frame(kind: str) -> None:
    """The evidence of the views stays the same; the prior does not."""
    birth_cost = FEW_HEIGHTS.birth_cost
    for place, cost in (((0.05, -0.04), birth_cost), ((-1.9, 0.1), birth_cost * 0.125)):  # half a cell from the edge
        views = evidence_of(kind, room().cameras, people(place))
        first, later = room_detector(kind).explain(views, None), room_detector(kind).explain(views, no_tracks())
        assert_found(first, people(place))
        np.testing.assert_array_equal(first.people.ground, later.people.ground)
        assert only(first)[0] - only(later)[0] == pytest.approx(cost, abs=1e-6)
        assert only(first)[1] - only(later)[1] == pytest.approx(cost, abs=1e-6)
        assert only(first)[2] == only(later)[2] == -1
    standing = people((-0.83, 0.31), (0.9, -0.62), (0.1, 1.2, 1.6))
    found = room_detector(kind).explain(evidence_of(kind, room().cameras, standing), None).people
    size = np.zeros(len(found))
    for spread, off in (
        (BODY.height_spread, found.height - BODY.height_mean),
        (BODY.width_spread, found.width - BODY.width_of(found.height)),
    ):
        z = np.abs(off / spread)
        size -= np.where(z < 2, z**2 / 2, 2 + 4 * np.log(np.maximum(z, 2) / 2))
    # Of the candidate, not yet refined.
    np.testing.assert_allclose(found.prior, FEW_HEIGHTS.prior_log_odds + size, atol=0.4)
    assert (found.prior <= FEW_HEIGHTS.prior_log_odds).all()


def test_a_track_stays_though_one_view_alone_shows_it() -> None:
    """Three nearer people hide the person from the other views; without a track, so little evidence is a ghost."""
    rig = room()
    hidden = people((0.0, 0.0, 1.6))
    nearer = people((-0.5, -0.5, 1.85), (0.5, -0.49, 1.85), (0.49, 0.5, 1.85))
    standing = np.concatenate([hidden, nearer])
    views: list[ViewEvidence] = [boxes(camera, nearer) for camera in rig.cameras[:3]]
    views.append(boxes(rig.cameras[3], standing))
    tracked = [tuple(person) for person in nearer]
    explanation = room_detector("boxes").explain(views, expecting((0.03, -0.02, 1.6), *tracked))
    index = assert_found(explanation, standing)
    assert explanation.people.track_index[index].tolist() == [0, 1, 2, 3]
    assert (explanation.people.found_share[:, index[0]] < [0.5, 0.5, 0.5, 1.1]).all()
    assert_found(room_detector("boxes").explain(views, expecting(*tracked)), nearer)


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_a_blind_view_is_no_evidence(kind: str) -> None:
    standing = people((-0.83, 0.31), (0.9, -0.62))
    cameras = room().cameras
    views = evidence_of(kind, cameras, standing)
    three = detector_of(rig_of(cameras[:3]), kind).explain(views[:3], None)
    four = room_detector(kind).explain([*views[:3], None], None)
    np.testing.assert_allclose(four.people.ground, three.people.ground, atol=1e-9)
    np.testing.assert_array_equal(four.people.height, three.people.height)
    np.testing.assert_allclose(four.people.view_evidence[:3], three.people.view_evidence, atol=1e-9)
    np.testing.assert_allclose(four.people.view_evidence[3], 0.0, atol=0.02)
    np.testing.assert_allclose(four.people.evidence, three.people.evidence, atol=0.02)
    if kind == "boxes":
        assert len(four.box_assignment[3]) == 0


def test_no_people_and_no_ghosts_without_evidence() -> None:
    for kind in KINDS:
        explanation = room_detector(kind).explain([None] * 4, None)
        assert len(explanation.people) == len(explanation.ghosts) == 0
    three = detector_of(rig_of(room().cameras[:3]), "boxes")
    assert len(three.explain([boxes(room().cameras[0], people())] * 3, None).ghosts) == 0


@compiled_only
def test_view_evidence_is_in_the_order_of_the_rig() -> None:
    """A rig that mixes both kinds: what a view says stands in that view's row."""
    cameras = room().cameras
    kinds = ["pixels", "boxes", "pixels", "boxes"]
    standing = people((0.4, 0.3))
    views: list[ViewEvidence] = [evidence_of(kind, [c], standing)[0] for kind, c in zip(kinds, cameras, strict=True)]
    detector = Detector(rig_of(cameras), kinds, FEW_HEIGHTS, BODY)
    for empty, kind in enumerate(kinds):
        one_empty = [*views]
        one_empty[empty] = evidence_of(kind, cameras[empty : empty + 1], people())[0]
        parts = detector.explain(one_empty, None).people.view_evidence[:, 0]
        assert [bool(p < 0) for p in parts] == [k == empty for k in range(4)], (empty, parts)


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_frame_twice(kind: str) -> None:
    rig = room()
    first, second = people((-0.83, 0.31), (0.9, -0.62), (0.5, 0.1)), people((0.1, 0.1))
    new = detector_of(rig, kind).explain(evidence_of(kind, rig.cameras, first), None)
    used = room_detector(kind)
    used.explain(evidence_of(kind, rig.cameras, second), None)
    again = used.explain(evidence_of(kind, rig.cameras, first), None)
    for name in ("ground", "height", "covariance", "evidence", "view_evidence", "found_share", "prior", "track_index"):
        np.testing.assert_array_equal(getattr(new.people, name), getattr(again.people, name))
        np.testing.assert_array_equal(getattr(new.ghosts, name), getattr(again.ghosts, name))


def test_a_box_in_one_view_alone_is_no_person() -> None:
    """A box in one view that no other view bears out."""
    rig = room()
    standing = people((-0.83, 0.31))
    views = evidence_of("boxes", rig.cameras, standing)
    views[1] = boxes(rig.cameras[1], np.append(standing, people((1.0, 0.9)), 0))
    explanation = room_detector("boxes").explain(views, None)
    assert_found(explanation, standing)
    assert explanation.box_assignment[1].tolist() == [0, -1]
    views[1] = boxes(rig.cameras[1], people())
    assert_found(room_detector("boxes").explain(views, None), standing)
