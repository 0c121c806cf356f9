"""A lens from a rendered video of a checkerboard."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from stseg.arrays import Bytes
from stseg.commands.calibrate.lens import calibrate_lens
from stseg.errors import CalibrationError, ConfigError
from stseg.io.calibrations.opencv_xml import read_opencv_lens

SIZE, BOARD = (640, 480), (7, 5)
MATRIX = np.array([[620.0, 0, 325.0], [0, 618.0, 236.0], [0, 0, 1]])
DISTORTION = np.array([-0.18, 0.04, 0.0, 0.0, 0.0])


def view(turn: np.ndarray[tuple[int, ...], np.dtype[np.float64]], shift: tuple[float, float, float]) -> Bytes:
    """A board of 8 x 6 squares of 50 pixels of texture, side 1, as the distorted camera sees it."""
    squares = (np.indices((6, 8)).sum(axis=0) % 2 * 255).astype(np.uint8)
    texture = cv2.copyMakeBorder(
        np.kron(squares, np.ones((50, 50), np.uint8)), 50, 50, 50, 50, cv2.BORDER_CONSTANT, value=255
    )
    pixel = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), -1).reshape(-1, 1, 2).astype(float)
    ray = cv2.undistortPoints(pixel, MATRIX, DISTORTION).reshape(-1, 2)
    rotation = cv2.Rodrigues(turn)[0]
    plane = np.linalg.inv(np.column_stack([rotation[:, :2], shift]))
    on_board = np.column_stack([ray, np.ones(len(ray))]) @ plane.T
    texel = (on_board[:, :2] / on_board[:, 2:] + [4, 3]) * 50 + 50 - 0.5
    maps = texel.reshape(*SIZE[::-1], 2).astype(np.float32)
    grey = cv2.remap(texture, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=140)
    return np.asarray(cv2.cvtColor(cv2.GaussianBlur(grey, (3, 3), 0.7), cv2.COLOR_GRAY2BGR), np.uint8)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, rng = tmp_path_factory.mktemp("board") / "board.avi", np.random.default_rng(0)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"FFV1"), 10.0, SIZE, True)
    for _ in range(18):
        shift = (*(rng.uniform(-1, 1, 2) * [2.5, 1.5]), rng.uniform(11, 17))
        writer.write(view(rng.uniform(-0.55, 0.55, 3), shift))
    writer.release()
    return path


def test_the_lens_comes_back(video: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calibrate_lens(video, board="7,5", output=tmp_path / "lens.xml", every=1)
    assert "views off by 0." in capsys.readouterr().out
    lens = read_opencv_lens(tmp_path / "lens.xml")
    np.testing.assert_allclose(lens.matrix, MATRIX, atol=6)
    assert lens.distortion[0] == pytest.approx(-0.18, abs=0.03)


def test_a_wrong_board_is_named(video: Path, tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="found 0 views of the whole board"):
        calibrate_lens(video, board="9,6", output=tmp_path / "lens.xml", every=4)
    with pytest.raises(ConfigError, match="3 or more"):
        calibrate_lens(video, board="2,5", output=tmp_path / "lens.xml")
