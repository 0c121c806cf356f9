"""Who is who from the whole run: meetings undone by height, motion and looks, people found again, the greatest sum."""

import numpy as np
import pytest
from checks import drawn
from hypothesis import example
from hypothesis import strategies as st
from simulated_people import BORDER, CONFIG, RATE, Path, committed, gone, rows_of, runs, straight, swapped, visit

from stseg.arrays import Floats, Ints, Rows
from stseg.identities.association import GlobalAssociation, IdentityProblem, _prevailing_track, associate_globally
from stseg.identities.evidence.appearance_model import LearnedAppearance, learn_appearance, row_looks
from stseg.records.tables import APPEARANCE, COLOURS, EVENT, FEATURES, TRAJECTORY
from stseg.tracking.row_groups import isolated_tracklets


def relinked(rows: Rows) -> GlobalAssociation:
    return associate_globally(rows, IdentityProblem.of(rows, (), RATE, BORDER, CONFIG))


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


def test_a_person_who_stoops_slowly_stays_one_person() -> None:
    rows = rows_of({1: (straight(0, 0, 0, 0), 1.7, range(400)), 2: (straight(0.6, 0, 0, 0), 1.8, range(400))})
    rows["height"][rows["id"] == 1] -= 0.06 * np.arange(400) / 400
    assert len(np.unique(relinked(rows).identity)) == 2


def test_somebody_lost_inside_the_area_is_the_same_afterwards() -> None:
    found = relinked(gone(2.0))
    (link,) = found.links
    assert (set(found.identity.tolist()), link.frame, link.identity, link.track) == ({1}, 40, 1, 2)
    assert link.reason.startswith("2.1 s on") and link.reason.isascii() and len(link.reason) <= EVENT["reason"].itemsize
    rows = gone(CONFIG.tracking.maximum_gap + 0.25)
    np.testing.assert_array_equal(relinked(rows).identity, rows["id"], "too long is somebody else")


@drawn(100, runs(6))
@example(np.zeros(0, TRAJECTORY))
def test_nobody_is_in_two_places_at_once(rows: Rows) -> None:
    found = relinked(rows)
    keys = list(zip(rows["frame"].tolist(), found.identity.tolist(), strict=True))
    assert len(set(keys)) == len(rows) == len(found.identity) and (found.identity > 0).all()
    for link in found.links:
        at = (rows["frame"] == link.frame) & (rows["id"] == link.track)
        assert found.identity[at].tolist() == [link.identity]
        assert (rows["frame"][found.identity == link.identity] < link.frame).any()


@drawn(60, runs(5), st.integers(0, 999))
def test_the_order_of_rows_does_not_matter(rows: Rows, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(rows))
    one, other = relinked(rows), relinked(rows[order])
    np.testing.assert_array_equal(one.identity[order], other.identity)
    assert one.links == other.links and relinked(rows).links == one.links


def test_tracks_are_cut_at_gaps_and_nothing_teaches_nothing() -> None:
    rows = rows_of(PASSING, noise=0.0)
    rows = rows[(rows["id"] != 1) | (rows["frame"] < 50) | (rows["frame"] >= 53)]
    parts = [(int(rows["id"][p[0]]), *rows["frame"][p[[0, -1]]].tolist()) for p in isolated_tracklets(rows, RATE)]
    assert parts == [(1, 0, 31), (1, 32, 49), (1, 53, 63), (2, 0, 31), (2, 32, 63)]
    assert learned(walkers()[:0], np.zeros(0, APPEARANCE)).value.shape == (0, 0)
    one = walkers()
    assert learned(one, np.zeros(0, APPEARANCE)).value.shape == (len(one), 0)


@drawn(100, runs(6))
def test_stretches_hold_every_row_once(rows: Rows) -> None:
    parts = isolated_tracklets(rows, RATE)
    assert sorted(row for part in parts for row in part.tolist()) == list(range(len(rows)))
    for part in parts:
        own = rows[part]
        assert len(set(own["id"].tolist())) == 1 and (np.diff(own["frame"]) == 1).all()


@drawn(
    100, st.lists(st.tuples(st.integers(1, 3), st.integers(1, 4)), max_size=40), st.sampled_from([0.0, 1.0, 2.5, 4.0])
)
def test_the_prevailing_track_is_that_of_most_rows_around(steps: list[tuple[int, int]], reach: float) -> None:
    rows = np.zeros(len(steps), TRAJECTORY)
    rows["id"], rows["frame"] = [track for track, _ in steps], np.cumsum([step for _, step in steps])
    held = []
    for row in rows:
        around = rows["id"][np.abs(rows["frame"] - row["frame"]) <= reach].tolist()
        (most,) = [one for one in set(around) if 2 * around.count(one) > len(around)] or [int(row["id"])]
        held.append(most)
    assert _prevailing_track(rows, reach).tolist() == held


PEOPLE = 6
FRAMES = range(160)


def walkers() -> Rows:
    """People who walk beside each other, two metres apart."""
    return committed(rows_of({k: (straight(-5, 2 * k - 7, 0.5, 0), 1.7, FRAMES) for k in range(1, PEOPLE + 1)}))


def appearance(rows: Rows, true: Ints, noise: float, differ: float, seed: int, name: str = "features") -> Rows:
    """What two views see of every row: the person's numbers, the camera's offset, and an error."""
    rng = np.random.default_rng(seed)
    size = FEATURES if name == "features" else COLOURS
    own = differ * rng.normal(size=(int(true.max()) + 1, size))
    offset = 5.0 * rng.normal(size=(2, size))
    parts = []
    for view in range(2):
        seen = np.zeros(len(rows), APPEARANCE)
        seen["frame"], seen["x"], seen["y"], seen["view"] = rows["frame"], rows["raw_x"], rows["raw_y"], view
        seen["features"] = seen["colours"] = np.nan
        seen[name] = own[true] + offset[view] + noise * rng.normal(size=(len(rows), size))
        parts.append(seen[rng.random(len(rows)) < 0.7])
    return np.concatenate(parts)


def learned(rows: Rows, looks: Rows, person: Ints | None = None) -> LearnedAppearance:
    tracklets, person = isolated_tracklets(rows, RATE), rows["id"] if person is None else person
    by_parts = row_looks(rows, [looks[looks["frame"] < 80], looks[looks["frame"] >= 80]])
    np.testing.assert_allclose(np.hstack(by_parts), np.hstack(row_looks(rows, (looks,))), atol=1e-9)
    return learn_appearance(rows["frame"], by_parts, tracklets, person, RATE)


def distance(value: Floats, a: Ints, b: Ints) -> float:
    return float(np.linalg.norm(np.nanmean(value[a], axis=0) - np.nanmean(value[b], axis=0)))


@pytest.mark.parametrize("name", ["features", "colours"])
def test_people_who_differ_are_far_apart_along_the_axes(name: str) -> None:
    rows = walkers()
    found = learned(rows, appearance(rows, rows["id"], 1.0, 1.0, 4, name))
    assert found.value.shape[1] >= 2 and (found.model.spread > 0.3).any()
    early, late = rows["frame"] < 80, rows["frame"] >= 80
    for k in range(1, PEOPLE + 1):
        own = distance(found.value, (rows["id"] == k) & early, (rows["id"] == k) & late)
        others = [distance(found.value, (rows["id"] == k) & early, (rows["id"] == j) & late) for j in range(1, k)]
        assert own < min(others, default=np.inf)


@pytest.mark.parametrize("seed", range(8))
def test_numbers_that_say_nothing_of_the_person_add_nothing(seed: int) -> None:
    rows = walkers()
    for columns in (FEATURES, 1, 0):
        looks = appearance(rows, rows["id"], 1.0, 0.0, seed)
        looks["features"][:, columns:] = 0.0
        found = learned(rows, looks)
        assert found.value.shape == (len(rows), 0) and len(found.model.spread) == 0


def drifting(rows: Rows, noise: float, differ: float, frames: int, name: str) -> Rows:
    """Looks to which every person adds something else every so many frames."""
    looks = appearance(rows, rows["id"], noise, differ, 4, name)
    drift = np.random.default_rng(1).normal(size=(PEOPLE + 1, len(FRAMES) // frames, looks[name].shape[1]))
    person = np.empty(len(looks), np.int64)
    for k, (frame, place) in enumerate(zip(looks["frame"], looks["y"], strict=True)):
        person[k] = rows["id"][(rows["frame"] == frame) & (rows["raw_y"] == place)][0]
    looks[name] += drift[person, looks["frame"] // frames]
    return looks


def test_looks_that_last_count_less_and_offsets_are_undone() -> None:
    rows = walkers()
    fresh, lasting = appearance(rows, rows["id"], 1.0, 1.0, 4), drifting(rows, 0.2, 1.0, 16, "features")
    assert learned(rows, lasting).model.row_variance.min(initial=np.inf) > learned(rows, fresh).model.row_variance.max()
    # Nobody is confused by the other axes, whatever is believed of how long errors last.
    variance = learned(rows, drifting(rows, 0.2, 3.0, 4, "colours")).model.row_variance
    assert variance.max() > 1.5 * variance.min()
    # A person whom only one camera sees for a while does not seem to change.
    looks = appearance(rows, rows["id"], 0.1, 1.0, 4)
    looks = looks[(looks["view"] == 0) | (looks["frame"] % 40 < 20)]
    found = learned(rows, looks)
    early, late = rows["frame"] % 40 < 20, rows["frame"] % 40 >= 20
    for k in range(1, PEOPLE + 1):
        assert distance(found.value, (rows["id"] == k) & early, (rows["id"] == k) & late) < 0.5


def associated(rows: Rows, looks: Rows) -> Ints:
    return associate_globally(rows, IdentityProblem.of(rows, (looks,), RATE, BORDER, CONFIG)).identity


def test_features_tell_apart_and_are_learned_from_errors() -> None:
    """Two stand together and are swapped by the filter; four others walk by, from whom features are learned."""
    others = {k: (straight(-5, k - 1, 0.5, 0), 1.7, FRAMES) for k in range(3, 6)}
    true = committed(rows_of({1: (visit(-1), 1.70, FRAMES), 2: (visit(1), 1.70, FRAMES)} | others, noise=0.0))
    exchanged, pair = true.copy(), true["id"] <= 2
    exchanged[pair] = swapped(true[pair], 80)
    for rows in (true, exchanged):
        found = associated(rows, appearance(rows, true["id"], 1.0, 1.0, 4))
        apart = ~np.isin(rows["frame"], range(72, 89))
        np.testing.assert_array_equal(found[apart], true["id"][apart])
    # Pairs of equally tall people, who are exchanged or not each time they stand together.
    paths = {2 * k + side: (dance(2 * side - 1, 3.0 * k), 1.7, FRAMES) for k in range(3) for side in (0, 1)}
    rows = committed(rows_of({track + 1: path for track, path in paths.items()}))
    rng = np.random.default_rng(2)
    crossed = np.cumsum(rng.random((3, 6)) < 0.5, axis=1) % 2
    index = rows["id"] - 1
    meeting = (rows["frame"] / RATE / 4).astype(int)
    true = 1 + index // 2 * 2 + (index % 2 + crossed[index // 2, meeting]) % 2
    found = associated(rows, appearance(rows, true, 1.0, 1.0, 4))
    apart = np.abs(rows["x"]) > 0.6
    pairs, count = np.unique(np.stack([found[apart], true[apart]]), axis=1, return_counts=True)
    assert pairs.shape[1] == 6, (pairs, count)


def dance(side: float, y: float) -> Path:
    """Two stand together every 4 s and part again."""
    return lambda t: (side * (0.1 + abs(np.sin(np.pi * t / 4))), y)
