"""The tools behind the figures of docs/calibration.md."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from walkabout import ring, shown, walkers

from stseg.io.calibrations.point_files import read_points
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import write_rig

sys.path.append(str(Path(__file__).parents[1] / "tools"))

import check_figures
import points_of_rig
import rig_difference


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    rig = ring()
    sources = tuple(CameraSource(Source("video", tmp_path / f"{camera.name}.avi")) for camera in rig.cameras)
    write_rig(tmp_path / "rig.toml", Recording(tmp_path / "rig.toml", rig, sources))
    return tmp_path / "rig.toml"


@pytest.mark.parametrize("way", check_figures.WAYS)
def test_spoilt_is_one_camera_alone(way: str) -> None:
    rig = ring()
    wrong = check_figures.spoilt(rig, 2, way)
    ground = np.array([[0.5, 0.8]])
    off = [float(np.hypot(*(a.project(ground, 0.0)[0] - b.project(ground, 0.0)[0]).T)[0]) for a, b in
           zip(rig.cameras, wrong.cameras, strict=True)]  # fmt: skip
    assert off[2] > 3 and off[0] == off[1] == off[3] == 0


def test_the_verdict_of_a_sound_rig() -> None:
    rig = ring()
    assert check_figures.verdict_of(rig, shown(rig, walkers(15))).named == ()


def test_clicks_are_near_what_the_cameras_show(rig_file: Path, tmp_path: Path) -> None:
    points_of_rig.main(rig_file, tmp_path / "clicks", 4)
    tables = read_points(tmp_path / "clicks" / "points.csv")
    assert [table.camera for table in tables] == [camera.name for camera in ring().cameras]
    for table, camera in zip(tables, ring().cameras, strict=True):
        pixel, _ = camera.project(table.place[:, :2], table.place[:, 2])
        assert 0.2 < np.abs(pixel - table.pixel).max() < 6


def test_a_rig_does_not_differ_from_itself(rig_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig_difference.main(rig_file, rig_file)
    rows = capsys.readouterr().out.splitlines()[2:]
    assert [row.split("|")[1].strip() for row in rows] == ["cam1", "cam2", "cam3", "cam4"]
    assert all(row.endswith("| 0.0 | 0.0 | 0.0 | 0.0 |") for row in rows)
