"""A truth in another unit, with other axes, frames or ground is named; tracks that are merely bad get no advice."""

import re
from pathlib import Path

import numpy as np
import pytest
from checks import Captured, cases, data_path
from scenes import walkers

from stseg.arrays import Rows
from stseg.commands.main import main
from stseg.evaluation.advice import delay_advice, reading_advice
from stseg.io.track_csv import read_tracks_csv, write_tracks_csv

GATE = 0.5


@pytest.fixture(params=["walkers", "laboratory/truth.csv", "uu4/reference_tracks.csv"])
def tracks(request: pytest.FixtureRequest) -> Rows:
    """Tracks whose truth is known: the truth of up to 100 frames, one row in five missed."""
    rows = walkers(40) if request.param == "walkers" else read_tracks_csv(data_path(request.param))
    rows = rows[rows["frame"] < 100]
    return rows[np.random.default_rng(4).random(len(rows)) < 0.8]


def moved(rows: Rows, factor: complex, shift: complex = 0, mirrored: bool = False, frames: int = 0) -> Rows:
    """Rows on another ground, with other frames, and with errors of 5 cm."""
    chance, changed = np.random.default_rng(3), rows.copy()
    place = rows["x"] + 1j * rows["y"] + chance.normal(0, 0.05, (len(rows), 2)) @ [1, 1j]
    place = factor * (place.conj() if mirrored else place) + shift
    changed["x"], changed["y"], changed["frame"] = place.real, place.imag, rows["frame"] + frames
    return changed


@cases(
    (1j, 0, True, 0, "with x and y exchanged"),
    (100j, 0, True, 0, "in centimetres with x and y exchanged"),
    (np.exp(-1j), 3 + 7j, False, 0, r"turned by 5\d degrees, scaled by (1|0\.99) and shifted \(--align\)"),
    (2 * np.exp(-1j), 3 + 7j, False, 0, r"turned by 5\d degrees, scaled by 0\.5 and shifted \(--align\)"),
)
def test_the_reading_that_would_match_is_named(
    tracks: Rows, factor: complex, shift: complex, mirrored: bool, frames: int, named: str
) -> None:
    advice = reading_advice(moved(tracks, factor, shift, mirrored, frames), tracks, GATE)
    assert advice is not None and re.search(f"if the truth is {named}", advice)


def test_a_late_truth_is_named(tracks: Rows) -> None:
    late, early = (moved(tracks, 1, frames=frames) for frames in (1, -3))
    assert "from frame +1" in str(delay_advice(late, tracks, GATE)) and delay_advice(late[:49], tracks, GATE) is None
    assert "from frame -3" in str(delay_advice(early, tracks, GATE))


def test_tracks_that_match_or_are_bad_get_no_advice(tracks: Rows) -> None:
    assert reading_advice(moved(tracks, 1), tracks, GATE) is None is delay_advice(moved(tracks, 1), tracks, GATE)
    assert reading_advice(tracks[:0], tracks, GATE) is None is reading_advice(tracks, tracks[:0], GATE)
    few = reading_advice(moved(tracks[:2], 1, frames=13), tracks, GATE)
    assert few is None or "hardly a row" in few, "many shifts fit two rows by chance"
    chance, strange = np.random.default_rng(1), tracks.copy()
    low, high = strange["x"].min(), strange["x"].max()
    steps = chance.normal(0, 0.3, len(strange)).cumsum()
    strange["x"] = low + np.abs((steps - low) % (2 * (high - low)) - (high - low))
    strange["y"] = chance.permutation(strange["y"])
    assert reading_advice(strange, tracks, GATE) is None
    room = read_tracks_csv(data_path("laboratory/truth.csv"))
    assert "turned" not in str(reading_advice(room[room["frame"] < 100], tracks, GATE)), "any crowds fit in part"


def test_the_command_says_it(tmp_path: Path, capsys: Captured) -> None:
    tracks = walkers(40)
    for name, rows in (("tracks.csv", tracks), ("truth.csv", moved(tracks, 100))):
        write_tracks_csv(tmp_path / name, rows)
    assert main(["evaluate", str(tmp_path / "tracks.csv"), str(tmp_path / "truth.csv"), "--json"]) == 0
    assert "warning: tracks meet 0 % of the truth's rows, and 100 % if the truth is in cent" in capsys.readouterr().err
