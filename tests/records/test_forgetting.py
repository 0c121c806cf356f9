"""Forgetting: memory in seconds, frames that are not measured, and rows of their own."""

from __future__ import annotations

import numpy as np
import pytest

from stseg.records.forgetting import Forgetting


def test_memory_is_in_seconds_and_at_least_some_frames() -> None:
    for rate, memory, least, frames in ((10.0, 2.0, 0.0, 20), (10.0, 0.1, 3.0, 3)):
        forgetting = Forgetting((2,), rate, memory, least)
        forgetting.add(np.array([1.0, 2.0]))
        for _ in range(frames):
            forgetting.forget()
        np.testing.assert_allclose(forgetting.sums, np.exp(-1) * np.array([1.0, 2.0]))


def test_skipped_frames_count_with_the_next() -> None:
    skipped, whole = (Forgetting((1,), 10.0, 1.0) for _ in range(2))
    for forgetting in (skipped, whole):
        forgetting.add(np.ones(1))
    for _ in range(3):
        skipped.skip_frame()
    skipped.forget()
    whole.forget(frames=4)
    np.testing.assert_array_equal(skipped.sums, whole.sums)
    assert skipped.seconds(np.ones(1)) == whole.seconds(np.ones(1)) == pytest.approx(0.4)
    skipped.forget()
    assert skipped.seconds(np.ones(1)) == pytest.approx(0.1)


def test_rows_are_forgotten_by_themselves() -> None:
    forgetting = Forgetting((2, 3), 5.0, 1.0)
    forgetting.add(np.ones((2, 3)))
    forgetting.forget(1)
    forgetting.add(np.ones(3), 1)
    assert (forgetting.sums[0] == 1.0).all()
    assert (forgetting.sums[1] > 1.0).all()
    np.testing.assert_array_equal(forgetting.with_prior(2.0, np.ones(3))[0], 3.0)
