"""Tools for results and datasets."""

import json
import shlex
import sys
from inspect import signature
from operator import itemgetter
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from checks import data_path
from scenes import looking, rig_of

from stseg import evaluate, read_recording

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tools"))

import datasets  # noqa: E402
import measure  # noqa: E402
import pom_rig  # noqa: E402
import results  # noqa: E402
from experiments import ablation  # noqa: E402
from result_sets import SETS, VARIANTS  # noqa: E402


def test_cmc_counts_from_one_and_wildtrack_has_all_boxes(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text("1 4 -1 -1 -1 -1 -1 2.5 0.5 0.8 0.5 0.5 0.8\n\n3 5 -1 -1 -1 -1 -1 -1 2 0.8 0.5 0.5 0.8\n")
    assert datasets.cmc_truth(path).tolist() == [(0, 4, 2.5, 0.5, 0), (2, 5, -1.0, 2.0, 0)]
    datasets.wildtrack_annotated_boxes(data_path("wildtrack/annotations_positions"), tmp_path)
    for name in datasets.WILDTRACK_VIEWS:
        boxes = np.loadtxt(tmp_path / f"{name}.csv", delimiter=",", skiprows=1)
        assert len(np.unique(boxes[:, 0])) > 190 and (boxes[:, 3:] > 0).all()


def test_wildtrack_cells_become_metres_and_unseen_boxes_nothing(tmp_path: Path) -> None:
    views = [{"viewNum": view, "xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1} for view in range(7)]
    views[6] |= {"xmin": 10, "ymin": 20, "xmax": 40, "ymax": 120}
    people = [{"personID": 9, "positionID": 480 * 360 + 120, "views": views}]
    (tmp_path / "00000015.json").write_text(json.dumps(people))
    assert datasets.wildtrack_truth(tmp_path).tolist() == [(3, 9, 0.0, 0.0, 0)]
    datasets.wildtrack_annotated_boxes(tmp_path, tmp_path / "boxes")
    header = "frame,left,top,width,height\n"
    assert (tmp_path / "boxes" / "IDIAP3.csv").read_text() == header + "3,10,20,30,100\n"
    assert (tmp_path / "boxes" / "CVLab1.csv").read_text() == header


def test_the_truth_of_cmc_stands_in_its_room() -> None:
    truth = datasets.cmc_truth(data_path("cmc/GT_CMC2_WORLD_CENTROID.txt"))
    assert (len(truth), len(np.unique(truth["id"])), *np.unique(truth["frame"])[[0, -1]]) == (2076, 10, 0, 260)
    assert truth["x"].min() > 0 and truth["x"].max() < 7.67 and np.abs(truth["y"]).max() < 4


def test_the_truth_of_wildtrack_is_its_own_perfect_track() -> None:
    truth = datasets.wildtrack_truth(data_path("wildtrack/annotations_positions"))
    assert np.unique(truth["frame"]).tolist() == list(range(200))
    assert truth["x"].min() >= -3 and truth["x"].max() <= 9 and truth["y"].min() >= -9 and truth["y"].max() <= 27
    assert evaluate(truth, truth, 0.3).hota == pytest.approx(100)


def test_the_page_shows_trackers_and_the_stored_rows() -> None:
    row = {"frames": "0:136", "MODA": "99.6", "IDF1": "98.04", "error_m": "0.03", "switches": "0"}
    text = "above\n<!-- table -->\nold\n<!-- end of table -->\nbelow\n"
    shown = results.page(text, {("uu4", "cut"): row, ("uu4", "kalman"): row | {"MODA": ""}})
    assert "| 0:136 | 99.6 / 98.0 | 0 | 0.03 | - | - | - | - |" in shown and "old" not in shown
    assert shown.startswith("above\n") and shown.endswith("below\n")
    text = results.PAGE.read_text(encoding="utf-8")
    assert results.ablation(results.page(text, results.stored())) == text


@pytest.mark.parametrize("patched", [*ablation.WHOLE.values(), *ablation.FINAL.values()], ids=itemgetter(0))
def test_a_mechanism_that_is_taken_away_is_there(patched: tuple[str, object]) -> None:
    original, _ = patch(*patched).get_original()
    if callable(patched[1]):
        signature(patched[1]).bind(*signature(original).parameters)


def test_a_perturbed_rig_is_shifted_as_stated() -> None:
    rig = rig_of([looking("west", (-3.5, -3.5, 2.6)), looking("east", (3.5, -3.4, 2.6))])
    for seed in range(20):
        moved = measure.perturbed_rig(rig, np.random.default_rng(seed))
        shift = np.hypot(moved.grid.x[0] - rig.grid.x[0], moved.grid.y[0] - rig.grid.y[0])
        assert shift <= measure.AREA_SHIFT + rig.grid.cell / np.sqrt(2) and moved.grid.shape == rig.grid.shape
        for before, after in zip(rig.cameras, moved.cameras, strict=True):
            pixels = [camera.project(np.zeros((1, 2)), 1.0)[0] for camera in (before, after)]
            assert np.hypot(*(pixels[1] - pixels[0])[0]) == pytest.approx(1.0)


def test_sets_are_commands_that_exist() -> None:
    assert [variant.name for variant in SETS["easy"].variants] == list(VARIANTS)
    assert [variant.name for variant in SETS["dense_boxes"].variants] == ["cut", "frames", "kalman"]
    for name, one in SETS.items():
        run, score = one.run_command(one.variants[-1]), one.score_command(one.variants[-1])
        for command in [*filter(None, [one.film]), *one.prepare, run, score]:
            program, what, *rest = shlex.split(command)
            assert program in ("stseg", "python"), name
            assert program == "stseg" or (ROOT / what).is_file()
            assert all("{" not in word or "{name}" in word for word in rest)


@pytest.mark.parametrize("option", [["--sets", "uu4,uu5"], ["--sets", "none", "--variants", "cut,uu5"]])
def test_an_unknown_name_is_refused(option: list[str]) -> None:
    with pytest.raises(SystemExit, match="uu5: expected names among"):
        results.main(option)


def test_pom_rig_sees_bodies_where_the_recording_says(tmp_path: Path) -> None:
    pom_rig.main(data_path("pom"), tmp_path / "pom.toml")
    for index, camera in enumerate(read_recording(tmp_path / "pom.toml").rig.cameras):
        ground, rectangle = pom_rig.read_rectangles(data_path("pom/test.pom"), index)
        whole = (rectangle[:, 0] > 0) & (rectangle[:, 2] < 159) & (rectangle[:, 3] < 119)
        pixel, ahead = camera.project(ground[whole], 0.0)
        foot = np.stack([rectangle[:, [0, 2]].mean(axis=1), rectangle[:, 3]], -1)[whole]
        assert ahead.all() and np.abs(pixel - foot).max() < 0.7
        assert 1.0 < camera.centre[2] < 2.5
