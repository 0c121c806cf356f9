"""The page of a run: its data and its answers."""

import base64
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import run_files
from checks import drawn
from hypothesis import strategies as st

from stseg.arrays import AnyArray, Bytes, Labels, Rows, Singles, even_rows
from stseg.commands.report import report
from stseg.geometry import Grid
from stseg.io.runfile.layout import ghost_type
from stseg.io.runfile.runs import RunWriter, read_run
from stseg.records.ghost_reasons import ghost_reasons
from stseg.records.tables import EVENT, TRAJECTORY, Tracks
from stseg.reporting.page.answers import answers
from stseg.reporting.page.embedded import Sheets, coarse, embedded_json, thin_sheets, thin_tracks
from stseg.reporting.pictures.maps import DwellPlace
from stseg.reporting.run_statistics import Span

GRID = Grid((0.0, 4.0), (-1.0, 2.0), 0.5, 1.8, 3)
NO_FRAMES = np.zeros(0, np.int64)


def volume_of(frame: int) -> tuple[Singles, Labels]:
    """Noise, with a cell that no view sees and one that says as many nats as the frame's number."""
    log_odds = np.random.default_rng(frame).normal(0, 2, GRID.shape).astype(np.float32)
    log_odds[0, 0, 0], log_odds[2, 5, 7] = np.nan, frame
    return log_odds, np.zeros(GRID.shape, np.int32)


def decoded(png: bytes) -> Bytes:
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED), np.uint8)


def test_a_sheet_gives_the_log_odds_back() -> None:
    sheets = thin_sheets(np.arange(3, 7), GRID, volume_of, 10**6, NO_FRAMES)
    assert sheets.frames.tolist() == [3, 4, 5, 6] and sheets.shape == GRID.shape
    for frame, png in zip(sheets.frames.tolist(), sheets.pngs, strict=True):
        grey = decoded(png).reshape(sheets.shape)[:, ::-1].astype(float)
        log_odds, _ = volume_of(frame)
        np.testing.assert_array_equal(grey == 0, np.isnan(log_odds))
        clipped = np.clip(log_odds, -sheets.limit, sheets.limit)
        read = (grey - 64) / 63 * sheets.limit
        np.testing.assert_allclose(read[grey > 0], clipped[grey > 0], atol=0.51 * sheets.limit / 63)


def test_sheets_keep_to_their_budget_also_of_large_ground() -> None:
    frames = np.arange(200)
    whole = thin_sheets(frames, GRID, volume_of, 10**7, NO_FRAMES)
    budget = sum(map(len, whole.pngs)) // 3
    thin = thin_sheets(frames, GRID, volume_of, budget, np.array([77]))
    assert len(whole.frames) == 200
    assert 77 in thin.frames and 40 < len(thin.frames) < 70
    assert sum(map(len, thin.pngs)) - len(thin.pngs[thin.frames.tolist().index(77)]) <= budget
    assert len(thin_sheets(np.arange(5000), GRID, volume_of, 10**9, NO_FRAMES).frames) == 400
    assert thin_sheets(NO_FRAMES, GRID, volume_of, 10**6, NO_FRAMES).pngs == []
    log_odds = np.full((1, 5, 4), np.nan, np.float32)
    log_odds[0, 0, 0], log_odds[0, 1, 1], log_odds[0, 4, 3] = -2, 1, -1
    found = coarse(log_odds, 2)
    np.testing.assert_array_equal(found, [[[1, np.nan], [np.nan, np.nan], [np.nan, -1]]])
    np.testing.assert_array_equal(coarse(log_odds, 1), log_odds)


@drawn(30, st.integers(1, 60), st.integers(2, 20))
def test_even_rows_reach_from_end_to_end(count: int, most: int) -> None:
    chosen = even_rows(count, most)
    assert len(chosen) == min(count, most) and len(np.unique(chosen)) == len(chosen)
    assert chosen[0] == 0 and chosen[-1] == count - 1


def walks(frames: int, people: int) -> Rows:
    """People on circles of their own, sorted by frame."""
    frame, person = np.divmod(np.arange(frames * people), people)
    x, y = 2 + np.cos(frame / 50 + person), 0.5 + 0.5 * np.sin(frame / 50 + person)
    return run_files.table_of(TRAJECTORY, frame=frame, id=person + 1, height=1.7, score=3, x=x, y=y)


def test_thin_tracks_keep_ends_and_moments() -> None:
    table = walks(1000, 4)
    thin, stride = thin_tracks(table, np.array([501, 777]), 500)
    assert stride == 8 and 500 <= len(thin) <= 520
    for identity in range(1, 5):
        frames = thin["frame"][thin["id"] == identity]
        assert {0, 501, 777, 999} <= set(frames.tolist())
        assert (np.diff(frames) > 0).all() and np.diff(frames).max() <= stride
    whole, stride_of_whole = thin_tracks(table, NO_FRAMES)
    assert stride_of_whole == 1 and len(whole) == len(table)
    assert len(thin_tracks(table[:0], NO_FRAMES)[0]) == 0


def embedded(trajectory: Rows, candidates: Rows, frames: AnyArray, tmp_path: Path) -> dict[str, object]:
    rig = run_files.small_recording(tmp_path).rig
    sheets = Sheets(frames, GRID.shape, 1.0, [b""] * len(frames))
    text = embedded_json(rig, np.ones(rig.grid.shape, np.uint8), trajectory, candidates, sheets, {1: "Ann"})
    assert "<" not in text
    found: dict[str, object] = json.loads(text)
    return found


def test_places_come_back_and_candidates_say_why_they_went(tmp_path: Path) -> None:
    table = walks(40, 3)
    tracks = embedded(table, run_files.small_ghosts(), np.arange(40), tmp_path)["tracks"]
    assert isinstance(tracks, dict)
    frame, x, y = (
        np.frombuffer(base64.b64decode(tracks[name]), kind)
        for name, kind in (("frame", "<i4"), ("x", "<i2"), ("y", "<i2"))
    )
    order = np.lexsort((table["frame"], table["id"]))
    np.testing.assert_array_equal(frame, table["frame"][order])
    np.testing.assert_allclose(x * tracks["quantum"], table["x"][order], atol=0.0051)
    np.testing.assert_allclose(y * tracks["quantum"], table["y"][order], atol=0.0051)
    assert tracks["counts"] == [40, 40, 40]
    data = embedded(walks(1, 1), run_files.small_ghosts(), np.array([10, 12]), tmp_path)
    assert data["ghosts"] == [1, 0]
    assert data["candidates"] == [[[0, 0, 0, -1, [2, 0]], [0, 0, 0, 0, [-1, 0]]], []]


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """54,000 frames of few cells; five people at a time, each for 500 frames, and five ghosts."""
    folder = tmp_path_factory.mktemp("hour")
    recording, path, count = run_files.small_recording(folder), folder / "hour.h5", 54_000
    volume, label = run_files.small_volume(2000)
    table = walks(count, 5)
    table["id"] += 5 * (table["frame"] // 500)
    table["x"], table["y"] = 0.15 * table["x"], 0.2 + 0.1 * table["y"]
    number, (x, y) = np.arange(count * 10), np.random.default_rng(0).uniform(0, 0.4, (2, count * 10))
    ghosts = run_files.table_of(ghost_type(2), frame=number // 10, status=number % 2, x=x, y=y)
    ghosts["parts"] = np.where(ghosts["status"] == 1, 3, -2)[:, None]
    ghosts["evidence"] = 2 * ghosts["parts"][:, 0] - 3
    events = run_files.table_of(EVENT, kind=b"merge", reason=b"their cells touch", frame=np.arange(5000))
    with RunWriter(path, recording, np.ones((3, 4, 6), np.uint8), run_files.CONFIG, overwrite=False) as writer:
        for first in range(0, count, len(volume)):
            run_files.append_frames(writer, np.arange(first, first + len(volume)), volume, label)
        writer.append("trajectory", table)
        writer.append("ghosts", ghosts)
        writer.append("events", events)
        writer.finish(Tracks(table).summary())
    return path


@pytest.mark.slow
def test_the_page_of_an_hour_stays_below_30_megabytes(hour: Path, tmp_path: Path) -> None:
    assert len(read_run(hour).frames) == 54_000
    report(hour, output=tmp_path / "hour.html")
    assert 10**6 < (tmp_path / "hour.html").stat().st_size < 30 * 10**6


PLACES = [DwellPlace(1.0, 2.0, 0.4), DwellPlace(-1.0, 0.0, 0.2)]


def answers_of(places: list[DwellPlace], shares: list[float], dropped: int = 0) -> list[str]:
    """The four answers of the small run, without their tags."""
    trajectory, candidates = run_files.small_trajectory(), run_files.small_ghosts()
    events = run_files.table_of(EVENT, kind=np.repeat(b"dropped", dropped))
    found = answers(
        Span(10, 16, 5.0), 6, trajectory, Tracks(trajectory).summary(), events, len(candidates),
        ghost_reasons(candidates), places, np.array(shares),
    )  # fmt: skip
    assert [question for question, _ in found] == [
        "How many people?", "Where do they dwell?", "What was dropped as a ghost, and why?", "Where is the rig blind?",
    ]  # fmt: skip
    return [re.sub("<[^>]+>", "", answer) for _, answer in found]


def test_the_four_questions_are_answered_of_even_crowds_too() -> None:
    people, places, ghosts, blind = answers_of(PLACES, [0.1, 0.25, 0.65], 2)
    assert people.startswith("1.5 at a time on average, at most 2. There are 2 tracks, half of them 0.9 s or longer")
    assert "A at (1.0, 2.0), 40 %; B at (-1.0, 0.0), 20 %" in places
    assert ghosts.startswith("1 of 3 candidates (0.2 a frame): 100 % because a view sees nobody there.")
    assert ghosts.endswith("2 tracks too short or too uncertain were dropped as well.")
    assert blind.startswith("10 % of the ground is seen by no view, 25 % by one alone") and "65 % by two" in blind
    _, places, ghosts, _ = answers_of([], [0, 0, 1])
    assert places.startswith("Nowhere in particular")
    assert "too short" not in ghosts
