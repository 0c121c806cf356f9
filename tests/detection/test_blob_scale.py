"""Scale of blobs: pixels weigh no more than in the largest body that explains them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, likelihoods, people, rig_of, room

from stseg.arrays import Floats, Singles
from stseg.bodies.views import PixelView, ViewObservation
from stseg.detection.detector import Detector
from stseg.detection.prior import Prior
from stseg.records.predicted_tracks import no_tracks

CROWD = people((-1.2, -0.3, 1.75), (-0.2, 1.2, 1.6), (0.4, -1.1, 1.8))


def detector_for(cameras: int) -> Detector:
    return Detector(rig_of(room().cameras[:cameras]), ["pixels"] * cameras, FEW_HEIGHTS, BODY)


def scales_by_definition(detector: Detector, observations: list[ViewObservation]) -> list[Singles]:
    views, lattice = [view for view in detector.views if isinstance(view, PixelView)], detector.pixel_lattice.outlines
    cells = len(detector.lattice_ground.reshape(-1, 2))
    mean = np.zeros((len(views), cells))
    inside: list[list[np.ndarray]] = []
    common = [slice(3 * k * cells + 1, 3 * (k + 1) * cells, 3) for k in range(len(views))]
    for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
        first, area = lattice.first[common[k]], lattice.area[common[k]]
        spans = [lattice.spans[slice(*lattice.start[i : i + 2])] for i in range(common[k].start, common[k].stop, 3)]
        inside_cell = np.zeros((cells, *view.shape), bool)
        for cell in range(cells):
            for row, (left, right) in enumerate(spans[cell]):
                if right > left:
                    inside_cell[cell, first[cell] + row, left:right] = True
        mean[k] = np.where(first < 0, 0.0, (inside_cell * observation.raster).sum((1, 2)) / np.maximum(area, 1e-9))
        inside.append(list(inside_cell))
    config = detector.config
    worth = config.prior_log_odds + config.effective_observations * mean.sum(0) > 0
    certain = np.log((1 - config.pixel_miss_rate) / config.pixel_clutter_rate)
    scales = []
    for k in range(len(views)):
        explained: Floats = lattice.area[common[k]] * mean[k] / certain
        of_cells = [cell * value for cell, value in zip(inside[k], explained, strict=True)]
        scales.append(
            np.max([*(one for one, is_worth in zip(of_cells, worth, strict=True) if is_worth), 0 * of_cells[0]], axis=0)
        )
    return scales


def scales(detector: Detector, observations: Sequence[ViewObservation | None]) -> Singles:
    return detector.evidence(observations, Prior.of(None, FEW_HEIGHTS, BODY, detector.border)).scales


@pytest.mark.parametrize("cameras", [1, 2])
def test_scale_is_what_the_largest_body_explains(cameras: int) -> None:
    detector = detector_for(cameras)
    observations = [one for one in detector.observe(likelihoods(room().cameras[:cameras], CROWD)) if one is not None]
    found = scales(detector, observations)
    for scale, expected in zip(found, scales_by_definition(detector, observations), strict=True):
        np.testing.assert_allclose(scale, expected, rtol=1e-4, atol=1e-3)
        assert scale.max() > 0


def test_a_blind_view_and_an_empty_one_have_no_scale() -> None:
    detector = detector_for(2)
    nothing = np.zeros(room().cameras[0].size[::-1], np.float32)
    assert not scales(detector, [None, detector.observe([nothing, nothing])[1]]).any()


@pytest.mark.parametrize("place", [(-1.0, 0.0), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.0)])
def test_a_near_body_is_no_small_one_at_the_far_border(place: tuple[float, float]) -> None:
    """Its head holds a whole body there, where births cost nothing."""
    near_body = people((*place, 1.75))
    found = detector_for(1).explain(likelihoods(room().cameras[:1], near_body), no_tracks()).people.ground
    assert np.hypot(*(found - near_body[:, :2]).T).max() < 0.5
