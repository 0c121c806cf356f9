"""The experiment with belief propagation: what it films, and how it judges a track."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stseg.config import BeliefConfig

sys.path.append(str(Path(__file__).parents[1] / "tools"))

import belief_experiment as tool


@pytest.fixture(scope="module")
def recording() -> tool.Recording:
    """The first frames of the scene with somebody alike, small."""
    similar = tool.EXPERIMENTS["similar"]
    return tool.film(replace(similar, spec=replace(similar.spec, seconds=0.28, size=(160, 120))))


@pytest.mark.parametrize("way", tool.WAYS)
def test_a_target_in_full_view_is_kept(recording: tool.Recording, way: str) -> None:
    stars = tool.follow(recording, way, BeliefConfig(count=40))
    path = np.stack([tool.estimates(star, recording.views) for star in stars])
    kept, away = tool.judge(recording, path)
    assert kept.tolist() == [1.0, 1.0]
    assert (away < 0.3).all()
    drawn = tool.picture(recording, {way: stars}, (2, 5))
    assert drawn.shape == (2 * 120, 2 * 160, 3)


def test_an_estimate_beside_the_target_is_lost(recording: tool.Recording) -> None:
    path = np.repeat(recording.truth[1:, None] + (0.0, 0.6), 2, axis=1)
    kept, away = tool.judge(recording, path)
    assert kept.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(away, 0.6)
    path[1:, 1] = np.nan
    assert tool.judge(recording, path)[0].tolist() == [0.0, 0.0]


def test_the_screen_is_the_smallest_that_hides() -> None:
    person = np.zeros((2, 9, 9), bool)
    person[0, 2:4, 3] = person[1, 3:6, 5:7] = True
    rows, columns = np.nonzero(tool._screen(person))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (2, 5, 3, 6)
    assert tool.overlap(np.array([0.0, 0, 2, 2]), np.array([1.0, 0, 3, 2])) == pytest.approx(1 / 3)
