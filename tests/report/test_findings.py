"""What a run says of itself: people by the minute, reasons of ghosts, views that are silent or drift."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from stseg.arrays import AnyArray, Rows
from stseg.config import BodyConfig
from stseg.io.runfile.layout import ghost_type
from stseg.records.ghost_reasons import DENIED, OTHERS, TOO_LITTLE, ghost_reasons
from stseg.records.tables import RATES, TRAJECTORY
from stseg.reporting.run_statistics import ground_by_views, people_per_minute
from stseg.view_health.body_warnings import body_warnings
from stseg.view_health.silent_views import view_warnings

FRAMES = np.arange(100, 400)


def candidates_of(frame: ArrayLike, status: ArrayLike, parts: ArrayLike, evidence: ArrayLike | None = None) -> Rows:
    """Candidates whose evidence is what their parts say less a price of 3 nats, unless it is given."""
    said = np.asarray(parts, np.float32)
    table = np.zeros(len(said), ghost_type(said.shape[1]))
    table["frame"], table["status"], table["parts"] = frame, status, said
    table["evidence"] = said.sum(axis=1) - 3 if evidence is None else evidence
    return table


def people_in(frames: AnyArray, *parts: ArrayLike) -> Rows:
    """A person in each frame, of whom each view says these nats."""
    said = np.stack([np.broadcast_to(np.asarray(part, float), len(frames)) for part in parts], -1)
    return candidates_of(frames, np.ones(len(frames)), said)


# People by the minute


def test_each_minute_has_its_own_mean() -> None:
    frames = np.arange(30, 30 + 90)  # a minute and a half, one frame a second
    rows = np.zeros(60 + 90, TRAJECTORY)
    rows["frame"] = np.concatenate([np.arange(30, 90), frames])
    np.testing.assert_allclose(people_per_minute(frames, rows, 1.0), [2, 1])
    assert people_per_minute(frames[:0], rows[:0], 1.0).shape == (0,)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 199), max_size=60), st.floats(0.2, 3))
def test_minutes_add_up_to_all_people(seen: list[int], frame_rate: float) -> None:
    frames, rows = np.arange(200), np.zeros(len(seen), TRAJECTORY)
    rows["frame"] = seen
    length = max(1, round(60 * frame_rate))
    minutes = people_per_minute(frames, rows, frame_rate)
    lengths = np.diff([*range(0, 200, length), 200])
    np.testing.assert_allclose(minutes @ lengths, len(seen))


def test_shares_of_the_ground_that_counts() -> None:
    views = np.zeros((2, 2, 3), np.uint8)
    views[1, 0] = 2
    views[0, 1, 0] = 1
    inside = np.array([[True, True, False], [True, True, False]])
    np.testing.assert_allclose(ground_by_views(views, inside, 2), [0.25, 0.25, 0.5])


# Ghosts


def test_ghosts_have_the_reason_that_weighed_most() -> None:
    people = people_in(np.arange(5), 3, 3, 3)
    ghosts = candidates_of(
        np.arange(4),
        np.zeros(4),
        np.array([[-2.5, 2, 0], [2, 2, 2], [0.1, 0.2, 0], [-1.2, 3, 3]]),
        [-3.5, -9, -2.7, -20],  # nothing else, evidence of others, nothing else, evidence of others above all
    )
    found = ghost_reasons(np.concatenate([people, ghosts]))
    assert found.reason.tolist() == [DENIED, OTHERS, TOO_LITTLE, OTHERS]
    assert found.denies.tolist() == [[True, False, False], [False] * 3, [False] * 3, [True, False, False]]
    assert found.counts() == [1, 2, 1]
    assert len(found.ghosts) == 4


def test_no_candidates_have_no_reasons() -> None:
    found = ghost_reasons(candidates_of([], [], np.zeros((0, 3))))
    assert found.counts() == [0, 0, 0]
    assert found.denies.shape == (0, 3)


# Views


def test_views_that_agree_cause_no_warning() -> None:
    noise = np.random.default_rng(1).normal(3, 1, (2, len(FRAMES)))
    assert view_warnings(("a", "b"), people_in(FRAMES, *noise), FRAMES, 5.0) == []


@pytest.mark.parametrize(
    ("nats", "told"),
    [
        (np.zeros(300), "view b has no evidence on any candidate"),
        (np.where(FRAMES < 250, 3.0, 0.0), "view b has no evidence in frames 250 to 399 (30 s)"),
        (np.full(300, -2.0), "view b denies most people"),
        (np.linspace(4, 0.5, 300), "view b drifts: its evidence for a person falls from 3.4 to 1.1 nats"),
    ],
)
def test_a_view_that_is_wrong_is_named(nats: AnyArray, told: str) -> None:
    (warning,) = view_warnings(("a", "b"), people_in(FRAMES, 3.0, nats), FRAMES, 5.0)
    assert told in warning


def test_a_view_is_not_silent_where_nobody_was_there() -> None:
    there = FRAMES[FRAMES < 200]
    assert view_warnings(("a", "b"), people_in(there, 3.0, 3.0), FRAMES, 5.0) == []


def test_a_detector_that_hardly_speaks_of_the_hidden_denies_nobody() -> None:
    hidden = np.where(FRAMES % 3 == 0, 2.5, -0.016)
    assert view_warnings(("a", "b"), people_in(FRAMES, 3.0, hidden), FRAMES, 5.0) == []


# Bodies


def bodies_of(height: float, width: float, number: int = 40) -> Rows:
    rows = np.zeros(number, TRAJECTORY)
    rows["height"], rows["width"] = height, width
    return rows


def rates_of(*miss: float) -> Rows:
    rows = np.zeros(len(miss), RATES)
    rows["view"], rows["miss"] = np.arange(len(miss)), miss
    return rows


def test_wide_bodies_are_told_beside_what_was_expected_at_their_height() -> None:
    calm = rates_of(0.1, 0.1)
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.5), calm, BodyConfig()) == []
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.9, number=5), calm, BodyConfig()) == []
    (told,) = body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig())
    assert "0.62 m wide" in told and "0.42 m were expected" in told
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig(width_mean=0.6)) == []


def test_a_view_of_torn_bodies_is_named() -> None:
    (told,) = body_warnings(("a", "b"), bodies_of(1.7, 0.42), rates_of(0.15, 0.38), BodyConfig())
    assert told.startswith("view b misses 38 %")
