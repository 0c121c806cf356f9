"""What the reliability of the stated probabilities rests on."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit

sys.path.append(str(Path(__file__).parents[2] / "tools"))

from experiments import certainty


def test_what_is_said_as_it_is_has_no_error() -> None:
    rng = np.random.default_rng(0)
    log_odds = rng.normal(0.0, 2.0, 40_000)
    truth = rng.random(len(log_odds)) < expit(log_odds)
    calm, loud = certainty.Tally(), certainty.Tally()
    calm.add(log_odds, truth)
    loud.add(2 * log_odds, truth)
    assert calm.error() < 0.01
    assert loud.error() > 0.05
    assert loud.score > calm.score
    stated, occupied = calm.table()
    np.testing.assert_allclose(stated, occupied, atol=0.03)


def test_the_error_is_weighed_by_cells() -> None:
    """Three cells said to be at 0.5 of which one is, one surely empty: 3/4 of |0.5 - 1/3|."""
    tally = certainty.Tally()
    tally.add(np.array([0.0, 0.0, 0.0, -40.0]), np.array([True, False, False, False]))
    assert tally.error() == pytest.approx(3 / 4 * (1 / 2 - 1 / 3))
    assert tally.score == pytest.approx(3 * np.log(2))
    assert np.isnan(tally.table()).sum() == 2 * 8
