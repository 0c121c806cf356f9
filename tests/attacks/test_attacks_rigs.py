"""Rig files, calibrations and recordings from strangers: a result, or one line that names the file."""

import os
import struct
import sys
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from threading import Event, Thread
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from attacks import film, write_rig
from checks import Captured, Command, cases, refused
from fuzz.corpus import mat_file

from stseg import Config, read_recording
from stseg.commands.main import main
from stseg.engine.offline.job import Job
from stseg.errors import SourceError
from stseg.io.calibrations.matlab_file import parse_mat
from stseg.io.live.live_stream import FFmpegCapture
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.pictures import read_picture
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.video.ffmpeg import read_video_size
from stseg.io.recording.video.packets import PictureHeads
from stseg.io.untrusted.numpy_files import parse_npy

SCENE = ("--area=0,0,1,1", "--frame-rate=5")


@cases(
    *(("planes = 4", f"planes = {'9' * digits}") for digits in (400, 5000)),
    ('path = "boxes.csv"', f'path = "{"x" * 300}"'),
    ("[grid]", f"polygon = [{'[0.0, 0.0], ' * 100_000}]\n[grid]"),
    *(("[grid]", f"{text}\n[grid]") for text in (".".join("a" * 200_000) + " = 1", "a = " + "[" * 100_000)),
)
def test_rigs_beyond_the_limits_are_refused(tmp_path: Path, refusal: Command, old: str, new: str) -> None:
    refusal("run", write_rig(tmp_path, old, new), "-o", tmp_path / "q.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["boxes.csv", "rig.toml"]


def test_a_row_far_behind_all_others_costs_nothing(tmp_path: Path) -> None:
    recording = read_recording(write_rig(tmp_path))
    with (tmp_path / "boxes.csv").open("a") as file:
        file.write("40000,10,10,5,20\n19999999,10,10,5,20\n")
    streams = index_streams(recording)
    job = Job(recording, Config(), "cut", "all", 0, streams.length, streams)
    assert job.gaps() == [(604, 39400), (40601, 19999399)]
    assert sum(segment.stop - segment.first for segment in job.segments()) == 604 + 1201 + 601


def test_a_thousand_corners_and_a_superscript_work(tmp_path: Path) -> None:
    turn = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    corners = np.stack([1.5 * np.cos(turn), 1.5 * np.sin(turn)], -1).tolist()
    grid = read_recording(write_rig(tmp_path, "[grid]", f"polygon = {corners}\n[grid]")).rig.grid
    near = np.hypot(*np.moveaxis(grid.ground, -1, 0)) < 1.5
    np.testing.assert_array_equal(grid.inside(), near)
    rig = write_rig(tmp_path, 'kind = "boxes", path = "boxes.csv"', 'kind = "video", path = "a*.avi"')
    for name in ("a1²2.avi", "a10²2.avi", "a9²2.avi"):
        (tmp_path / name).write_bytes(b"\0")
    parts = source_parts(read_recording(rig).sources[0].source, "")
    assert [part.path.name for part in parts] == ["a1²2.avi", "a9²2.avi", "a10²2.avi"]


def test_matlab_matrices_are_read_by_columns_and_bounded() -> None:
    np.testing.assert_array_equal(parse_mat(mat_file())["P"], np.arange(12.0).reshape(4, 3).T)
    refused(ValueError, r"where .* are left", parse_mat, mat_file(size=2**31))
    assert parse_mat(mat_file(rows=2**20, columns=2**20)) == {}
    packed = zlib.compress(bytes((64 << 20) + 1))
    refused(ValueError, "more than", parse_mat, mat_file()[:128] + struct.pack("<II", 15, len(packed)) + packed)


@cases()
def test_numpy_headers_are_not_believed(header: str) -> None:
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + b"\0" * 96
    refused(ValueError, "header", parse_npy, data)


NAMES = ["2026-01-01T10:30:00.avi", "http:127.0.0.1:9701", "concat:a", "-", "a%03d.avi"]
NAMES += [os.fsdecode(b"\xff\xfe.avi")] if sys.platform == "linux" else []


@pytest.mark.parametrize("name", NAMES)
def test_any_name_of_a_file_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    film(tmp_path / name, tmp_path / "plain.avi")
    monkeypatch.chdir(tmp_path)
    assert read_video_size(Path(name)) == (64, 48)


def test_pipes_and_archives_of_gigabytes_are_refused(tmp_path: Path, refusal: Command) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").unlink()
    os.mkfifo(tmp_path / "boxes.csv")
    refusal("run", rig, "-o", tmp_path / "q.h5")
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(200_000_000))
    options = ("-o", tmp_path / "r.toml", *SCENE, "--size=64,48", "--names=a")
    assert "unpacked" in refusal("calibrate", "import", "matrix", tmp_path / "a.npz", *options)


@pytest.mark.parametrize("given", [None, "protocol_whitelist;rtsp"])
def test_ffmpeg_has_options_while_it_opens(given: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files alone for a file, though a stream is being opened by another thread; and then what it had before."""
    film(tmp_path / "a.avi", tmp_path / "plain.avi")
    found: dict[str, str | None] = {}
    name, opening, file_opened = "OPENCV_FFMPEG_CAPTURE_OPTIONS", Event(), Event()

    def open_capture(address: str, backend: int, more: Sequence[int] = ()) -> cv2.VideoCapture:
        (opening if more else file_opened).set()
        if more:
            file_opened.wait(0.3)  # it is not
        found[address[:4]] = os.environ.get(name)
        return plain(address, backend, more)

    plain = cv2.VideoCapture
    file = Thread(target=read_video_size, args=[tmp_path / "a.avi"])
    stream = Thread(target=refused, args=[OSError, "no stream", FFmpegCapture, "rtsp://127.0.0.1:9/x", 0.1])
    monkeypatch.setattr(cv2, "VideoCapture", open_capture)
    monkeypatch.delenv(name, raising=False) if given is None else monkeypatch.setenv(name, given)
    stream.start()
    opening.wait()
    file.start()
    for thread in (stream, file):
        thread.join()
    assert found["file"] == "protocol_whitelist;file"
    assert found["rtsp"] == given if given else "rtsp_transport;tcp" in str(found["rtsp"])
    assert os.environ.get(name) == given


def test_damaged_pictures_are_answered_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Captured
) -> None:
    """libjpeg and libpng write to standard error by themselves."""
    monkeypatch.chdir(tmp_path)
    picture = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    for suffix in (".jpg", ".png"):
        data = bytearray(cv2.imencode(suffix, picture)[1])
        data[len(data) // 2 : len(data) // 2 + 3000] = bytes(3000)
        (tmp_path / f"a{suffix}").write_bytes(data[:-2000])
        status = main(["calibrate", "page", f"a{suffix}", "-o", "p.html", "--overwrite"])
        printed = capfd.readouterr().err
        assert status in (0, 2) and printed.count("\n") == (status == 2), printed


def test_long_chunks_and_huge_pictures_are_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packet = bytearray(cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    start = packet.index(b"\xff\xc0") + 5
    assert PictureHeads().fits(np.frombuffer(packet, np.uint8))
    monkeypatch.setattr(cv2, "imdecode", Mock(side_effect=AssertionError("it was decoded")))
    for height in (16000, 1):
        packet[start : start + 4] = height.to_bytes(2, "big") + (65500).to_bytes(2, "big")
        assert not PictureHeads().fits(np.frombuffer(packet, np.uint8))
    data = bytearray(cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    start = data.index(b"IDAT") - 4
    data[start : start + 4] = b"\x7f\xff\xff\xff"  # OpenCV would take two gigabytes for it
    (tmp_path / "a.png").write_bytes(data)
    refused(SourceError, "a broken file", read_picture, tmp_path / "a.png", "images", (64, 48), "")
