"""The queue of doubts and its page in a real browser; answers as corrections of a run."""

from dataclasses import astuple
from pathlib import Path
from typing import Any
from unittest.mock import patch

import h5py
import numpy as np
import pytest
from browser import CHROMIUM, chromium
from checks import Captured, cases, in_ci, refused
from run_files import table_of, write_small_run
from simulated_people import open_area

from stseg import InputError, read_run
from stseg.arrays import Floats, Rows
from stseg.commands.correct import correct
from stseg.commands.export import export
from stseg.commands.report import report
from stseg.commands.review import review
from stseg.commands.terminal.counts import counted
from stseg.identities.review.corrections import ACTIONS, Answer, Corrections, solve_corrections
from stseg.identities.review.doubts import _together, find_doubts
from stseg.io.answers import read_answers
from stseg.records.tables import TRACK, TRAJECTORY, Tracks
from stseg.tasks.review import question_words

BORDER = open_area(5.0)


def walk(identity: int, first: int, x: Floats, y: float, height: float, score: float = 9.0) -> Rows:
    frame = first + np.arange(len(x))
    return table_of(TRAJECTORY, frame=frame, id=identity, x=x, y=y, height=height, score=score)


def encounter(first: float, second: float) -> Rows:
    """Two of these heights who walk through each other at frame 50."""
    x = np.linspace(-4, 4, 101)
    return np.concatenate([walk(1, 0, x, 0.0, first), walk(2, 0, -x, 0.2, second)])


def test_alike_people_and_impossible_swaps_are_doubtful() -> None:
    margins = []
    for heights in ((1.6, 1.9), (1.75, 1.75)):
        rows = encounter(*heights)
        (doubt,) = find_doubts(rows, 10.0, BORDER)
        assert (doubt.question, doubt.track, doubt.other, doubt.first, doubt.last) == ("encounter", 1, 2, 46, 54)
        margins.append(doubt.margin)
    assert margins[0] > margins[1] > 0
    rows = encounter(1.75, 1.75)
    later = rows["frame"] > 50
    rows["id"][later] = 3 - rows["id"][later]
    (doubt,) = find_doubts(rows, 10.0, BORDER)
    assert doubt.margin < 0


def test_gaps_weak_tracks_and_those_at_one_time_are_asked() -> None:
    lots = np.random.default_rng(2)
    spans = {int(k): np.sort(lots.integers(0, 60, 2)) for k in lots.permutation(30) + 1}
    tracks = {k: walk(k, int(first), np.zeros(last - first + 1), 0.0, 1.7) for k, (first, last) in spans.items()}
    together = [
        (a, b) for a in range(1, 31) for b in range(a + 1, 31)
        if spans[a][0] <= spans[b][1] and spans[b][0] <= spans[a][1]
    ]  # fmt: skip
    assert 0 < len(together) < 435 and list(_together(tracks)) == together
    rows = np.concatenate(
        [walk(1, 0, np.linspace(-4.8, 0, 61), 0.0, 1.7), walk(2, 70, np.linspace(0.7, 4.8, 61), 0.0, 1.7),
         walk(3, 20, np.linspace(2, 2.2, 10), 3.0, 1.7, 0.5)]
    )  # fmt: skip
    doubts = find_doubts(rows, 10.0, BORDER)
    assert {(one.question, one.track, one.other) for one in doubts} >= {("gap", 1, 2), ("false", 3, 0)}
    assert find_doubts(rows[:0], 10.0, BORDER) == []
    # The filter's track 1 passes on to somebody else, and track 2 begins where its person is.
    rows = np.concatenate(
        [walk(1, 0, np.linspace(-4, 0, 51), 0.0, 1.7), walk(1, 51, np.linspace(1.2, 1.3, 5), 1.2, 1.7),
         walk(2, 51, np.linspace(0.08, 4, 50), 0.0, 1.7)]
    )  # fmt: skip
    doubts = find_doubts(rows, 10.0, BORDER)
    assert ("birth", 1, 2, 50, 51) in {(one.question, one.track, one.other, one.first, one.last) for one in doubts}


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")
def test_one_key_answers_and_the_answers_correct_the_run(tmp_path: Path, capsys: Captured) -> None:
    run = write_small_run(tmp_path / "run.h5")
    review(run, output=tmp_path / "review.html")
    assert "1 question\n" in capsys.readouterr().out
    with patch("stseg.tasks.review._LEAST_CHANCE", 1.0):
        review(run, output=tmp_path / "certain.html")
    assert "0 questions" in capsys.readouterr().out, "what is certain is not asked"
    with chromium(tmp_path / "profile") as page:
        page.open(tmp_path / "review.html")
        drawn = page.picture(1280, 900)
        page.ask("dispatchEvent(new KeyboardEvent('keydown', { key: ' ' })), 0")
        page.wait_for("document.getElementById('slider').value === document.getElementById('slider').max")
        assert page.picture(1280, 900) != drawn and page.picture(400, 900)
        assert page.ask("document.documentElement.scrollWidth <= 400"), "narrow screens need no scrolling sideways"
        asked = page.ask("document.getElementById('question').textContent")
        assert "Are 1 and 2 after the encounter" in asked and "wrong with a probability of" in asked
        page.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '2' })), 0")
        text = page.ask("document.getElementById('csv').value")
        assert page.complaints == [] and page.requests == []
        page.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '0' })), 0")
        assert page.ask("document.getElementById('csv').value") == "action,frame,id,other,name\n", "cannot tell"
    assert text == "action,frame,id,other,name\nswap,14,1,2,\n"
    (tmp_path / "answers.csv").write_text(text)
    correct(run, tmp_path / "answers.csv", output=tmp_path / "new.h5")
    rows = read_run(tmp_path / "new.h5").trajectory
    assert rows["x"][(rows["frame"] == 15) & (rows["id"] == 2)] == pytest.approx(0.15)


@pytest.mark.parametrize("seed", [0, *in_ci(1)])
def test_every_answer_to_every_question_is_accepted(tmp_path: Path, seed: int) -> None:
    """Tracks that begin, end, meet and pass on to others anywhere."""
    lots = np.random.default_rng(seed)
    spans = np.sort(lots.integers(0, 120, (25, 2)), axis=1) + np.array([0, 5])
    rows = np.concatenate(
        [
            walk(k + 1, int(first), lots.uniform(-3, 3) + np.cumsum(lots.normal(0, 0.1, last - first + 1)), 0.0, 1.7)
            for k, (first, last) in enumerate(spans)
        ]
    )
    rows["score"] = lots.uniform(0, 2, len(rows))
    doubts = find_doubts(rows, 10.0, BORDER)
    assert {one.question for one in doubts} == {"encounter", "gap", "birth", "false"}
    for doubt in doubts:
        for _, _, lines in question_words(doubt)[1]:
            (tmp_path / "a.csv").write_text(f"action,frame,id,other,name\n{lines}\n")
            answers = [Answer(*astuple(row)) for row in read_answers(tmp_path / "a.csv", ACTIONS)]
            assert len(answers) == lines.count("\n") + 1
            solve_corrections(Tracks(rows).summary(), answers)


def tracks(*spans: tuple[int, int]) -> Rows:
    rows = np.zeros(len(spans), TRACK)
    for k, (first, last) in enumerate(spans):
        rows[k]["id"], rows[k]["first"], rows[k]["last"] = k + 1, first, last
    return rows


def of(solved: Corrections, track: int, *frames: int) -> list[int]:
    return [int(one) for one in solved.map(np.full(len(frames), track), np.array(frames))]


TWO = tracks((0, 99), (0, 99))


def test_swap_join_split_delete_and_name() -> None:
    solved = solve_corrections(TWO, [Answer("a", "swap", 1, 2, 50)])
    assert of(solved, 1, 0, 49, 50, 99) == [1, 1, 2, 2] and of(solved, 2, 49, 50) == [2, 1]
    solved = solve_corrections(TWO, [Answer("b", "swap", 2, 1, 70), Answer("a", "swap", 1, 2, 50)])
    assert of(solved, 1, 49, 50, 69, 70) == [1, 2, 2, 1]
    three = tracks((0, 40), (45, 99), (0, 99))
    solved = solve_corrections(three, [Answer("a", "join", 1, 2), Answer("b", "name", 2, name="Ann")])
    assert of(solved, 2, 45, 99) == [1, 1] and solved.names == {1: "Ann"}
    solved = solve_corrections(three, [Answer("a", "split", 3, frame=50)])
    assert of(solved, 3, 49, 50) == [3, 4]
    solved = solve_corrections(three, [Answer("a", "delete", 3, frame=50), Answer("b", "delete", 1)])
    assert of(solved, 3, 49, 50) == [3, 0] and of(solved, 1, 10) == [0]
    of_one_alone = solve_corrections(three, [Answer("a", "split", 3, 9, 50), Answer("b", "delete", 1, 8)])
    assert of(of_one_alone, 3, 50) != of(of_one_alone, 3, 49) and of(of_one_alone, 1, 0) == [0]
    assert of(solve_corrections(three, []), 0, 5) == [0]


def test_a_swap_at_an_end_hands_over_and_it_is_joined_once() -> None:
    solved = solve_corrections(tracks((0, 99), (60, 99)), [Answer("a", "swap", 1, 2, 60)])
    assert of(solved, 1, 59, 60) == [1, 2] and of(solved, 2, 60) == [1]
    twice = [Answer("a", "join", 1, 2), Answer("b", "join", 1, 3)]
    refused(InputError, "joined already", solve_corrections, tracks((0, 9), (20, 29), (20, 29)), twice)


@cases()
def test_answers_that_cannot_be_are_named(answer: Any, message: str) -> None:
    refused(InputError, message, solve_corrections, TWO, [Answer(*answer)])


def test_the_command_leaves_the_run_and_names_go_through(tmp_path: Path, capsys: Captured) -> None:
    run = write_small_run(tmp_path / "run.h5")
    before = run.read_bytes()
    answers = tmp_path / "answers.csv"
    answers.write_text("action,frame,id,other,name\nswap,14,1,2,\nname,,2,,Bo\n")
    correct(run, answers, output=tmp_path / "new.h5")
    assert "2 answers, 2 changes; 2 tracks" in capsys.readouterr().out and counted(1, "answer") == "1 answer"
    old, new = read_run(run), read_run(tmp_path / "new.h5")
    rows = [(int(f), int(i), round(float(x), 2)) for f, i, x in new.trajectory[["frame", "id", "x"]]]
    assert (13, 1, 0.15) in rows and (14, 2, 0.15) in rows and (14, 1, 0.3) in rows and (13, 2, 0.3) in rows
    assert new.names == {2: "Bo"} and old.names == {} and run.read_bytes() == before
    (log_odds, label), (log_odds_before, label_before) = new.read_frame(15), old.read_frame(15)
    np.testing.assert_array_equal(log_odds, log_odds_before)
    np.testing.assert_array_equal(label, np.array([0, 2, 1])[label_before])
    with h5py.File(tmp_path / "new.h5") as file:
        assert file["provenance/answers"].asstr()[()].startswith("action,frame")
    (tmp_path / "names.csv").write_text('id,name\n2,"Bo, the <second>"\n9,Cy\n')
    export(run, to="csv", output=tmp_path / "t.csv", names=tmp_path / "names.csv")
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines[0].endswith(",name") and lines[1].endswith(",") and lines[-1].endswith(',"Bo, the <second>"')
    export(run, to="geojson", output=tmp_path / "t.geojson", names=tmp_path / "names.csv")
    assert '"name": "Bo, the <second>"' in (tmp_path / "t.geojson").read_text()
    assert "names of tracks that the run has not: [9]" in capsys.readouterr().err
    report(run, output=tmp_path / "r.html", names=tmp_path / "names.csv")
    assert "Bo, the &lt;second&gt;" in (tmp_path / "r.html").read_text()
