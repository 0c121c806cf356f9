"""The day of the experiment `day`: what a tracker would commit of people who come, meet and go."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tools"))

from experiments.day import births, measured, simulated_day

DAY = simulated_day(3000, 4)


def test_a_person_has_one_row_a_frame_and_several_tracks_in_time() -> None:
    frame, track, person = DAY.rows["frame"], DAY.rows["id"], DAY.person
    assert len(DAY.rows) == 3000 and (np.diff(frame) >= 0).all()
    for who in (track, person):
        assert len(np.unique(np.stack([frame, who]), axis=1).T) == 3000
    assert len(np.unique(track)) > 1.2 * len(np.unique(person)) > 6


def test_tracks_are_born_and_die_once() -> None:
    events = births(DAY.rows)
    for kind, end in ((b"birth", np.min), (b"death", np.max)):
        told = {int(one["id"]): int(one["frame"]) for one in events[events["kind"] == kind]}
        ids = np.unique(DAY.rows["id"]).tolist()
        assert told == {one: int(end(DAY.rows["frame"][DAY.rows["id"] == one])) for one in ids}


def test_parts_are_of_the_first_frames() -> None:
    half = DAY.first(2)
    assert 1500 <= len(half.rows) < 1510
    assert half.rows["frame"].max() < DAY.rows["frame"][len(half.rows)]


def test_what_it_takes_is_told() -> None:
    assert measured(DAY.first(8), colours=True, least=0.99).startswith("3")
