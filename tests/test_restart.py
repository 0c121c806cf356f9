"""Restarts of the search: people whose boxes a followed ghost holds are found, and no set becomes less likely."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, boxes, expecting, people, room

from stseg.arrays import Boxes, Floats
from stseg.detection.detector import Detector
from stseg.detection.map_estimate import FrameEvidence, MapEstimate
from stseg.detection.prior import Prior
from stseg.detection.restart import restarted
from stseg.evaluation.matching import distances, match
from stseg.model.predicted_tracks import PredictedTracks


@cache
def detector() -> Detector:
    return Detector(room(), ["boxes"] * 4, FEW_HEIGHTS, BODY)


def crowd(seed: int) -> tuple[Floats, list[Boxes], PredictedTracks]:
    """Eight people, three boxes in four of each, and tracks of which three went astray."""
    rng, standing = np.random.default_rng(seed), list[Floats]()
    while len(standing) < 8:
        place = rng.uniform(-1.6, 1.6, 2)
        if all(np.hypot(*(place - other)) > 0.4 for other in standing):
            standing.append(place)
    ground = np.array(standing)
    seen = [boxes(camera, people(*ground)) for camera in room().cameras]
    seen = [found.of(rng.random(len(found)) > 0.25) for found in seen]
    expected = ground.copy()
    expected[:3] += rng.normal(0, 0.6, (3, 2))
    return ground, seen, expecting(*expected.clip(-1.7, 1.7))


def of_tracks(seen: list[Boxes], expected: PredictedTracks) -> MapEstimate:
    """The best set of the predicted tracks alone."""
    asked = detector()
    prior = Prior.of(expected, asked.config, asked.body, asked.border)
    evidence = FrameEvidence(asked.views, asked.observe(seen), prior, asked.parameters)
    return MapEstimate.of_search(evidence, prior.pool(), np.arange(len(expected)))


@pytest.mark.parametrize("seed", [9, 19, 31])
def test_people_whose_boxes_a_followed_ghost_holds_are_found(seed: int) -> None:
    ground, seen, expected = crowd(seed)
    found = detector().explain(seen, expected).people
    assert len(found) == len(ground)
    assert len(match(distances(ground, found.ground), 0.3)[0]) == len(ground)


@pytest.mark.parametrize("seed", range(6))
def test_no_set_becomes_less_likely(seed: int) -> None:
    _, seen, expected = crowd(seed)
    before = of_tracks(seen, expected)
    after = restarted(before, detector().lattice_ground)
    assert after.members_score.total >= before.members_score.total


def test_sure_members_are_not_sought_again() -> None:
    seen = [boxes(camera, people((-1, -1), (1, 1))) for camera in room().cameras]
    before = of_tracks(seen, expecting((-1, -1), (1, 1)))
    assert (before.losses() > 12).all()
    assert restarted(before, detector().lattice_ground) is before
