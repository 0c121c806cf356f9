"""The search of identities, and answers as its hard constraints."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from checks import cases, drawn, refused
from hypothesis import strategies as st
from reference_identities import greatest_score, score
from simulated_people import BORDER, CONFIG, RATE, gone, rows_of, runs, straight, swapped, visit

from stseg.arrays import Floats, Ints, Rows
from stseg.commands.correct import correct
from stseg.errors import FormatError, InputError
from stseg.identities.association import IdentityProblem, associate_globally
from stseg.identities.evidence.observations import Observations, observe
from stseg.identities.evidence.size_model import _POSTURE, SizeModel, learn_heights
from stseg.identities.review.answered_constraints import answered_rows
from stseg.identities.review.corrections import Answer
from stseg.identities.search import beam_search as search
from stseg.identities.search.beam_search import SearchLimits, search_identities
from stseg.identities.search.choice import choose_distinct, empty_present
from stseg.identities.search.constraints import Constraints
from stseg.identities.search.extension import Alternatives
from stseg.identities.search.hypotheses import Hypotheses, Pasts
from stseg.io.runfile.runs import Run, read_run
from stseg.tracking.row_groups import isolated_tracklets

MODEL = SizeModel(
    np.array([1.7]), np.array([0.03**2]), np.array([0.03**2 * 0.5 * RATE]), np.array([0.1**2]), np.full(1, np.inf)
)
LONGEST = 1.0


def seen_of(rows: Rows) -> Observations:
    return observe(rows, [rows["height"].astype(float)], MODEL, RATE, BORDER, CONFIG)


def found(seen: Observations, lag: float = 60.0, hypotheses: int = 400) -> Ints:
    return search_identities(seen, MODEL, CONFIG.motion, SearchLimits(hypotheses, LONGEST, lag)).name


@drawn(60, runs(2))
def test_no_partition_of_a_few_rows_is_better(rows: Rows) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "_ALTERNATIVE_LOSS", 1e5)
        patch.setattr(search, "_BEAM_LOSS", 1e5)
        seen = seen_of(rows[:6])
        names = found(seen, hypotheses=5000).tolist()
    best = greatest_score(seen, MODEL.spread, CONFIG.motion, LONGEST) if len(rows) else 0.0
    assert score(seen, names, MODEL.spread, CONFIG.motion, LONGEST) == pytest.approx(best, abs=1e-6)


def test_early_names_are_of_one_hypothesis_and_later_ones_count() -> None:
    """With a lag too short for sizes to tell, rows of a name are still apart in time, and most names are the same."""
    rows = swapped(rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}), 80)
    seen = seen_of(rows)
    for lag in (0.1, 1.0, 5.0):
        names = found(seen, lag)
        frame = rows["frame"][seen.order]
        assert len(set(zip(frame.tolist(), names.tolist(), strict=True))) == len(rows)
        assert len(set(names.tolist())) <= 4
    np.testing.assert_array_equal(found(seen, 10.0), found(seen))
    # Two are exchanged by the filter while they stand together, unmeasured: both readings are kept until they part.
    true = rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}, noise=0.0)
    true["height"][(true["frame"] >= 66) & (true["frame"] < 110)] = np.nan
    seen = seen_of(swapped(true, 80))
    names, apart = found(seen), np.abs(seen.rows.ground[:, 0]) > 0.5
    assert len(np.unique([names[apart], true["id"][seen.order][apart]], axis=1).T) == 2


@cases()
def test_of_hypotheses_with_the_same_people_the_best_is_kept(
    names: list[list[int]], columns: list[int], distinct: int
) -> None:
    seen = seen_of(rows_of({1: (straight(-3, 0, 0.5, 0), 1.7, range(5))})).rows
    held, pasts = Hypotheses.empty(2, 2, 0), Pasts.empty(4, 1)
    held.past[:], pasts.name[:], pasts.last[:] = [[0, 1], [2, 3]], np.ravel(names), 0
    change, value = np.array([[h, -1, -1, -1, -1] for h in range(2)]), np.array([2.0, 1.0])
    chosen, mark = np.empty(2, np.int64), np.zeros(2, np.int64)
    number = choose_distinct(
        held, pasts, np.array(columns)[:, None], 4, seen, mark, Alternatives(change, value), 2, 60.0,
        empty_present(2, 2), chosen,
    )  # fmt: skip
    assert chosen[:number].tolist() == [0, 1][:distinct]


def heights_of(people: Floats, noise: float, seed: int = 0) -> tuple[Floats, Ints, list[Ints]]:
    """The height of each person in 80 frames, one tracklet a person."""
    rng = np.random.default_rng(seed)
    value = np.repeat(people, 80) + rng.normal(0, noise, 80 * len(people))
    frame = np.tile(np.arange(80), len(people))
    return value, frame, np.split(np.arange(len(value)), len(people))


@pytest.mark.parametrize(("most", "low", "people"), [(np.inf, [1.35], 3), (1.0, [1.35], 2), (np.inf, [1.2] * 10, 2)])
def test_outliers_say_no_more_against_a_person_than_they_may(most: float, low: list[float], people: int) -> None:
    """Two walk side by side; for a frame one of them is measured too short, or stoops from then on."""
    rows = rows_of({k: (straight(-1, 0.5 * k, 0.5, 0), 1.7 + 0.1 * k, range(20)) for k in (1, 2)}, noise=0.0)
    rows["height"][np.flatnonzero(rows["id"] == 1)[10 : 10 + len(low)]] = low
    seen = observe(rows, [rows["height"].astype(float)], MODEL, RATE, BORDER, CONFIG)
    model = replace(MODEL, most_against=np.full(1, most))
    found = search_identities(seen, model, CONFIG.motion, SearchLimits(50, LONGEST, 60.0)).name
    assert len(np.unique(found)) == people


def test_noise_and_spread_of_heights_are_learned_from_enough() -> None:
    people = np.random.default_rng(1).normal(1.7, 0.2, 60)
    model = learn_heights(*heights_of(people, 0.03), RATE, CONFIG)
    assert model.variance[0] == pytest.approx(0.03**2, rel=0.15)
    assert model.spread[0] == pytest.approx(0.2**2, rel=0.3)
    assert model.row_variance[0] - _POSTURE.row_variance(RATE) < 3 * model.variance[0]
    assert learn_heights(*heights_of(np.full(400, 1.7), 0.03), RATE, CONFIG).spread[0] < 0.012**2
    rows = rows_of({1: (visit(-1), 1.7, range(40))})
    tracklets = isolated_tracklets(rows, RATE)
    model = learn_heights(rows["height"].astype(float), rows["frame"], tracklets, RATE, CONFIG)
    assert model.spread[0] == pytest.approx(0.8 * CONFIG.body.height_spread**2, rel=0.05)


def identities(rows: Rows, constraints: Constraints) -> Ints:
    problem = IdentityProblem.of(rows, (), RATE, BORDER, CONFIG, constraints)
    return associate_globally(rows, problem, constraints).identity


def row(rows: Rows, track: int, frame: int) -> int:
    return int(np.flatnonzero((rows["id"] == track) & (rows["frame"] == frame))[0])


def met(frame: int | None = None) -> Rows:
    """Two of one height who meet; exchanged by the filter from a frame on."""
    rows = rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.7, range(160))}, noise=0.0)
    return rows if frame is None else swapped(rows, frame)


APART = ~np.isin(met()["frame"], range(72, 89))


@pytest.mark.parametrize(("swap", "pairs"), [(False, 1), (False, 2), (True, 1), (True, 2), (True, 0)])
def test_one_answer_decides_a_meeting_either_way(swap: bool, pairs: int) -> None:
    """That who came before is who goes, of one or of both; or that somebody is not the one before."""
    rows = met()
    before, after = ([row(rows, track, frame) for track in (1, 2)] for frame in (40, 120))
    same = list(zip(before, after[::-1] if swap else after, strict=True))
    found = identities(rows, Constraints.of(same[:pairs], [] if pairs else [(before[0], after[0])]))
    expected = swapped(rows, 80)["id"] if swap else rows["id"]
    np.testing.assert_array_equal(found[APART], expected[APART])


@drawn(40, runs(4), st.data())
def test_whatever_can_be_true_is_obeyed(rows: Rows, data: st.DataObject) -> None:
    """Constraints of any naming in which nobody is twice in a frame."""
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    naming = np.array([rng.permutation(9)[k] for k in range(9)])
    shuffled = rows["id"].copy()
    for frame in np.unique(rows["frame"]):
        here = rows["frame"] == frame
        if rng.random() < 0.3:
            shuffled[here] = naming[rng.permutation(9)[: here.sum()]]
    pairs = [(a, b) for a in range(len(rows)) for b in range(len(rows)) if rows["frame"][a] < rows["frame"][b]]
    chosen = [pairs[k] for k in rng.permutation(len(pairs))[:6]]
    same = [pair for pair in chosen if shuffled[pair[0]] == shuffled[pair[1]]]
    constraints = Constraints.of(same, [pair for pair in chosen if pair not in same])
    assert not constraints.violated(identities(rows, constraints)).any()


def test_constraints_of_nobody_and_of_no_person_are_nothing() -> None:
    rows = met(80)
    free = identities(rows, Constraints.of([], []))
    told = [(row(rows, 1, 10), row(rows, 1, 20)), (row(rows, 2, 10), row(rows, 2, 60))]
    np.testing.assert_array_equal(identities(rows, Constraints.of(told, [])), free)
    rows = rows_of({k: (straight(-3, k, 0.5, 0), 1.7, range(40)) for k in (1, 2)})
    answered = answered_rows(rows, [Answer("a", "delete", 2, frame=20), Answer("b", "swap", 1, 2, 20)], RATE)
    assert answered.deleted.tolist() == ((rows["id"] == 2) & (rows["frame"] >= 20)).tolist()
    assert len(answered.constraints) == 1
    assert len(answered_rows(rows, [Answer("b", "swap", 1, 2, 20)], RATE).constraints) == 2


def bound(rows: Rows, *answers: Answer) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Track and frame of both rows of what is the same, and of what is not."""
    found = answered_rows(rows, answers, RATE).constraints
    parts = [rows[row][name].tolist() for row in (found.earlier, found.later) for name in ("id", "frame")]
    pairs = list(zip(zip(*parts, strict=True), found.same, strict=True))
    return [pair for pair, same in pairs if same], [pair for pair, same in pairs if not same]


def test_answers_bind_rows_gaps_and_who_was_away_for_long() -> None:
    rows = met()
    away = 2 * np.abs(rows["x"][rows["id"] == 1])
    last, first = int(np.flatnonzero(away[:80] >= 0.8)[-1]), 80 + int(np.flatnonzero(away[80:] >= 0.8)[0])
    assert bound(rows, Answer("a", "swap", 1, 2, 80)) == ([(1, last, 2, first), (2, last, 1, first)], [])
    assert bound(rows, Answer("a", "keep", 1, 2, 80)) == ([(1, last, 1, first), (2, last, 2, first)], [])
    assert bound(rows, Answer("a", "split", 1, frame=80)) == ([], [(1, last, 1, first)])
    rows = gone(2.0)
    assert bound(rows, Answer("a", "join", 1, 2)) == ([(1, 23, 2, 40)], [])
    assert bound(rows, Answer("a", "keep", 1, 2, 30)) == ([], [(1, 23, 2, 40)])
    assert bound(rows, Answer("a", "keep", 1, frame=10)) == ([], [])
    absence = CONFIG.tracking.maximum_gap + 3.0
    rows = gone(absence)
    last, first = row(rows, 1, 23), row(rows, 2, 24 + round(absence * RATE))
    assert len(set(identities(rows, Constraints.of([], [])).tolist())) == 2
    assert len(set(identities(rows, Constraints.of([(last, first)], [])).tolist())) == 1
    near = gone(2.0)
    pair = [(row(near, 1, 23), row(near, 2, 40))]
    assert len(set(identities(near, Constraints.of([], pair)).tolist())) == 2


def solved(run: Path, output: Path, *answers: str) -> Run:
    """The run that these answers make of another."""
    table = output.with_suffix(".csv")
    table.write_text("\n".join(["action,frame,id,other,name", *answers, ""]))
    correct(run, table, output=output)
    return read_run(output)


def test_a_run_is_solved_again(undisturbed: Path, tmp_path: Path) -> None:
    """Without answers nothing changes; a swap exchanges tracks and labels, and names follow; the rest stays."""
    run = read_run(undisturbed)
    assert len(run.committed) >= len(run.trajectory) - 5
    same = solved(undisturbed, tmp_path / "same.h5", "keep,20,1,,")
    for name in ("trajectory", "tracks", "boxes"):
        assert getattr(same, name).tobytes() == getattr(run, name).tobytes()
    new = solved(undisturbed, tmp_path / "new.h5", "swap,20,1,2,", "name,,2,,Bo", "delete,,3,,")
    assert set(new.tracks["id"].tolist()) == {1, 2} and new.names == {2: "Bo"}
    for frame in (2, 26):
        places = [
            {int(r["id"]): (r["raw_x"], r["raw_y"]) for r in one.trajectory[one.trajectory["frame"] == frame]}
            for one in (run, new)
        ]
        crossed = (1, 2) if frame < 20 else (2, 1)
        assert [places[1][1], places[1][2]] == [places[0][k] for k in crossed]
        before, after = run.read_frame(frame)[1], new.read_frame(frame)[1]
        table = np.zeros(int(before.max()) + 1, before.dtype)
        table[list(crossed)] = 1, 2
        np.testing.assert_array_equal(after, table[before])
    np.testing.assert_array_equal(new.read_frame(20)[0], run.read_frame(20)[0])


def test_a_second_correction_keeps_earlier_answers(undisturbed: Path, tmp_path: Path) -> None:
    """Two corrections one after the other are both at once; an old one holds, whatever a later one says."""
    one = tmp_path / "one.h5"
    solved(undisturbed, one, "swap,20,1,2,")
    two = solved(one, tmp_path / "two.h5", "delete,,3,,")
    both = solved(undisturbed, tmp_path / "both.h5", "swap,20,1,2,", "delete,,3,,")
    assert two.trajectory.tobytes() == both.trajectory.tobytes()
    assert sorted(two.answers.tolist()) == sorted(both.answers.tolist())
    refused(InputError, "contradicts others", solved, one, tmp_path / "back.h5", "swap,20,1,2,")
    with h5py.File(one, "r+") as file:
        file["answers"].resize((0,))  # what was answered is not known: nothing is solved again
    left = (before := read_run(one).trajectory)[before["id"] != 3]
    assert solved(one, tmp_path / "three.h5", "delete,,3,,").trajectory.tobytes() == left.tobytes()


def test_missing_rows_and_answers_that_cannot_be_are_refused(undisturbed: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.h5"
    solved(undisturbed, new, "swap,20,1,2,")
    with h5py.File(new, "r+") as file:
        file["answers"][0] = (10**6, 10**6 + 1, 1)
    refused(FormatError, "/answers: found row 1000001", solved, new, tmp_path / "more.h5", "swap,20,1,2,")
    other = tmp_path / "other.h5"
    refused(InputError, "contradicts others", solved, undisturbed, other, "swap,20,1,2,", "keep,20,1,2,")
    assert not other.exists()


def test_constraints_that_nobody_can_obey_are_named() -> None:
    frame = np.array([0, 0, 5, 5, 9])
    swapped = [(0, 3), (1, 2)]
    for same, other, wrong in (
        (swapped, [], 0),
        ([*swapped, (0, 2)], [], 3),  # all four are one, two of them at once
        ([(0, 2), (2, 4)], [(0, 4)], 1),
    ):
        assert np.count_nonzero(Constraints.of(same, other).contradictory(frame)) == wrong
