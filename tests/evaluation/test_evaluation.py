"""Scores against truth: named small scenes, slow twins, motmetrics, and golden values of the reference scorer."""

import importlib.util
import json
import re
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Literal, cast

import numpy as np
import pytest
import reference_evaluation as reference
from checks import Captured, cases, data_path, drawn, refused
from cyclopts import App
from hypothesis import strategies as st
from numpy.lib.recfunctions import append_fields
from run_files import table_of

from stseg.arrays import Flags, Ints, Rows
from stseg.commands.evaluate import evaluate as command
from stseg.errors import ConfigError, FormatError
from stseg.evaluation import evaluate
from stseg.geometry import Grid
from stseg.io.track_csv import POSITION, read_tracks_csv
from stseg.records.tables import TRAJECTORY

GOLDEN = json.loads((Path(__file__).parents[1] / "golden" / "evaluation.json").read_text(encoding="utf-8"))
SEEDS = st.integers(0, 2**32 - 1)


def table(rows: Iterable[tuple[int, int, float, float] | tuple[int, int, float, float, int]]) -> Rows:
    return np.array([row if len(row) == 5 else (*row, 0) for row in rows], POSITION)


def walk(identity: int, y: float, frames: Iterable[int]) -> list[tuple[int, int, float, float]]:
    """A person that walks along x at 0.1 m a frame."""
    return [(frame, identity, 0.1 * frame, y) for frame in frames]


def with_ids(rows: Rows, where: Flags, ids: Ints | int) -> Rows:
    renamed = rows.copy()
    renamed["id"] = np.where(where, ids, rows["id"])
    return renamed


TEN = range(10)
TWO = table(walk(1, 0.0, TEN) + walk(2, 2.0, TEN))
"""The truth of most scenes: two people, ten frames, 2 m apart."""


def crowd(seed: int, people: int = 3, frames: int = 6) -> tuple[Rows, Rows]:
    """People within reach of each other, tracks that jitter, miss, swap names and invent; no ties."""
    rng = np.random.default_rng(seed)
    ground = rng.uniform(0, 1.2, (people, 2))
    name = np.arange(people) + 7
    truth, tracks = [(0, 0, *ground[0])], []
    for frame in range(frames):
        ground += rng.normal(0, 0.1, ground.shape)
        if rng.random() < 0.3:
            name = rng.permutation(name)
        for person in range(people):
            if (frame, person) != (0, 0) and rng.random() < 0.85:
                truth.append((frame, person, *ground[person]))
            if rng.random() < 0.8:
                tracks.append((frame, int(name[person]), *(ground[person] + rng.normal(0, 0.2, 2))))
        if rng.random() < 0.3:
            tracks.append((frame, 50, *rng.uniform(0, 1.2, 2)))
    return table(truth), table(tracks)


def test_perfect_tracks_score_full_marks_whatever_their_names() -> None:
    tracks = TWO.copy()
    tracks["id"] = 90 - tracks["id"]
    scores = evaluate(TWO, tracks)
    full = (scores.moda, scores.modp, scores.precision, scores.recall, scores.mota, scores.idf1, scores.hota)
    assert full == (100,) * 7
    assert (scores.frames, scores.truths, scores.people, scores.mostly_tracked) == (10, 20, 2, 2)
    assert (scores.switches, scores.fragments, scores.false_tracks, scores.false_track_frames) == (0, 0, 0, None)
    assert (scores.motp, scores.location_mean, scores.location_median) == (0, 0, 0)


GAP = TWO[(TWO["id"] == 2) | ~np.isin(TWO["frame"], [4, 5])]
"""The first is missed in two frames."""
HALVES = table(walk(1, 0.0, range(5)) + walk(1, 5.0, range(5, 10)) + walk(2, 2.0, TEN))
SCENES = {
    "silent half the time": TWO[TWO["frame"] < 5],
    "swapped names": with_ids(TWO, TWO["frame"] >= 5, 3 - TWO["id"]),
    "a gap under one name": GAP,
    "a new name after a gap": with_ids(GAP, (GAP["id"] == 1) & (GAP["frame"] > 5), 8),
    "a false track": np.concatenate([TWO, table(walk(9, 5.0, range(4)))]),
    "matched in just half of its frames": HALVES,
}


@cases()
def test_scores_of_named_scenes(scene: str, expected: dict[str, float]) -> None:
    scores = evaluate(TWO, SCENES[scene])
    assert {name: getattr(scores, name) for name in expected} == pytest.approx(expected)


@pytest.mark.parametrize(("found", "lost", "tracked"), [(1, 1, 1), (2, 0, 1), (8, 0, 1), (9, 0, 2)])
def test_mostly_is_more_than_four_frames_of_five(found: int, lost: int, tracked: int) -> None:
    scores = evaluate(TWO, TWO[(TWO["id"] == 2) | (TWO["frame"] < found)])
    assert (scores.mostly_lost, scores.mostly_tracked) == (lost, tracked)


def test_pairs_are_kept_and_more_are_better_than_nearer_ones() -> None:
    truth = table(walk(1, 0.0, range(3)))
    tracks = table([(0, 5, 0.0, 0.3), (1, 5, 0.1, 0.4), (1, 6, 0.1, 0.1), (2, 5, 0.2, 0.2), (2, 6, 0.2, 0.1)])
    scores = evaluate(truth, tracks)
    assert scores.switches == 0 and scores.motp == pytest.approx(0.3)
    assert scores.location_mean == pytest.approx(0.5 / 3)  # each frame by itself takes the nearer
    truth = table([(0, 1, 0.0, 0.0), (0, 2, 0.4, 0.0)])
    assert evaluate(truth, table([(0, 1, 0.4, 0.0), (0, 2, 0.85, 0.0)])).hits == 2


def test_predicted_places_have_a_score_of_their_own() -> None:
    gap = (TWO["id"] == 1) & (TWO["frame"] < 4)
    tracks = append_fields(TWO, "raw_x", np.where(gap, np.nan, 0.0), usemask=False)
    tracks["x"][gap & (tracks["frame"] == 0)] += 3.0
    scores = evaluate(TWO, tracks)
    assert (scores.predictions, scores.predicted_precision) == (4, 75.0)
    assert scores.as_dict()["predicted_precision"] == 75.0 and "n_predicted" not in evaluate(TWO, TWO).as_dict()
    beside = evaluate(TWO, tracks, area=(-1, -1, 2.5, 3))  # the place that is 3 m away is outside, and no person's
    assert (beside.predictions, beside.predicted_precision) == (3, 100.0)


def test_people_outside_do_not_count_but_false_tracks_do() -> None:
    stranger = walk(3, 9.0, TEN)
    outside = table(stranger + walk(4, 11.0, TEN))  # one follows the stranger, one follows no person
    scores = evaluate(np.concatenate([TWO, table(stranger)]), np.concatenate([TWO, outside]), area=(-1, -1, 3, 3))
    assert (scores.moda, scores.people, scores.tracks, scores.area) == (100, 2, 2, (-1, -1, 3, 3))
    truth, tracks = table([(0, 1, 0.9, 0.0)]), table([(0, 1, 1.1, 0.0)])
    assert evaluate(truth, tracks, area=(-1, -1, 1, 1)).moda == 100
    assert evaluate(tracks, truth, area=(-1, -1, 1, 1)).detections == 0  # and the other way round none is judged
    truth = table([(0, 1, 0.0, 0.0), (0, 2, 1.5, 0.0)])
    scores = evaluate(truth, table([(0, 1, 0.0, 0.0), (0, 2, 1.5, 0.1), (0, 3, 0.9, 0.6)]), area=(-1, -1, 1, 1))
    assert (scores.hits, scores.false_alarms) == (1, 1)


def test_flags_and_frames_without_truth_count_where_asked() -> None:
    truth = TWO.copy()
    truth["flag"][truth["id"] == 2] = 3
    wrong = TWO.copy()
    wrong["y"][wrong["id"] == 2] += 0.3
    assert evaluate(truth, wrong).people == 2
    scores = evaluate(truth, wrong, ignore_flagged=True)
    assert (scores.people, scores.tracks, scores.moda, scores.location_mean) == (1, 1, 100, 0)
    scores = evaluate(TWO, np.concatenate([TWO, table(walk(9, 0.0, range(10, 15)))]), frames=np.arange(15))
    assert (scores.frames, scores.false_alarms) == (15, 5)
    assert evaluate(TWO, TWO, frames=np.array([3, 4, 4])).frames == 2


def test_tables_areas_and_gates_that_cannot_be() -> None:
    lost = TWO.copy()
    lost["y"][3] = np.nan
    refused(FormatError, "tracks: frame 3, id 1: found a position that is not finite", evaluate, TWO, lost)
    refused(FormatError, "truth: frame 0: found id 1 twice", evaluate, np.concatenate([TWO, TWO[:1]]), TWO)
    refused(FormatError, "truth: found a str, expected an array", cast(Any, evaluate), "truth.csv", TWO)
    refused(ConfigError, "area", evaluate, TWO, TWO, area=(1, 0, 0, 1))
    for gate in (0.0, -1.0, float("nan"), float("inf")):
        refused(ConfigError, "gate", evaluate, TWO, TWO, gate)


@drawn(25, SEEDS)
def test_the_slow_definitions_agree(seed: int) -> None:
    truth, tracks = crowd(seed)
    scene, scores = reference.scene_of(truth, tracks), evaluate(truth, tracks)
    counted = reference.clear(scene, 0.5)
    kept = (scores.mota or 0) / 100 * scores.truths + scores.switches + scores.detections
    assert kept / 2 == pytest.approx(counted.pop("kept"))
    assert {name: scores.as_dict()[name] for name in counted} == counted
    assert scores.hota == pytest.approx(100 * reference.hota(scene, 0.5))
    assert scores.hota_2gate == pytest.approx(100 * reference.hota(scene, 1.0))


@drawn(45, SEEDS)
def test_neither_names_nor_the_order_of_rows_matter(seed: int) -> None:
    truth, tracks = crowd(seed)
    rng = np.random.default_rng(seed)
    renamed = rng.permutation(tracks)
    renamed["id"] = 1000 - 3 * renamed["id"]
    one, other = evaluate(truth, tracks).as_dict(), evaluate(rng.permutation(truth), renamed).as_dict()
    assert one == other


@pytest.mark.parametrize("case", GOLDEN)
def test_a_reference_scorer_agrees_by_figure(case: str, tmp_path: Path, capsys: Captured) -> None:
    golden = GOLDEN[case]
    for name in ("truth", "tracks"):
        (tmp_path / f"{name}.csv").write_text("\n".join(golden[name]) + "\n", encoding="utf-8")
    command(tmp_path / "tracks.csv", tmp_path / "truth.csv", as_json=True, **_keywords(golden["options"]))
    answer = json.loads(capsys.readouterr().out)
    assert answer == golden["scores"] and list(answer) == list(golden["scores"])


def _keywords(options: list[str]) -> dict[str, Any]:
    """Options of the reference scorer as arguments of the command."""
    words = [word for option in options for word in option.split("=") if word != "--ignore-flagged"]
    pairs = zip(words[::2], words[1::2], strict=True)
    values = {key[2:]: float(given) if key == "--gate" else given for key, given in pairs}
    return {**values, "ignore_flagged": "--ignore-flagged" in options}


@pytest.fixture(scope="module")
def scorer() -> ModuleType:
    """The reference scorer without the two figures that it asks TrackEval for."""
    spec = importlib.util.spec_from_file_location("reference_scorer", data_path("../tools/score.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.identity_hota = lambda *_: {}  # type: ignore[attr-defined]
    return module


def test_the_reference_scorer_agrees_on_many_crowds_and_on_ties(scorer: ModuleType) -> None:
    for seed in range(60):
        truth, tracks = crowd(seed, people=5, frames=12)
        for rows in (truth, tracks):
            rows["flag"] = rows["frame"] % 3 == 1
            for axis in ("x", "y"):
                rows[axis] = rows[axis].round(1)  # many distances tie, many lie on the gate
        area = (0.1, 0.1, 0.9, 1.0) if seed % 2 else None
        places = [np.column_stack([rows["x"], rows["y"]]) for rows in (truth, tracks)]
        columns = [(r["frame"], r["id"], xy, r["flag"]) for r, xy in zip((truth, tracks), places, strict=True)]
        theirs = scorer.score(*columns, 0.3, area and list(area), "2:10", seed % 3 == 0)
        ours = evaluate(truth, tracks, 0.3, area, np.arange(2, 10), seed % 3 == 0).as_dict()
        assert {name: ours[name] for name in theirs} == theirs


def lanes(seed: int) -> tuple[Rows, Rows]:
    """People so far apart that no track is ever within the gate of two: where all definitions of a switch agree."""
    rng = np.random.default_rng(seed)
    truth, tracks = [], []
    name = np.arange(4)
    for frame in range(12):
        name = rng.permutation(name) if rng.random() < 0.3 else name
        for person in range(4):
            x, y = rng.uniform(0, 0.3, 2)
            truth.append((frame, person, x, 2.0 * person + y))
            if rng.random() < 0.75:
                tracks.append((frame, int(name[person]) + 10, x + rng.uniform(-0.4, 0.4), 2.0 * person + y + 0.25))
        if rng.random() < 0.4:
            tracks.append((frame, 30, 5.0, 5.0))
    return table(truth), table(tracks)


def judged_by_motmetrics(truth: Rows, tracks: Rows, gate: float) -> dict[str, float]:
    """MOTA, MOTP (mean distance), IDF1 and switches of another library."""
    motmetrics = pytest.importorskip("motmetrics")
    judge = motmetrics.MOTAccumulator(auto_id=True)
    for frame in np.unique(truth["frame"]):
        true, tracked = (rows[rows["frame"] == frame] for rows in (truth, tracks))
        distance = np.hypot(true["x"][:, None] - tracked["x"], true["y"][:, None] - tracked["y"])
        judge.update(true["id"].tolist(), tracked["id"].tolist(), np.where(distance <= gate, distance, np.nan))
    figures = motmetrics.metrics.create().compute(judge, metrics=["mota", "motp", "idf1", "num_switches"])
    return {name: float(value) for name, value in figures.iloc[0].items()}


@pytest.mark.filterwarnings("ignore")
@drawn(24, SEEDS)
def test_motmetrics_agrees(seed: int) -> None:
    truth, tracks = lanes(seed)
    ours, theirs = evaluate(truth, tracks), judged_by_motmetrics(truth, tracks, 0.5)
    assert ours.mota == pytest.approx(100 * theirs["mota"])
    assert ours.motp == pytest.approx(theirs["motp"]) and ours.switches == theirs["num_switches"]
    truth, tracks = crowd(seed)
    assert evaluate(truth, tracks).idf1 == pytest.approx(100 * judged_by_motmetrics(truth, tracks, 0.5)["idf1"])


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """Tracks that miss half, and the truth."""
    for name, rows in (("tracks", TWO[TWO["frame"] < 5]), ("truth", TWO)):
        lines = [f"{r['frame']},{r['id']},{r['x']},{r['y']}" for r in rows]
        (tmp_path / f"{name}.csv").write_text("\n".join(["frame,id,x,y", *lines]), encoding="utf-8")
    return tmp_path / "tracks.csv", tmp_path / "truth.csv"


def test_the_command_is_understood_and_says_what_it_took(files: tuple[Path, Path], capsys: Captured) -> None:
    command(*files, area="-1,-2,8,9")
    printed = capsys.readouterr().out
    assert "10 frames, gate 0.5 m, x -1 .. 8, y -2 .. 9 m" in printed
    assert "MODA 50.0 %" in printed and "misses 10" in printed
    assert len(printed.splitlines()) == 6  # nothing is wrapped
    app = App(result_action="return_value")
    app.command(command)
    for area in (["--area=-1,-1,9,9"], ["--area", "-1,-1,9,9"]):
        app(["evaluate", *map(str, files), "--frames", "0:5", *area, "--gate", "0.4", "--json", "--ignore-flagged"])
        answer = json.loads(capsys.readouterr().out)
        assert (answer["frames"], answer["MODA"], answer["area"], answer["gate_m"]) == (5, 100, [-1, -1, 9, 9], 0.4)


@pytest.mark.parametrize(("option", "texts"), [("frames", "5:2 5:5 a:b 1:2:3 3, : 2:"), ("area", "1,2,3 a,b 3,0,1,1")])
def test_options_that_make_no_sense_are_refused(files: tuple[Path, Path], option: str, texts: str) -> None:
    for text in (*texts.split(), "0,nan,1,1", "", "\x1b"):
        refused(ConfigError, f"--{option}: found {re.escape(repr(text))}", cast(Any, command), *files, **{option: text})


def test_a_run_file_is_read_as_a_run(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    runs = ModuleType("stseg.io.runfile.runs")
    grid = Grid((-1.0, 0.5), (-100.0, 100.0))
    rig = SimpleNamespace(recording=SimpleNamespace(rig=SimpleNamespace(grid=grid)))
    runs.read_trajectory = lambda _: read_tracks_csv(files[1])  # type: ignore[attr-defined]
    runs.read_run = lambda _: rig  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "stseg.io.runfile.runs", runs)
    command(Path("night.h5"), files[1], as_json=True)
    printed = capsys.readouterr()
    assert json.loads(printed.out)["MODA"] == 100
    assert "% of the truth's rows lie outside the area of the run" in printed.err


@cases()
def test_tracks_elsewhere_are_laid_on_truth(align: Literal["rigid", "similarity"], scale: float, mean: float) -> None:
    """Turned, shifted and scaled tracks score as they did; a scale is mended by a similarity alone."""
    angle = np.linspace(0, 5, 60)
    truth = table(
        [(k, 1, float(np.cos(a)), float(np.sin(2 * a))) for k, a in enumerate(angle)]
        + [(k, 2, float(np.sin(3 * a)), 2 - 0.02 * k) for k, a in enumerate(angle)]
    )
    place = (truth["x"] + 1j * truth["y"]) * np.exp(2j) / scale + 3 - 1j
    tracks = truth.copy()
    tracks["x"], tracks["y"] = place.real, place.imag
    aligned = evaluate(truth, tracks, align=align)
    assert evaluate(truth, tracks).moda == -100 and aligned.moda == 100 and aligned.switches == 0
    assert aligned.location_mean is not None and mean <= aligned.location_mean < (1e-6 if mean == 0 else np.inf)
    assert aligned.scale == pytest.approx(scale if align == "similarity" else 1)


def test_nothing_scores_none_costs_nothing_and_breaks_pairs() -> None:
    """Twenty million listed frames score as fifty do; between two frames that are far apart no pair continues."""
    tracks = [(0, 7, 0.0, 0.0), (40, 7, 0.3, 0.0), (40, 8, 0.1, 0.0), (41, 8, 0.3, 0.0), (41, 7, 0.1, 0.0)]
    truth, found = table([(0, 1, 0.0, 0.0), (40, 1, 0.0, 0.0), (41, 1, 0.0, 0.0)]), table(tracks)
    few, many = (evaluate(truth, found, frames=frames) for frames in (np.arange(50), range(20_000_000)))
    assert few.switches == 1 and few.frames == 50
    assert replace(many, frames=50) == few
    no_truth, no_tracks = evaluate(TWO[:0], TWO), evaluate(TWO, TWO[:0])
    assert (no_truth.frames, no_truth.moda, no_truth.mota, no_truth.recall) == (0, None, None, None)
    figures = [no_tracks.moda, no_tracks.precision, no_tracks.location_mean, no_tracks.hota, no_tracks.idf1]
    assert figures == [0, None, None, 0, 0] and no_tracks.mostly_lost == 2
    trajectory = table_of(TRAJECTORY, **{name: TWO[name] for name in ("frame", "id", "x", "y")})
    assert evaluate(TWO, trajectory) == evaluate(TWO, TWO)


def test_a_crowd_is_scored_in_parts_as_it_is_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    chance = np.random.default_rng(6)
    ground = chance.uniform(0, 15, (400, 2))
    rows = [(k, i, x, y) for k in range(3) for i, (x, y) in enumerate((ground + 0.1 * k).tolist())]
    noisy = [(k, i, x, y) for (k, i, *_), (x, y) in zip(rows, chance.normal([r[2:] for r in rows], 0.2), strict=True)]
    parted = evaluate(table(rows), table(noisy))
    monkeypatch.setattr("stseg.evaluation.sequence._CROWD", 10**9)
    assert parted == evaluate(table(rows), table(noisy))
