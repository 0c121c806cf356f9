"""Frozen views: a view that repeats itself while others change, and all that is no failure."""

from __future__ import annotations

import numpy as np
import pytest

from stseg.arrays import Boxes, Observation
from stseg.view_health.blind_views import FrozenViews

KINDS = ("masks", "colour", "boxes")


def view(kind: str, number: int) -> Observation:
    """What a camera shows that shows something else for each number; nobody for 0."""
    if kind == "boxes":
        return Boxes(np.full((min(number, 1), 4), float(number)), np.ones(min(number, 1)))
    return np.full((4, 5, 3) if kind == "colour" else (4, 5), number, np.uint8)


def shown(kind: str, numbers: list[list[int]], rate: float = 10.0) -> list[list[bool]]:
    """Which views are frozen in each frame."""
    frozen = FrozenViews(len(numbers[0]), rate)
    return [[one is None for one in frozen.without([view(kind, k) for k in row])] for row in numbers]


@pytest.mark.parametrize("kind", KINDS)
def test_a_view_is_frozen_after_half_a_second(kind: str) -> None:
    found = shown(kind, [[1 + k, 7 if 3 <= k < 12 else 20 + k, 40 + k] for k in range(16)])
    assert [row[1] for row in found] == [8 <= k < 12 for k in range(16)]
    assert not any(row[0] or row[2] for row in found)


@pytest.mark.parametrize("kind", KINDS)
def test_no_view_is_frozen_where_all_stand_still(kind: str) -> None:
    assert not np.any(shown(kind, [[1, 2, 3]] * 30))
    assert not np.any(shown(kind, [[1 + k, 2, 3, 4] for k in range(30)]))


@pytest.mark.parametrize("kind", ["masks", "boxes"])
def test_a_view_that_shows_nobody_is_not_frozen(kind: str) -> None:
    assert not np.any(shown(kind, [[1 + k, 0, 40 + k] for k in range(30)]))


@pytest.mark.parametrize(("repeats", "rate"), [(2, 10.0), (5, 25.0), (3, 2.0)])
def test_frames_that_fill_gaps_are_no_failure(repeats: int, rate: float) -> None:
    assert not np.any(shown("colour", [[1 + k, 2 + k // repeats, 9 + k] for k in range(60)], rate))


def test_a_view_back_from_a_gap_is_not_frozen() -> None:
    frozen = FrozenViews(2, 10.0)
    for k in range(20):
        own = None if k < 10 else view("masks", 5 + k)
        assert (frozen.without([view("masks", 1 + k), own])[1] is None) == (own is None)
