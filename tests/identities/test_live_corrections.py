"""Corrections of live ids: what is decided, how it is applied, kept and sent on."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from unittest.mock import Mock

import numpy as np
from checks import drawn
from hypothesis import strategies as st
from run_files import table_of
from scenes import room

from stseg.arrays import Rows
from stseg.config import Config, LiveConfig
from stseg.geometry.grid import Grid
from stseg.io.live.live_tables import CorrectionTable
from stseg.io.live.publishing import Publisher
from stseg.records.border import Border
from stseg.records.tables import APPEARANCE, CORRECTION, TRAJECTORY
from stseg.trajectories.live_ids import LiveCorrections, corrected_ids, renamed

RATE = 10.0
NOTHING = np.zeros(0, APPEARANCE)
BORDER = Border.of(replace(room(), grid=Grid((-6.0, 6.0), (-6.0, 6.0), 0.1, 1.8, 10)))
EXCHANGE = np.array([(50, 20, 50, 1, 2), (50, 20, 50, 2, 1)], CORRECTION)


def walk(track: int, first: int, stop: int, y: float = 0.0, height: float = 1.7) -> Rows:
    """A walk along x at 1 m/s, which is at 0 in frame 50."""
    rows = table_of(TRAJECTORY, frame=np.arange(first, stop), id=track, y=y, raw_y=y, height=height, width=0.42)
    rows["x"] = rows["raw_x"] = (rows["frame"] - 50) / RATE
    rows["xx"], rows["yy"], rows["score"], rows["views"] = 0.03**2, 0.03**2, 10.0, 4
    return rows


def in_windows(rows: Rows, config: Config, fresh: Callable[[], int]) -> Rows:
    """All corrections, if a window of two seconds comes at a time."""
    live = LiveCorrections(RATE, BORDER, config)
    windows = [rows[rows["frame"] // 20 == k] for k in range(int(rows["frame"].max()) // 20 + 1)]
    return np.concatenate([live.decide(window, NOTHING, fresh) for window in windows])


def test_who_is_found_gets_the_first_id_back_in_time() -> None:
    rows = np.concatenate([walk(1, 0, 45), walk(2, 52, 100), walk(3, 0, 100, 3.0)])
    found = in_windows(rows, Config(live=LiveConfig(correction_interval=2.0)), count(4).__next__)
    named = corrected_ids(rows, found)
    assert set(named["id"][rows["y"] == 0.0].tolist()) == {1}
    assert set(named["id"][rows["y"] == 3.0].tolist()) == {3} and found["decision_frame"].min() < 80
    rows = np.concatenate([walk(1, 0, 45), walk(2, 52, 80)])
    for interval in (20.0, 0.0):
        assert len(in_windows(rows, Config(live=LiveConfig(correction_interval=interval)), count(3).__next__)) == 0
    live = LiveCorrections(RATE, BORDER, Config(live=LiveConfig(correction_memory=4.0)))
    for first in range(0, 100, 20):
        live.decide(walk(1, first, first + 20), NOTHING, count(2).__next__)
    assert live._rows["frame"].min() == 60


@drawn(36, st.integers(0, 2**32 - 1))
def test_no_id_stands_twice_in_a_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = rng.permutation(np.arange(4) * 0.6)
    rows = np.concatenate([walk(1 + k, 0, 60, float(y[k])) for k in range(4)])
    late = rows["frame"] >= int(rng.integers(20, 40))
    rows["id"][late] = rng.permutation(np.arange(1, 7))[rows["id"][late] - 1]
    named = corrected_ids(rows, in_windows(rows, Config(live=LiveConfig(correction_interval=2.0)), count(7).__next__))
    assert len(np.unique(np.stack([named["frame"], named["id"]]), axis=1).T) == len(named)


def test_corrections_hold_at_once_and_ids_go_on_corrected() -> None:
    rows = np.concatenate([walk(1, 0, 60), walk(2, 0, 60, 1.0)])
    exchanged = corrected_ids(rows, EXCHANGE)
    within = (rows["frame"] >= 20) & (rows["frame"] <= 50)
    np.testing.assert_array_equal(exchanged["id"], np.where(within, 3 - rows["id"], rows["id"]))
    later = EXCHANGE.copy()
    later["decision_frame"] = 60
    np.testing.assert_array_equal(corrected_ids(rows, np.concatenate([EXCHANGE, later]))["id"], rows["id"])
    assert renamed({10: 1, 11: 2, 12: 5}, EXCHANGE, {10, 11}) == {10: 2, 11: 1, 12: 5}
    found_again = np.array([(50, 40, 50, 7, 1)], CORRECTION)
    assert renamed({10: 1, 20: 7}, found_again, {20}) == {20: 1}
    ended = np.array([(50, 40, 45, 7, 1)], CORRECTION)
    assert renamed({20: 7}, ended, {20}) == {20: 7}


def test_the_table_keeps_whole_lines_before_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "run.h5.live_corrections.csv"
    table = CorrectionTable(path, 0)
    assert not path.exists()
    later = EXCHANGE.copy()
    later["decision_frame"] = 90
    table.append(EXCHANGE)
    table.append(later)
    path.write_text(path.read_text() + "95,1,9\n95,1,-9,2,3\n95,1,9,x,3\n12,")
    np.testing.assert_array_equal(CorrectionTable(path, 100).rows, np.concatenate([EXCHANGE, later]))
    np.testing.assert_array_equal(CorrectionTable(path, 90).rows, EXCHANGE)
    assert path.read_text().splitlines() == [
        "decision_frame,first,last,id,corrected_id",
        "50,20,50,1,2",
        "50,20,50,2,1",
    ]
    assert len(CorrectionTable(path, 0).rows) == 0 and not path.exists()


def test_corrections_are_sent_as_one_message() -> None:
    receiver = Mock()
    with Publisher(receiver, RATE, print) as publisher:
        publisher.correct(EXCHANGE)
        publisher.correct(EXCHANGE[:0])
    ((message,), _) = receiver.send.call_args
    assert receiver.send.call_count == 1
    assert [json.loads(line) for line in message.splitlines()] == [
        {"decision_frame": 50, "first": 20, "last": 50, "id": 1, "corrected_id": 2},
        {"decision_frame": 50, "first": 20, "last": 50, "id": 2, "corrected_id": 1},
    ]
