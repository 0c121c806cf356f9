"""Warnings of a run: reasons of ghosts, views without evidence or with drift, bodies of another size."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from stseg.arrays import AnyArray, Rows
from stseg.config import BodyConfig
from stseg.io.runfile.layout import ghost_type
from stseg.records.ghost_reasons import DENIED, OTHERS, TOO_LITTLE, ghost_reasons
from stseg.records.tables import RATES, TRAJECTORY
from stseg.view_health.run_warnings import body_warnings, view_warnings

FRAMES = np.arange(100, 400)


def candidates_of(frame: ArrayLike, status: ArrayLike, parts: ArrayLike, evidence: ArrayLike | None = None) -> Rows:
    """Candidates with the given evidence, or the sum of their parts less a price of 3 nats."""
    parts = np.asarray(parts, np.float32)
    table = np.zeros(len(parts), ghost_type(parts.shape[1]))
    table["frame"], table["status"], table["parts"] = frame, status, parts
    table["evidence"] = parts.sum(axis=1) - 3 if evidence is None else evidence
    return table


def people_in(frames: AnyArray, *parts: ArrayLike) -> Rows:
    """A person in each frame, with this evidence in each view, nats."""
    evidence = np.stack([np.broadcast_to(np.asarray(part, float), len(frames)) for part in parts], -1)
    return candidates_of(frames, np.ones(len(frames)), evidence)


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
    ("nats", "words"),
    [
        (np.zeros(300), "view b has no evidence on any candidate"),
        (np.where(FRAMES < 250, 3.0, 0.0), "view b has no evidence in frames 250 to 399 (30 s)"),
        (np.full(300, -2.0), "view b denies most people"),
        (np.linspace(4, 0.5, 300), "view b drifts: its evidence for a person falls from 3.4 to 1.1 nats"),
    ],
)
def test_a_view_that_is_wrong_is_named(nats: AnyArray, words: str) -> None:
    (warning,) = view_warnings(("a", "b"), people_in(FRAMES, 3.0, nats), FRAMES, 5.0)
    assert words in warning


def test_a_view_is_not_silent_where_no_person_was_present() -> None:
    frames = FRAMES[FRAMES < 200]
    assert view_warnings(("a", "b"), people_in(frames, 3.0, 3.0), FRAMES, 5.0) == []


def test_little_evidence_of_the_occluded_denies_none() -> None:
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


def test_wide_bodies_are_reported_with_the_expected_width() -> None:
    calm = rates_of(0.1, 0.1)
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.5), calm, BodyConfig()) == []
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.9, number=5), calm, BodyConfig()) == []
    (warning,) = body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig())
    assert "0.62 m wide" in warning and "0.42 m were expected" in warning
    assert body_warnings(("a", "b"), bodies_of(1.7, 0.62), calm, BodyConfig(width_mean=0.6)) == []


def test_a_view_of_torn_bodies_is_named() -> None:
    (warning,) = body_warnings(("a", "b"), bodies_of(1.7, 0.42), rates_of(0.15, 0.38), BodyConfig())
    assert warning.startswith("view b misses 38 %")
