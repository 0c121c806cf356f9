"""Who comes back: the odds of a return, errors that last a visit, one person in one place, and tracks under one id."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from checks import refused
from run_files import write_small_run
from simulated_people import BORDER, CONFIG, RATE, committed, rows_of, straight

from stseg.arrays import Floats, Ints, Rows
from stseg.config import Config
from stseg.engine.offline.known import digest, read_known
from stseg.errors import ConfigError, FormatError, InputError
from stseg.identities.evidence.returns import Visits, find_returns, known_people, lasting_variance, pooled_visits
from stseg.identities.review.answered_constraints import answered_rows
from stseg.identities.review.corrections import Answer
from stseg.identities.search.constraints import NO_CONSTRAINTS, Constraints
from stseg.records.tables import APPEARANCE, COLOURS, EVENT, FEATURES, KNOWN_PERSON
from stseg.trajectories.final_tracks import CommittedRows, FinalTracks, final_tracks

SPREAD = np.full(3, 25.0)
NO_PAIRS = np.zeros((0, 2), np.int64)
PEOPLE = np.array([[6.0, 0, 0], [-6.0, 0, 0], [0, 6.0, -3], [0, -6.0, 3]])


def visits_of(
    *stays: tuple[int, int, int], precision: float = 10.0, people: Floats = PEOPLE, seed: int | None = 1
) -> Visits:
    """Visits (person, first, last) of people, under the identities 11, 12, ..., with errors as they are stated."""
    who, first, last = np.array(stays).T
    mean = people[who]
    if seed is not None:
        mean = mean + np.random.default_rng(seed).normal(size=mean.shape) / np.sqrt(precision)
    weight = np.full(mean.shape, precision)
    return Visits(np.arange(11, 11 + len(stays)), first, last, weight, weight * mean, np.zeros(mean.shape[1]))


def found(visits: Visits, least: float = 0.9) -> dict[int, int]:
    return {one.visit: one.identity for one in find_returns(visits, SPREAD, least, NO_PAIRS)}


def test_returns_are_known_surely_and_of_two_the_likelier() -> None:
    stays = ((0, 0, 9), (1, 5, 20), (0, 30, 40), (2, 35, 50), (1, 60, 70), (0, 60, 80), (3, 75, 90))
    assert found(visits_of(*stays)) == {13: 11, 15: 12, 16: 11}
    assert found(visits_of((0, 0, 30), (0, 30, 40), (0, 10, 20))) == {}, "nobody comes back while there"
    assert found(visits_of((0, 0, 30), (0, 31, 40))) == {12: 11}
    (one,) = find_returns(visits_of((0, 0, 9), (1, 2, 60), (0, 30, 40)), SPREAD, 0.9, NO_PAIRS)
    assert (one.frame, one.identity, one.visit, one.absence) == (30, 11, 13, 21) and 0.9 < one.probability < 1
    # Alone the stranger would be taken for the one who left; with the one who left beside, nobody is sure.
    near = PEOPLE.copy()
    near[1] = near[0] + [0.4, 0.0, 0.0]
    both = ((0, 0, 9), (1, 30, 40), (0, 35, 50))
    assert found(visits_of(*both[:2], people=near, seed=None)) == {12: 11}
    assert found(visits_of(*both, people=near, seed=None)) == {}


def test_the_probability_is_right_in_the_mean() -> None:
    """Of visits at a probability, that share is right: people and visits drawn from the model itself."""
    rng, stated, right = np.random.default_rng(7), [], []
    for trial in range(400):
        people = rng.normal(size=(2, 1)) * 2.0
        again = int(rng.integers(2))
        stays = ((0, 0, 9), (0 if again else 1, 20, 29))
        seen = visits_of(*stays, precision=1.0, people=people, seed=1000 + trial)
        for one in find_returns(seen, np.array([4.0]), 0.0, NO_PAIRS):
            stated.append(one.probability)
            right.append(again)
    share = np.array(stated) > 0.6
    assert share.sum() > 50
    assert np.mean(np.array(right)[share]) == pytest.approx(np.mean(np.array(stated)[share]), abs=0.08)


def test_sizes_that_say_nothing_and_people_known_as_two() -> None:
    seen = visits_of((0, 0, 9), (0, 30, 40))
    (one,) = find_returns(seen, np.zeros(3), 0.0, NO_PAIRS)
    assert one.probability == pytest.approx(0.5)
    seen = visits_of((0, 0, 9), (0, 30, 40), (0, 50, 60))
    apart = [(one.visit, one.identity) for one in find_returns(seen, SPREAD, 0.6, np.array([[12, 11]]))]
    assert (12, 11) not in apart


def test_visits_are_in_order_and_new_by_default() -> None:
    seen = pooled_visits(np.array([7, 3, 7, 0]), np.array([4, 5, 2, 1]), np.ones((4, 1)), np.ones((4, 1)))
    assert [seen.identity.tolist(), seen.first.tolist(), seen.last.tolist()] == [[7, 3], [2, 5], [4, 5]]
    assert len(pooled_visits(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), np.zeros((0, 2)))) == 0
    assert set(whole(CONFIG).identity.tolist()) == {1, 2, 3, 4, 5, 6}


def test_errors_that_last_a_visit_are_learned_from_its_halves() -> None:
    rng = np.random.default_rng(3)
    identity, frame = np.repeat(np.arange(1, 2001), 20), np.tile(np.arange(20), 2000)
    lasting = np.repeat(rng.normal(size=4000) * 0.5, 10)
    value = np.column_stack([lasting, np.zeros(40000)]) + rng.normal(size=(40000, 2))
    visits = pooled_visits(identity, frame, np.ones((40000, 2)), value)
    assert 1 / visits.precision[0] == pytest.approx([0.05 + 0.25, 0.05], abs=0.03)
    halves = np.full((1, 2, 1), 4.0)
    assert lasting_variance(halves, np.array([[[4.0], [-4.0]]])) == pytest.approx([(4 - 0.5) / 2])
    assert lasting_variance(np.zeros((1, 2, 1)), np.zeros((1, 2, 1))) == [0.0]


def scene() -> tuple[Rows, Rows, Rows]:
    """Five people whose features differ; the first is away for ten seconds, and comes back as track 6."""
    frames = {k: range(400) for k in range(2, 6)} | {1: range(100), 6: range(180, 400)}
    people = {k: (straight(-4, 2 * min(k, 6) - 7, 0.02, 0), 1.7, own) for k, own in frames.items()}
    rows = committed(rows_of(people, noise=0.0))
    rows["score"] = 5.0
    rng = np.random.default_rng(5)
    own = 3.0 * rng.normal(size=(7, FEATURES))
    own[6] = own[1]
    looks = np.zeros(len(rows), APPEARANCE)
    looks["frame"], looks["x"], looks["y"] = rows["frame"], rows["raw_x"], rows["raw_y"]
    looks["features"], looks["colours"] = own[rows["id"]] + rng.normal(size=(len(rows), FEATURES)), np.nan
    events = [(0, b"birth", k, 0, b"") for k in range(1, 6)] + [(99, b"death", 1, 0, b""), (180, b"birth", 6, 0, b"")]
    return rows, np.array([*events, (399, b"death", 6, 0, b"")], EVENT), looks


def whole(config: Config, constraints: Constraints = NO_CONSTRAINTS) -> FinalTracks:
    return final_tracks(CommittedRows(*scene()), RATE, BORDER, config, constraints)


def returning(least: float) -> Config:
    return replace(CONFIG, tracking=replace(CONFIG.tracking, return_probability=least))


def test_a_run_without_a_track_has_no_returns() -> None:
    rows = committed(rows_of({1: (straight(0, 0, 0.1, 0), 1.7, range(3))}))
    born = np.array([(0, b"birth", 1, 0, b"")], EVENT)
    found = final_tracks(CommittedRows(rows, born, scene()[2][:0]), RATE, BORDER, returning(0.9))
    assert len(found.trajectory) == 0 and b"dropped" in found.events["kind"]


def test_who_comes_back_has_one_id_and_the_events_say_so() -> None:
    before, after = whole(CONFIG), whole(returning(0.99))
    assert set(after.identity.tolist()) == {1, 2, 3, 4, 5}
    np.testing.assert_array_equal(after.identity == 1, np.isin(before.identity, (1, 6)))
    assert set(after.trajectory["id"].tolist()) == {1, 2, 3, 4, 5}
    order: Ints = after.trajectory["frame"] * 10 + after.trajectory["id"]
    assert (np.diff(order) > 0).all()
    for name in ("x", "y", "xx"):
        np.testing.assert_array_equal(np.sort(after.trajectory[name]), np.sort(before.trajectory[name]))
    own = after.events[after.events["id"] == 1]
    assert [(int(e["frame"]), bytes(e["kind"])) for e in own] == [(0, b"birth"), (180, b"return"), (399, b"death")]
    assert own["reason"][1].startswith(b"the same person with probability 0.99")
    assert own["reason"][1].endswith(b"s away")


def test_an_answer_that_they_are_two_or_split_is_obeyed() -> None:
    rows, *_ = scene()
    last, first = np.flatnonzero(rows["id"] == 1)[-1], np.flatnonzero(rows["id"] == 6)[0]
    two = Constraints.of([], [(int(last), int(first))])
    assert set(whole(returning(0.99), two).identity.tolist()) == {1, 2, 3, 4, 5, 6}
    rows, *_ = scene()
    rows["id"] = whole(returning(0.99)).identity
    for frame in (100, 150, 180):
        answered = answered_rows(rows, [Answer("", "split", 1, 0, frame)], RATE)
        assert len(answered.constraints) == 1
        assert len(set(whole(returning(0.99), answered.constraints).identity.tolist())) == 6


def coloured(people: dict[int, int], seed: int) -> tuple[Rows, Rows]:
    """Rows of some tracks, each of a person whose clothes are always the same, and what two cameras see of them."""
    rows = committed(rows_of({k: (straight(-4, 2 * k - 7, 0.02, 0), 1.7, range(240)) for k in people}, noise=0.0))
    rows["score"] = 5.0
    clothes = 0.6 * np.random.default_rng(8).normal(size=(20, COLOURS))
    rng = np.random.default_rng(seed)
    gains = rng.normal(size=2)
    seen = []
    for view in range(2):
        looks = np.zeros(len(rows), APPEARANCE)
        looks["frame"], looks["x"], looks["y"], looks["view"] = rows["frame"], rows["raw_x"], rows["raw_y"], view
        own = clothes[[people[k] for k in rows["id"].tolist()]]
        looks["colours"] = own + gains[view] - gains.mean() + 0.2 * rng.normal(size=own.shape)
        looks["features"] = np.nan
        seen.append(looks)
    return rows, np.concatenate(seen)


def test_people_of_an_earlier_run_keep_their_ids() -> None:
    morning, looks = coloured({1: 1, 2: 2, 3: 3, 4: 4, 5: 5}, seed=1)
    morning["id"] += 10
    known = known_people(morning, looks)
    assert known["id"].tolist() == [11, 12, 13, 14, 15]
    assert known["appearance_count"].tolist() == [240] * 5 and known["height"] == pytest.approx(1.7, abs=0.02)
    rows, looks = coloured({1: 4, 2: 9, 3: 1, 4: 8, 5: 7}, seed=2)
    birth = np.array([(0, b"birth", 2, 0, b"")], EVENT)
    found = final_tracks(CommittedRows(rows, birth, looks, known), RATE, BORDER, returning(0.99))
    names = [np.unique(found.identity[rows["id"] == track]).tolist() for track in range(1, 6)]
    assert names[0] == [14] and names[2] == [11]
    assert all(one > 15 for track in (1, 3, 4) for one in names[track])
    assert set(found.trajectory["id"].tolist()) == set(found.identity.tolist())
    told = {int(e["id"]): bytes(e["reason"]) for e in found.events if e["kind"] == b"return"}
    assert set(told) == {11, 14}
    assert all(reason.endswith(b"known from an earlier recording") for reason in told.values())
    assert [int(e["id"]) for e in found.events if e["kind"] == b"birth"] == names[1]


def test_nobody_of_whom_nothing_is_known_is_recognised() -> None:
    rows, looks = coloured({1: 1, 2: 2, 3: 3, 4: 4, 5: 5}, seed=1)
    rows["height"] = np.nan
    known = known_people(rows, looks[:0])
    assert np.isnan(known["height"]).all() and not known["height_count"].any() and not known["appearance_count"].any()
    rows, looks = coloured({1: 1, 2: 2, 3: 3, 4: 4, 5: 5}, seed=2)
    found = final_tracks(CommittedRows(rows, np.zeros(0, EVENT), looks, known), RATE, BORDER, returning(0.9))
    assert found.identity.min() > 5


def test_a_run_file_tells_of_its_people_or_says_why_not(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.h5")
    said = r"--known: found that alone, expected tracking.return_probability below 1"
    refused(ConfigError, said, read_known, path, CONFIG)
    refused(FormatError, r"run.h5: /committed: found no rows", read_known, path, returning(0.99))
    before = np.zeros(2, KNOWN_PERSON)
    before["id"] = 2, 7
    with h5py.File(path, "r+") as file:
        rows = file["trajectory"][:]
        rows["raw_x"] = rows["x"]
        file["trajectory"][:] = rows
        file["committed"].resize((len(rows),))
        file["committed"][:] = rows
        file["known_people"].resize((2,))
        file["known_people"][:] = before
    known = read_known(path, returning(0.99))
    assert known["id"].tolist() == [7, 1, 2] and known["height_count"].tolist() == [0, 6, 3]
    assert digest(known) != digest(known[::-1])
    for ids, message in (((7, 7), "a person twice"), ((0, 7), "an id from 1 on"), ((2, 2**31 - 1), "ids up to")):
        with h5py.File(path, "r+") as file:
            before["id"] = ids
            file["known_people"][:] = before
        refused(FormatError, message, read_known, path, returning(0.99))
    (tmp_path / "text.h5").write_text("not HDF5")
    refused(InputError, r"text\.h5", read_known, tmp_path / "text.h5", returning(0.99))
