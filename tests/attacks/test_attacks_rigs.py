"""Rigs beyond all bounds (findings F4, F5, F7 and F8) are refused in one line; large ones work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from attacks import RIG, refusal, write_rig

from stseg.io.recording.rigs import read_recording
from stseg.io.recording.source_files import source_parts


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("x = [-2.0, 2.0]\ny = [-2.0, 2.0]", "x = [0, 1e12]\ny = [0, 1e-6]"),
        ("x = [-2.0, 2.0]", "x = [0, 1e8]"),
        ("cell = 0.2", "cell = 0.00055"),
        ("cell = 0.2", "cell = 0.001"),
        ("planes = 4", "planes = 90_000_000"),
        ("planes = 4", f"planes = {'9' * 400}"),
        ("planes = 4", f"planes = {'9' * 5000}"),
        ("frame_rate = 10.0", "frame_rate = 1e308"),
        ("frame_rate = 10.0", "frame_rate = 1e-308"),
        ("size = [64, 48]", "size = [1e300, 1e300]"),
        ("size = [64, 48]", "size = [2147483648, 2147483648]"),
        ("size = [64, 48]", "size = [100000, 100000]"),
        ("source = {", f"offset = {'9' * 31}\nsource = {{"),
        ('path = "boxes.csv"', f'path = "boxes.csv", frames = {"9" * 31}'),
        ('path = "boxes.csv"', f'path = "{"x" * 300}"'),
        ('path = "boxes.csv"', 'path = "a\\u0000b"'),
        ('kind = "boxes", path = "boxes.csv"', 'kind = "masks", path = "/"'),
        (
            "source = {",
            "lens = { matrix = [[50.0,0,32],[0,50.0,24],[0,0,1]], distortion = [1e308, 1e308] }\nsource = {",
        ),
        ("[grid]", "polygon = [" + "[0.0, 0.0], " * 100_000 + "]\n[grid]"),
        ("[grid]", ".".join("a" * 200_000) + " = 1\n[grid]"),
        ("[grid]", "a = " + "[" * 100_000 + "\n[grid]"),
    ],
)
def test_rigs_beyond_the_limits_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str
) -> None:
    refusal(capsys, "run", write_rig(tmp_path, old, new), "-o", tmp_path / "q.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["boxes.csv", "rig.toml"]


def test_three_thousand_cameras_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera = RIG[RIG.index("[[camera]]") :]
    cameras = "".join(camera.replace("cam1", f"cam{k}") for k in range(3000))
    path = write_rig(tmp_path)
    path.write_text(RIG[: RIG.index("[[camera]]")] + cameras)
    assert "at most 256" in refusal(capsys, "run", path, "-o", tmp_path / "q.h5")


def test_a_polygon_of_a_thousand_corners_works(tmp_path: Path) -> None:
    turn = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    corners = np.stack([1.5 * np.cos(turn), 1.5 * np.sin(turn)], -1).tolist()
    grid = read_recording(write_rig(tmp_path, "[grid]", f"polygon = {corners}\n[grid]")).rig.grid
    near = np.hypot(*np.moveaxis(grid.ground, -1, 0)) < 1.5
    np.testing.assert_array_equal(grid.inside(), near)


@pytest.mark.parametrize(
    "rows",
    ["2000000000,1,1,5,5", "0,1e999,1,5,5", "0,1,1,1e300,5", "0,1,1,-5,5", f"{'9' * 5000},1,1,5,5", "\u0663,1,1,5,5"],
)
def test_boxes_beyond_the_limits_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: str) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").write_text(f"frame,left,top,width,height\n{rows}\n")
    refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


def test_a_hundred_thousand_boxes_in_a_frame_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").write_text("frame,left,top,width,height\n" + "0,1,1,5,5\n" * 100_000)
    assert "boxes in" in refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


def test_a_file_with_a_superscript_in_its_name_is_ordered(tmp_path: Path) -> None:
    recording = read_recording(
        write_rig(tmp_path, 'kind = "boxes", path = "boxes.csv"', 'kind = "video", path = "a*.avi"')
    )
    for name in ("a1²2.avi", "a10²2.avi", "a9²2.avi"):
        (tmp_path / name).write_bytes(b"\0")
    parts = source_parts(recording.sources[0].source, "")
    assert [part.path.name for part in parts] == ["a1²2.avi", "a9²2.avi", "a10²2.avi"]


@pytest.mark.parametrize("points", [300_000])
def test_hundreds_of_thousands_of_points_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], points: int
) -> None:
    (tmp_path / "p.csv").write_text("camera,u,v,x,y\n" + "cam1,1,1,1,1\n" * points)
    refusal(
        capsys, *("calibrate", "points", tmp_path / "p.csv", "-o", tmp_path / "r.toml", "--area=0,0,1,1"),
        *("--frame-rate", "5", "--size", "64,48"),
    )  # fmt: skip
