"""Large images are reduced before the foreground looks at them; what is told of them stays in their own pixels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings import compiled_only
from scenes import looking
from strategies import BARREL, numbers

from stseg.commands.main import main
from stseg.geometry import Grid, Rig
from stseg.geometry.rig import greatest_reduction
from stseg.io.recording.frames import open_frames, read_background
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import read_recording
from stseg.io.runfile.runs import read_run

GRID = Grid((-2.0, 2.0), (-2.0, 2.0))


@pytest.mark.parametrize("distortion", [None, BARREL])
@given(x=numbers(-2, 2), y=numbers(-2, 2), height=numbers(0, 2), factor=st.integers(1, 6))
def test_a_reduced_view_shows_each_point_in_its_square(
    distortion: tuple[float, ...] | None, x: float, y: float, height: float, factor: int
) -> None:
    camera = looking("west", (-4.5, -3.0, 2.6), size=(640, 480), focal=500.0, distortion=distortion)
    small = camera.reduced(factor)
    assert small.size == (640 // factor, 480 // factor)
    (pixel, ahead), (reduced, still) = (view.project(np.array([x, y]), height) for view in (camera, small))
    assert ahead == still
    np.testing.assert_allclose(factor * (reduced + 0.5) - 0.5, pixel, atol=1e-6)


def test_people_stay_as_large_as_is_asked() -> None:
    camera = looking("west", (-4.5, -3.0, 2.6), size=(1280, 960), focal=1000.0)
    feet, head = (camera.project(GRID.ground, height)[0] for height in (0.0, 1.7))
    whole = camera.inside(feet) & camera.inside(head)
    spanned = float(np.median(np.hypot(*(feet - head)[whole].T)))
    for rows in (20.0, 60.0, 300.0):
        factor = greatest_reduction(camera, GRID, rows)
        assert spanned / factor >= rows or factor == 1
        assert spanned / (factor + 1) < rows
    away = looking("away", (-4.5, -3.0, 2.6), target=(-9.0, -6.0, 1.0))
    assert greatest_reduction(away, GRID, 1.0) == 1


def test_frames_are_means_of_squares_and_masks_stay(tmp_path: Path) -> None:
    cameras = tuple(looking(name, (-4.5, -3.0, 2.6), size=(65, 48), focal=52.0) for name in ("colour", "masks"))
    picture = np.random.default_rng(1).integers(0, 256, (48, 65, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "0.png"), picture)
    (tmp_path / "masks").mkdir()
    cv2.imwrite(str(tmp_path / "masks" / "0.png"), picture[:, :, 0])
    sources = (
        CameraSource(Source("images", tmp_path / "0.png"), background=Source("images", tmp_path / "0.png")),
        CameraSource(Source("masks", tmp_path / "masks")),
    )
    recording = Recording(tmp_path / "rig.toml", Rig("hall", 5.0, GRID, cameras), sources).reduced(6.0)
    assert recording.factors == (2, 1)
    assert [camera.size for camera in recording.reduced_rig.cameras] == [(32, 24), (65, 48)]
    expected = picture[:, :64].reshape(24, 2, 32, 2, 3).mean((1, 3))
    with open_frames(recording) as moments:
        colour, masks = next(moments).views
    for shown in (colour, *read_background(recording, 0)):
        assert isinstance(shown, np.ndarray)
        np.testing.assert_allclose(shown, expected, atol=0.51)
    assert isinstance(masks, np.ndarray)
    np.testing.assert_array_equal(masks, picture[:, :, 0])


@compiled_only
def test_boxes_of_a_run_are_in_the_pixels_of_the_images(tmp_path: Path) -> None:
    film = ["simulate", str(tmp_path / "film"), "--scene", "demo", "--seconds", "1.5", "--size", "320,240"]
    assert main(film) == 0
    rig, rows = tmp_path / "film" / "rig.toml", 25.0
    factors = read_recording(rig).reduced(rows).factors
    assert min(factors) > 1
    boxes = []
    for name, asked in (("whole.h5", 10000.0), ("reduced.h5", rows)):
        assert main(["run", str(rig), "-o", str(tmp_path / name), "--set", f"foreground.body_rows={asked}"]) == 0
        boxes.append(read_run(tmp_path / name).boxes)
    whole, reduced = boxes
    last = [table[table["frame"] == table["frame"].max()] for table in boxes]
    assert len(whole) == pytest.approx(len(reduced), rel=0.1)
    for side in ("left", "top", "width", "height"):
        one, other = (np.median(table[side]) for table in last)
        assert one == pytest.approx(other, abs=0.05 * 320)
