"""From what a camera delivers to evidence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Boxes
from stseg.config import ForegroundConfig
from stseg.foreground import make_background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground, without_prior


@settings(deadline=None)  # the first call compiles
@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_without_prior_keeps_the_likelihood_ratio(ratio_share: float, prior: float) -> None:
    ratio = ratio_share / (1 - ratio_share)
    posterior = prior * ratio / (prior * ratio + 1 - prior)
    alone = float(without_prior(np.full((1, 1), posterior, np.float32), prior)[0, 0])
    assert alone == pytest.approx(ratio_share, rel=2e-2, abs=1e-4)


def test_each_kind_of_observation_has_its_evidence() -> None:
    sight = ViewForeground()
    boxes = Boxes(np.array([[1.0, 2.0, 3.0, 4.0]]), np.ones(1))
    assert sight.evidence(None) is None
    assert sight.evidence(boxes) is boxes
    mask = np.array([[0, 51], [255, 0]], np.uint8)
    seen = sight.evidence(mask)
    assert isinstance(seen, np.ndarray)
    np.testing.assert_allclose(seen, mask / 255, atol=1e-6)
    instances = np.zeros((4, 6), np.uint16)
    instances[1:3, 2:5] = 7
    found = sight.evidence(instances)
    assert isinstance(found, Boxes)
    assert len(found) == 1


@pytest.mark.parametrize("model", ["mixture", "chromatic", "codebook"])
def test_the_prior_is_taken_out_of_colour_likelihoods(model: Any) -> None:
    empty = np.full((12, 16, 3), 120, np.uint8)
    models = [make_background((16, 12), 10.0, ForegroundConfig(model=model)) for _ in range(2)]
    for background in models:
        for _ in range(20):
            background.learn(empty)
    frame = empty.copy()
    frame[4:8, 5:10] = (124, 116, 126)
    posterior = models[0].likelihood(frame)
    seen = ViewForeground(IlluminationMonitor(models[1], 10.0)).evidence(frame)
    assert isinstance(seen, np.ndarray)
    np.testing.assert_array_equal(seen, without_prior(posterior, models[1].prior))
    assert (seen >= posterior).all()
    assert seen[6, 7] > posterior[6, 7]


def test_a_colour_frame_without_a_background_is_refused() -> None:
    with pytest.raises(ValueError, match="background"):
        ViewForeground().evidence(np.zeros((4, 4, 3), np.uint8))


def test_instances_are_certain_pixels() -> None:
    sight = ViewForeground()
    assert sight.pixels(None) is None
    assert sight.pixels(Boxes(np.zeros((0, 4)), np.zeros(0))) is None
    mask = np.array([[0, 51], [255, 0]], np.uint8)
    seen = sight.pixels(mask)
    assert seen is not None
    np.testing.assert_allclose(seen, mask / 255, atol=1e-6)
    instances = sight.pixels(np.array([[0, 3], [9, 0]], np.uint16))
    np.testing.assert_array_equal(instances, np.array([[0, 1], [1, 0]], np.float32))
