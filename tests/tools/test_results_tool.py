"""tools/results.py: the page it writes, the commands it runs, the rig it fits."""

from __future__ import annotations

import importlib
import json
import os
import shlex
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from stseg.evaluation import evaluate
from stseg.geometry import Camera
from stseg.io.recording.rigs import read_rig
from stseg.io.track_csv import POSITION

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("STSEG_DATA", ROOT / "../shared/data"))


@pytest.fixture
def tools(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of tools, which is no part of the package, on the path."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    return ROOT / "tools"


@pytest.fixture
def page_tool(tools: Path) -> ModuleType:
    del tools
    return importlib.import_module("result_page")


def rows(*places: tuple[int, int, float, float]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    return np.array([(*place, 0) for place in places], POSITION)


def figure_row(name: str, variant: str, scores: dict[str, Any] | None) -> dict[str, Any]:
    row = {
        "set": name,
        "variant": variant,
        "frames": "0:136",
        "version": "1.2",
        "date": "2030-01-01",
        "milliseconds": {"read": 10.0, "ghosts": 220.0, "track": 20.0},
        "tracks": 7,
        "people_a_frame": 2.5,
        "run": "stseg run RIG",
    }
    return row if scores is None else {**row, "evaluate": "stseg evaluate RUN", "scores": scores}


def some_scores() -> dict[str, Any]:
    truth = rows((0, 1, 0.0, 0.0), (1, 1, 0.0, 0.0))
    return evaluate(truth, rows((0, 5, 0.25, 0.0), (1, 5, 3.0, 0.0))).as_dict()


def test_page_shows_the_figures(page_tool: ModuleType) -> None:
    figures = {"uu4 cut": figure_row("uu4", "cut", some_scores()), "pom cut": figure_row("pom", "cut", None)}
    page = page_tool.page(figures)
    assert "| uu4 | cut | 0.0 | 50.0 | 50.0 | 50.0 |" in page
    assert "| 0.250 | 4.0 | given silhouettes (video of masks); 4 views; frames 0:136; gate 0.5 m;" in page
    assert "| pom | cut | - |" in page
    assert "2.5 people a frame |" in page
    assert "| **stseg, cut** | **0.0** |" in page
    assert "# pom, cut: stseg 1.2, 2030-01-01\npython tools/pom_rig.py" in page


def test_variants_stand_side_by_side(page_tool: ModuleType) -> None:
    figures = {
        "easy belief-condensation": figure_row("easy", "belief-condensation", some_scores()),
        "easy kalman": {**figure_row("easy", "kalman", some_scores()), "frames": "0:50"},
    }
    page = page_tool.page(figures)
    table = page.partition("## Trackers")[2].partition("\n## ")[0].splitlines()[1:]
    assert table[3].startswith("| easy | 0:50 | kalman | 0.0 | 50.0 |")
    assert table[4].startswith("| easy | 0:136 | belief: each view by itself |")
    assert table[4].endswith("| 0.250 | 7 | 20.0 | 250.0 |")
    assert len({line.count("|") for line in table[1:]}) == 1
    assert "kalman" not in page.partition("## Peers")[2]


def test_committed_page_says_what_the_figures_say(page_tool: ModuleType) -> None:
    text = (ROOT / "docs" / "results.json").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "development" / "measurements.md").read_text(encoding="utf-8")
    assert page_tool.page(json.loads(text)) == page


def test_every_row_of_a_table_has_a_cell_for_every_heading(page_tool: ModuleType) -> None:
    page = page_tool.page({"cmc1 frames": figure_row("cmc1", "frames", some_scores())})
    table = page.partition("## Results")[2].partition("\n## ")[0].strip()
    assert len({line.count(" | ") for line in table.splitlines()}) == 1


def test_sets_are_commands_that_exist(tools: Path) -> None:
    sets = importlib.import_module("result_sets").SETS
    variants = importlib.import_module("result_variants").VARIANTS
    assert [variant.name for variant in sets["easy"].variants] == list(variants)
    assert [variant.name for variant in sets["dense_boxes"].variants] == ["cut", "frames", "kalman"]
    for name, one in sets.items():
        run, score = one.run_command(one.variants[-1]), one.score_command(one.variants[-1])
        film = [] if one.film is None else [one.film]
        for command in [*film, *one.prepare, run, score]:
            program, what, *rest = shlex.split(command)
            assert program in ("stseg", "python"), name
            assert program == "stseg" or (tools.parent / what).is_file()
            assert all("{" not in word or "{name}" in word for word in rest)


def test_unknown_set_is_refused(tools: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del tools
    with pytest.raises(SystemExit) as stop:
        importlib.import_module("results").main(["--sets", "uu4,uu5"])
    assert stop.value.code == 2
    assert "uu5: expected names among uu4," in capsys.readouterr().err


def test_unknown_variant_is_refused(tools: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del tools
    with pytest.raises(SystemExit) as stop:
        importlib.import_module("results").main(["--sets", "none", "--variants", "kalman,magic"])
    assert stop.value.code == 2
    assert "magic: expected names among cut, frames, kalman," in capsys.readouterr().err


def test_errors_of_a_frame_are_judged_in_the_area_alone(tools: Path) -> None:
    del tools
    truth = rows((0, 1, 0.0, 0.0), (0, 2, 9.0, 0.0), (1, 1, 0.0, 0.0))
    found = rows((0, 1, 0.1, 0.0), (1, 1, 2.0, 0.0), (1, 2, 2.0, 2.0))
    scores = {"gate_m": 0.5, "area": [-1.0, -1.0, 3.0, 3.0]}
    errors = importlib.import_module("result_pictures").frame_errors(found, truth, [0, 1], scores, False)
    assert errors.tolist() == [[0, 0, 0], [1, 1, 2]]


def test_pom_camera_is_fitted_to_its_rectangles(tools: Path) -> None:
    del tools
    pom_rig = importlib.import_module("pom_rig")
    homography = [[60.0, 35.0, 40.0], [4.0, -9.0, 110.0], [0.02, 0.12, 1.0]]
    camera = Camera("c", (160, 120), np.array(homography), np.array([0.5, -40.0, 0.01]))
    ground = np.random.default_rng(3).uniform(0, 1.2, (60, 2))
    (u, bottom), (_, top) = (camera.project(ground, height)[0].T for height in (0.0, pom_rig.BODY))
    head_u = camera.project(ground, pom_rig.BODY)[0][:, 0]
    fitted = pom_rig.fit_homography(ground, np.stack([u, bottom], -1))
    vertical = pom_rig.fit_vertical(fitted, ground, np.stack([head_u, top], -1))
    scale = camera.ground[2, 2] / fitted[2, 2]
    np.testing.assert_allclose(fitted * scale, camera.ground, atol=1e-8)
    np.testing.assert_allclose(vertical * scale, camera.vertical, atol=1e-8)


@pytest.mark.skipif(not DATA.exists(), reason="the data sets are not here")
def test_pom_rig_sees_bodies_where_the_recording_says(tools: Path, tmp_path: Path) -> None:
    del tools
    pom_rig = importlib.import_module("pom_rig")
    pom_rig.main(DATA / "pom", tmp_path / "pom.toml")
    for index, camera in enumerate(read_rig(tmp_path / "pom.toml").rig.cameras):
        ground, rectangle = pom_rig.read_rectangles(DATA / "pom" / "test.pom", index)
        whole = (rectangle[:, 0] > 0) & (rectangle[:, 2] < 159) & (rectangle[:, 3] < 119)
        pixel, ahead = camera.project(ground[whole], 0.0)
        foot = np.stack([rectangle[:, [0, 2]].mean(axis=1), rectangle[:, 3]], -1)[whole]
        assert ahead.all()
        assert np.abs(pixel - foot).max() < 0.7
        assert 1.0 < camera.centre[2] < 2.5
