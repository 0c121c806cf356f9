"""Readers of public data sets' truth; on real data where it is at hand."""

from __future__ import annotations

import importlib
import json
import os
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from stseg.evaluation import evaluate
from stseg.io.track_csv import read_tracks_csv

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("STSEG_DATA", ROOT / "../shared/data"))
with_data = pytest.mark.skipif(not DATA.exists(), reason="the data sets are not here")


@pytest.fixture
def datasets(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """tools/datasets.py, which is no part of the package."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("datasets")


def test_cmc_counts_frames_from_one(datasets: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text("1 4 -1 -1 -1 -1 -1 2.5 0.5 0.8 0.5 0.5 0.8\n\n3 5 -1 -1 -1 -1 -1 -1 2 0.8 0.5 0.5 0.8\n")
    assert datasets.cmc_truth(path).tolist() == [(0, 4, 2.5, 0.5, 0), (2, 5, -1.0, 2.0, 0)]


def test_wildtrack_cells_become_metres_and_unseen_boxes_nothing(datasets: ModuleType, tmp_path: Path) -> None:
    views = [{"viewNum": view, "xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1} for view in range(7)]
    views[6] |= {"xmin": 10, "ymin": 20, "xmax": 40, "ymax": 120}
    people = [{"personID": 9, "positionID": 480 * 360 + 120, "views": views}]
    (tmp_path / "00000015.json").write_text(json.dumps(people))
    assert datasets.wildtrack_truth(tmp_path).tolist() == [(3, 9, 0.0, 0.0, 0)]
    datasets.wildtrack_annotated_boxes(tmp_path, tmp_path / "boxes")
    header = "frame,left,top,width,height\n"
    assert (tmp_path / "boxes" / "IDIAP3.csv").read_text() == header + "3,10,20,30,100\n"
    assert (tmp_path / "boxes" / "CVLab1.csv").read_text() == header


@with_data
def test_the_truth_of_cmc_stands_in_its_room(datasets: ModuleType) -> None:
    truth = datasets.cmc_truth(DATA / "cmc" / "GT_CMC2_WORLD_CENTROID.txt")
    assert (len(truth), truth["frame"].min(), truth["frame"].max()) == (2076, 0, 260)
    assert len(np.unique(truth["id"])) == 10
    assert truth["x"].min() > 0 and truth["x"].max() < 7.67 and np.abs(truth["y"]).max() < 4


@with_data
def test_the_truth_of_wildtrack_is_its_own_perfect_track(datasets: ModuleType, tmp_path: Path) -> None:
    truth = datasets.wildtrack_truth(DATA / "wildtrack" / "annotations_positions")
    assert np.unique(truth["frame"]).tolist() == list(range(200))
    assert truth["x"].min() >= -3 and truth["x"].max() <= 9 and truth["y"].min() >= -9 and truth["y"].max() <= 27
    datasets.write_truth_csv(tmp_path / "truth.csv", truth)
    assert evaluate(truth, read_tracks_csv(tmp_path / "truth.csv"), 0.3).hota == pytest.approx(100)


@with_data
def test_wildtrack_has_boxes_in_every_view(datasets: ModuleType, tmp_path: Path) -> None:
    datasets.wildtrack_annotated_boxes(DATA / "wildtrack" / "annotations_positions", tmp_path)
    for name in datasets.WILDTRACK_VIEWS:
        boxes = np.loadtxt(tmp_path / f"{name}.csv", delimiter=",", skiprows=1)
        assert len(np.unique(boxes[:, 0])) > 190 and (boxes[:, 3:] > 0).all()
