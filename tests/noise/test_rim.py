"""Rims of silhouettes: what is learned from people who stand alone, and what is withdrawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, expecting, found, likelihoods, people, room
from scipy.ndimage import maximum_filter

from stseg.arrays import Floats, Singles, ViewEvidence
from stseg.bodies.views import ViewObservation
from stseg.detection.detector import Detector
from stseg.noise.rim_estimate import RimEstimate, without_rim

APART = ((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75))


def shown(raster: Singles) -> ViewObservation:
    none = np.zeros(0)
    return ViewObservation(np.zeros((0, 4)), none, np.zeros((0, 5)), none, raster)


def seen(standing: Floats, eaten: int) -> list[ViewEvidence]:
    """Likelihoods of people, of whose edges some pixels are missing."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * eaten + 1,) * 2)
    return [np.asarray(cv2.erode(view, disc), np.float32) for view in likelihoods(room().cameras, standing)]


def learned(standing: Floats, eaten: int, frames: int = 10, evidence: float = 20.0) -> RimEstimate:
    return learned_from(seen(standing, eaten), standing, frames, evidence)


def learned_from(
    evidence_of_views: Sequence[ViewEvidence], standing: Floats, frames: int = 10, evidence: float = 20.0
) -> RimEstimate:
    asked = Detector(room(), ["pixels"] * 4, FEW_HEIGHTS, BODY)
    rims, here = asked.new_estimates().rims, replace(found(standing, evidence=evidence), height=standing[:, 2])
    observations = asked.observe(evidence_of_views)
    for _ in range(frames):
        rims.learn(here, asked.views, observations)
    return rims


def test_background_beside_foreground_says_less() -> None:
    raster = np.random.default_rng(5).normal(-1.0, 1.0, (17, 23)).astype(np.float32)
    beside = (maximum_filter(raster, 3) > 0) & (raster < 0)
    assert 20 < beside.sum() < (raster < 0).sum()
    expected = np.where(beside, raster * np.float32(0.25), raster)
    np.testing.assert_array_equal(without_rim(shown(raster), 0.75).raster, expected)


def test_nothing_is_withdrawn_from_whole_silhouettes() -> None:
    rims, raster = learned(people(*APART), 0), np.full((3, 3), -1.0, np.float32)
    assert rims.shares.sums[:, 0].min() > 1.0
    np.testing.assert_array_equal(rims.withdrawn, 0.0)
    whole = shown(raster)
    assert without_rim(whole, 0.0) is whole


def test_eaten_silhouettes_lose_their_rim() -> None:
    weak, strong = (learned(people(*APART), eaten).withdrawn for eaten in (1, 3))
    assert (strong > 0.8).all()
    assert (weak < strong).all()


def test_the_share_is_that_which_leaves_the_usual_misses() -> None:
    rims = learned(people(*APART), 2, frames=200)
    weight, missing, rim = rims.shares.sums.T
    left = (missing - rims.withdrawn * rim) / weight
    np.testing.assert_allclose(left[rims.withdrawn < 1], FEW_HEIGHTS.pixel_miss_rate, atol=0.01)
    assert (rims.withdrawn > 0).any()


def test_limbs_beside_an_outline_make_up_for_background_within() -> None:
    alone = people((0.0, 0.0, 1.7))
    eaten: list[ViewEvidence] = []
    shifted: list[ViewEvidence] = []
    for view in likelihoods(room().cameras, alone):
        beside = np.roll(view, 2, axis=1)
        shifted.append(beside)
        eaten.append(np.minimum(view, beside))
    assert (learned_from(eaten, alone).shares.sums[:, 1] > 1.5 * learned_from(shifted, alone).shares.sums[:, 1]).all()


def test_a_view_without_people_takes_the_mean_of_the_others() -> None:
    rims = learned(people(*APART), 3)
    every = rims.withdrawn
    rims.shares.sums[2] = 0.0
    assert rims.withdrawn[2] == pytest.approx(np.delete(every, 2).mean(), abs=0.1)
    assert rims.withdrawn[2] > 0.5


@pytest.mark.parametrize(
    ("standing", "evidence"), [([(0.0, 0.0, 1.7), (0.1, 0.1, 1.7)], 20.0), (list(APART), 1.0), ([], 20.0)]
)
def test_who_overlaps_or_is_doubted_teaches_nothing(standing: list[tuple[float, ...]], evidence: float) -> None:
    np.testing.assert_array_equal(learned(people(*standing), 3, evidence=evidence).shares.sums, 0.0)


def test_learned_rims_raise_evidence_in_eaten_silhouettes() -> None:
    standing = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75), (0.7, 0.9, 1.65))
    asked, evidence = Detector(room(), ["pixels"] * 4, FEW_HEIGHTS, BODY), []
    first = asked.new_estimates()
    for known in (first, replace(first, rims=learned(people(*APART), 1))):
        explained = asked.explain_next(known, 0, seen(standing, 1), expecting(*standing))
        assert len(explained.people) == len(standing)
        evidence.append(explained.people.evidence.sum())
    assert evidence[1] > evidence[0] + 2.0
