"""Who is who from the whole run: meetings undone by height and motion, people found again, and the greatest sum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_people import BORDER, CONFIG, RATE, Path, gone, rows_of, runs, straight, swapped, visit

from stseg.arrays import Rows
from stseg.identities.association import GlobalAssociation, IdentityProblem, _prevailing_track, associate_globally
from stseg.identities.evidence.size_model import MeasuredSizes
from stseg.records.tables import APPEARANCE, EVENT, TRAJECTORY
from stseg.tracking.row_groups import isolated_tracklets


def relinked(rows: Rows) -> GlobalAssociation:
    sizes = MeasuredSizes.of_heights(rows["height"], CONFIG)
    return associate_globally(rows, IdentityProblem.of(rows, sizes, np.zeros(0, APPEARANCE), RATE, BORDER, CONFIG))


MET = range(72, 89)
"""Frames in which two visitors stand together."""


@pytest.mark.parametrize(("frame", "taller"), [(80, 0.08), (78, 0.15), (80, 0.15), (82, 0.15)])
def test_heights_resolve_a_swap_of_two_who_stood_together(frame: int, taller: float) -> None:
    true = rows_of({1: (visit(-1), 1.70, range(160)), 2: (visit(1), 1.70 + taller, range(160))}, noise=0.0)
    found = relinked(swapped(true, frame))
    apart = ~np.isin(true["frame"], MET)
    np.testing.assert_array_equal(found.identity[apart], true["id"][apart])
    assert sorted(link.identity for link in found.links) == [1, 2]
    assert all(link.frame in MET and link.track == 3 - link.identity for link in found.links)


PASSING = {1: (straight(-4, -0.15, 1, 0), 1.7, range(64)), 2: (straight(4, 0.15, -1, 0), 1.7, range(64))}


@pytest.mark.parametrize(
    ("people", "tracklets"),
    [
        ({1: (visit(-1), 1.70, range(160)), 2: (visit(1), 1.70, range(160))}, 4),
        ({1: (visit(-1), 1.70, range(160)), 2: (visit(1), 1.78, range(160))}, 4),
        (PASSING, 4),
        ({1: (straight(2.9, 0, 1, 0), 1.65, range(24)), 2: (straight(9.5, 0.2, -0.9, 0), 1.82, range(32, 56))}, 2),
        ({1: (straight(-3, 0.5, 0.7, 0), 1.7, range(24)), 2: (straight(-3, 0.5, 0.7, 0), 1.95, range(32, 56))}, 2),
    ],
    ids=["together", "together, of two heights", "past each other", "out and in at the border", "another height"],
)
def test_tracks_that_were_right_stay(people: dict[int, tuple[Path, float, range]], tracklets: int) -> None:
    rows = rows_of(people)
    assert len(isolated_tracklets(rows, RATE)) == tracklets
    found = relinked(rows)
    np.testing.assert_array_equal(found.identity, rows["id"])
    assert not found.links


def test_somebody_lost_inside_the_area_is_the_same_afterwards() -> None:
    rows = gone(2.0)
    found = relinked(rows)
    assert set(found.identity.tolist()) == {1}
    (link,) = found.links
    assert (link.frame, link.identity, link.track) == (40, 1, 2)
    assert link.reason.startswith("2.1 s on")
    assert link.reason.isascii()
    assert len(link.reason) <= EVENT["reason"].itemsize


def test_too_long_is_somebody_else() -> None:
    rows = gone(CONFIG.tracking.maximum_gap + 0.25)
    np.testing.assert_array_equal(relinked(rows).identity, rows["id"])


@settings(max_examples=100)
@given(runs(6))
def test_nobody_is_in_two_places_at_once(rows: Rows) -> None:
    found = relinked(rows)
    keys = list(zip(rows["frame"].tolist(), found.identity.tolist(), strict=True))
    assert len(set(keys)) == len(rows) == len(found.identity)
    assert (found.identity > 0).all()
    for link in found.links:
        at = (rows["frame"] == link.frame) & (rows["id"] == link.track)
        assert found.identity[at].tolist() == [link.identity]
        assert (rows["frame"][found.identity == link.identity] < link.frame).any()


@settings(max_examples=60)
@given(runs(5), st.integers(0, 999))
def test_the_order_of_rows_does_not_matter(rows: Rows, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(rows))
    one, other = relinked(rows), relinked(rows[order])
    np.testing.assert_array_equal(one.identity[order], other.identity)
    assert one.links == other.links
    assert relinked(rows).links == one.links


def test_nobody_at_all() -> None:
    found = relinked(np.zeros(0, TRAJECTORY))
    assert len(found.identity) == len(found.links) == 0


def test_a_track_is_cut_at_encounters_and_gaps() -> None:
    rows = rows_of(PASSING, noise=0.0)
    rows = rows[(rows["id"] != 1) | (rows["frame"] < 50) | (rows["frame"] >= 53)]
    parts = sorted(
        (int(rows["id"][part[0]]), *rows["frame"][part[[0, -1]]].tolist()) for part in isolated_tracklets(rows, RATE)
    )
    assert parts == [(1, 0, 31), (1, 32, 49), (1, 53, 63), (2, 0, 31), (2, 32, 63)]


@given(runs(6))
def test_stretches_hold_every_row_once(rows: Rows) -> None:
    parts = isolated_tracklets(rows, RATE)
    assert sorted(row for part in parts for row in part.tolist()) == list(range(len(rows)))
    for part in parts:
        own = rows[part]
        assert len(set(own["id"].tolist())) == 1
        assert (np.diff(own["frame"]) == 1).all()


@given(st.lists(st.tuples(st.integers(1, 3), st.integers(1, 4)), max_size=40), st.sampled_from([0.0, 1.0, 2.5, 4.0]))
def test_the_prevailing_track_is_that_of_most_rows_around(steps: list[tuple[int, int]], reach: float) -> None:
    rows = np.zeros(len(steps), TRAJECTORY)
    rows["id"], rows["frame"] = [track for track, _ in steps], np.cumsum([step for _, step in steps])
    held = []
    for row in rows:
        around = rows["id"][np.abs(rows["frame"] - row["frame"]) <= reach].tolist()
        (most,) = [one for one in set(around) if 2 * around.count(one) > len(around)] or [int(row["id"])]
        held.append(most)
    assert _prevailing_track(rows, reach).tolist() == held
