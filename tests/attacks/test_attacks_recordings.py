"""Recordings with any name, and what is no recording (findings F10 and F13)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from attacks import film, refusal, write_rig

from stseg.errors import InputError, SourceError
from stseg.io.recording.pictures import read_picture
from stseg.io.recording.rigs import read_recording
from stseg.io.recording.video.ffmpeg import read_video_size
from stseg.io.recording.video.packets import PictureHeads


@pytest.mark.parametrize("name", ["2026-01-01T10:30:00.avi", "http:127.0.0.1:9701", "concat:a", "-", "a%03d.avi"])
def test_any_name_of_a_file_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    film(tmp_path / name, tmp_path / "plain.avi")
    monkeypatch.chdir(tmp_path)
    assert read_video_size(Path(name)) == (64, 48)


@pytest.mark.skipif(sys.platform != "linux", reason="needs file names of any bytes")
def test_paths_that_are_no_utf8_work(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    folder.mkdir()
    film(folder / "a.avi", tmp_path / "plain.avi")
    assert read_video_size(folder / "a.avi") == (64, 48)
    assert read_recording(write_rig(folder)).rig.name == "yard"


@pytest.mark.parametrize(
    "text", ["#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n", "ffconcat version 1.0\nfile a.avi\n"]
)
def test_playlists_are_no_videos(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.avi").write_text(text)
    with pytest.raises(InputError, match="playlist"):
        read_video_size(tmp_path / "a.avi")


def test_pipes_are_not_waited_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").unlink()
    os.mkfifo(tmp_path / "boxes.csv")
    refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


def test_ffmpeg_is_told_to_open_files_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film(tmp_path / "a.avi", tmp_path / "plain.avi")
    seen: list[str | None] = []

    def open_capture(address: str, backend: int) -> cv2.VideoCapture:
        seen.append(os.environ.get("OPENCV_FFMPEG_CAPTURE_OPTIONS"))
        return plain(address, backend)

    plain = cv2.VideoCapture
    monkeypatch.setattr(cv2, "VideoCapture", open_capture)
    monkeypatch.setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS", "protocol_whitelist;http")
    assert read_video_size(tmp_path / "a.avi") == (64, 48)
    assert seen == ["protocol_whitelist;file"]
    assert os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] == "protocol_whitelist;http"


def test_damaged_pictures_are_answered_in_one_line(tmp_path: Path) -> None:
    """libjpeg and libpng write to standard error by themselves."""
    picture = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    for suffix in (".jpg", ".png"):
        data = bytearray(cv2.imencode(suffix, picture)[1])
        data[len(data) // 2 : len(data) // 2 + 3000] = bytes(3000)
        (tmp_path / f"a{suffix}").write_bytes(data[:-2000])
        program = "import sys; from stseg.commands.main import main; sys.exit(main())"
        done = subprocess.run(
            [sys.executable, "-c", program, "calibrate", "page", f"a{suffix}", "-o", "p.html", "--overwrite"],
            cwd=tmp_path, capture_output=True, text=True, check=False,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        )  # fmt: skip
        assert done.returncode in (0, 2)
        assert done.stderr.count("\n") == (done.returncode == 2), done.stderr


def test_a_png_chunk_longer_than_its_file_is_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCV would take two gigabytes for it."""
    data = bytearray(cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    start = data.index(b"IDAT") - 4
    data[start : start + 4] = b"\x7f\xff\xff\xff"
    (tmp_path / "a.png").write_bytes(data)
    monkeypatch.setattr(cv2, "imdecode", decoded_nothing)
    with pytest.raises(SourceError, match="a broken file"):
        read_picture(tmp_path / "a.png", "images", (64, 48), "")


def test_a_packet_that_declares_a_huge_picture_is_not_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    packet = bytearray(cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    start = packet.index(b"\xff\xc0") + 5
    assert PictureHeads().fits(np.frombuffer(packet, np.uint8))
    packet[start : start + 4] = (16000).to_bytes(2, "big") + (65500).to_bytes(2, "big")
    monkeypatch.setattr(cv2, "imdecode", decoded_nothing)
    assert not PictureHeads().fits(np.frombuffer(packet, np.uint8))


def decoded_nothing(*_: object) -> None:
    raise AssertionError("it was decoded")
