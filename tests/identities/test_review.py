"""The queue of doubts, and its page in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, chromium
from run_files import write_small_run

from stseg.arrays import Rows
from stseg.commands.correct import correct
from stseg.commands.review import review
from stseg.identities.review.doubts import _together, find_doubts
from stseg.io.runfile.runs import read_run
from stseg.records.tables import TRAJECTORY, Tracks

BORDER = np.array([[-5.0, -5.0], [5.0, 5.0]])


def walk(identity: int, first: int, x: list[float], y: float, height: float, score: float = 9.0) -> Rows:
    rows = np.zeros(len(x), TRAJECTORY)
    rows["frame"], rows["id"], rows["x"], rows["y"] = first + np.arange(len(x)), identity, x, y
    rows["height"], rows["score"] = height, score
    return rows


def line(start: float, stop: float, count: int) -> list[float]:
    return [float(x) for x in np.linspace(start, stop, count)]


def encounter(heights: tuple[float, float]) -> Rows:
    """Two who walk through each other at frame 50."""
    return np.concatenate(
        [walk(1, 0, line(-4, 4, 101), 0.0, heights[0]), walk(2, 0, line(4, -4, 101), 0.2, heights[1])]
    )


def test_alike_people_are_more_doubtful_than_different_ones() -> None:
    margins = []
    for heights in ((1.6, 1.9), (1.75, 1.75)):
        rows = encounter(heights)
        (doubt,) = find_doubts(rows, Tracks(rows).summary(), 10.0, BORDER)
        assert (doubt.question, doubt.track, doubt.other, doubt.first, doubt.last) == ("encounter", 1, 2, 46, 54)
        margins.append(doubt.margin)
    assert margins[0] > margins[1] > 0


def test_a_swap_that_motion_denies_comes_first() -> None:
    rows = encounter((1.75, 1.75))
    later = rows["frame"] > 50
    rows["id"][later] = 3 - rows["id"][later]
    (doubt,) = find_doubts(rows, Tracks(rows).summary(), 10.0, BORDER)
    assert doubt.margin < 0


def test_gaps_and_weak_tracks_are_asked_about() -> None:
    rows = np.concatenate(
        [walk(1, 0, line(-4.8, 0, 61), 0.0, 1.7), walk(2, 70, line(0.7, 4.8, 61), 0.0, 1.7),
         walk(3, 20, line(2, 2.2, 10), 3.0, 1.7, 0.5)]
    )  # fmt: skip
    doubts = find_doubts(rows, Tracks(rows).summary(), 10.0, BORDER)
    assert {(one.question, one.track, one.other) for one in doubts} >= {("gap", 1, 2), ("false", 3, 0)}


def test_who_appears_beside_a_track_may_be_who_that_was() -> None:
    """The filter's track 1 passes on to somebody else, and track 2 begins where its person is."""
    rows = np.concatenate(
        [walk(1, 0, line(-4, 0, 51), 0.0, 1.7), walk(1, 51, line(1.2, 1.3, 5), 1.2, 1.7),
         walk(2, 51, line(0.08, 4, 50), 0.0, 1.7)]
    )  # fmt: skip
    doubts = find_doubts(rows, Tracks(rows).summary(), 10.0, BORDER)
    assert ("birth", 1, 2, 50, 51) in {(one.question, one.track, one.other, one.first, one.last) for one in doubts}


def test_tracks_that_are_there_at_one_time_are_compared() -> None:
    lots = np.random.default_rng(2)
    spans = {int(k): np.sort(lots.integers(0, 60, 2)) for k in lots.permutation(30) + 1}
    rows = {k: walk(k, int(first), [0.0] * int(last - first + 1), 0.0, 1.7) for k, (first, last) in spans.items()}
    together = [
        (a, b) for a in range(1, 31) for b in range(a + 1, 31)
        if spans[a][0] <= spans[b][1] and spans[b][0] <= spans[a][1]
    ]  # fmt: skip
    assert 0 < len(together) < 435
    assert list(_together(rows)) == together


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")
def test_one_key_answers_and_the_answers_correct_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = write_small_run(tmp_path / "run.h5")
    review(run, output=tmp_path / "review.html")
    assert "1 questions" in capsys.readouterr().out
    with chromium(tmp_path / "profile") as page:
        page.open(tmp_path / "review.html")
        page.wait_for("document.querySelector('.item:not([hidden]) img').naturalWidth > 50")
        assert "Are 1 and 2 after the encounter" in page.ask(
            "document.querySelector('.item:not([hidden]) h2').textContent"
        )
        page.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '2' })), 0")
        text = page.ask("document.getElementById('csv').value")
        assert page.complaints == [] and page.requests == []
    assert text == "action,frame,id,other,name\nswap,14,1,2,\n"
    (tmp_path / "answers.csv").write_text(text)
    correct(run, tmp_path / "answers.csv", output=tmp_path / "new.h5")
    rows = read_run(tmp_path / "new.h5").trajectory
    assert rows["x"][(rows["frame"] == 15) & (rows["id"] == 2)] == pytest.approx(0.15)


def test_without_tracks_nothing_is_doubted() -> None:
    assert find_doubts(np.zeros(0, TRAJECTORY), Tracks(np.zeros(0, TRAJECTORY)).summary(), 10.0, BORDER) == []
