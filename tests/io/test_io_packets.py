"""Counting a Motion JPEG video by its packets finds what decoding finds, or leaves it to decoding."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from films import write_at_rate
from refusals import refused

from stseg.arrays import Bytes, Floats
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import reduced_picture
from stseg.io.recording.recording import Source
from stseg.io.recording.video import video_stream
from stseg.io.recording.video.packets import packet_times
from stseg.io.recording.video.video_stream import VideoStream

SIZE = (32, 24)
CAMERA = Camera("cam1", SIZE, np.eye(3), np.array([0.0, 0.0, -1.0]))


def picture(frame: int) -> Bytes:
    return np.random.default_rng(frame).integers(0, 255, (*SIZE[::-1], 3), np.uint8)


def video(path: Path, codec: str, frames: int = 9) -> Path:
    return write_at_rate(path, [picture(frame) for frame in range(frames)], 5.0, codec)


def decoded(path: Path) -> Floats:
    """The times of what really decodes."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    times = []
    while capture.grab():
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    capture.release()
    return np.array(times, float)


def counted(path: Path) -> Floats:
    stream = VideoStream(Source("video", path), CAMERA)
    (times,) = stream.times()
    assert stream.read() is None
    stream.close()
    return times


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return video(tmp_path_factory.mktemp("film") / "film.avi", "MJPG").read_bytes()


@pytest.mark.parametrize("suffix", ["avi", "mov", "mkv"])
def test_packets_tell_the_times_that_decoding_finds(tmp_path: Path, suffix: str) -> None:
    path = video(tmp_path / f"film.{suffix}", "MJPG")
    times, expected = packet_times(path), decoded(path)
    np.testing.assert_array_equal(counted(path), expected)
    assert suffix != "avi" or times is not None
    np.testing.assert_array_equal(expected if times is None else times, expected)


@pytest.mark.parametrize(("codec", "suffix"), [("FFV1", "avi"), ("mp4v", "mp4"), ("mp4v", "avi")])
def test_other_codecs_are_decoded(tmp_path: Path, codec: str, suffix: str) -> None:
    path = video(tmp_path / f"film.{suffix}", codec)
    assert packet_times(path) is None
    assert len(counted(path)) == 9


def test_a_file_that_is_no_video_has_no_packets(tmp_path: Path) -> None:
    path = tmp_path / "film.avi"
    path.write_bytes(b"\0nothing")
    assert packet_times(path) is None


def assert_counted(path: Path) -> None:
    """What decodes is counted; a video of which nothing decodes is refused."""
    if len(times := decoded(path)):
        np.testing.assert_array_equal(counted(path), times)
    else:
        refused(SourceError, "no frame that decodes|does not open", counted, path)


@pytest.mark.parametrize("kept", range(1, 10))
def test_a_video_that_breaks_off_has_the_frames_that_decode(tmp_path: Path, film: bytes, kept: int) -> None:
    (tmp_path / "film.avi").write_bytes(film[: len(film) * kept // 10])
    assert_counted(tmp_path / "film.avi")


def damaged(folder: Path, film: bytes, frame: int, at: int) -> Path:
    """The film with twelve other bytes in a frame."""
    begin = -1
    for _ in range(frame + 1):
        begin = film.index(b"00dc", begin + 1)
    begin += 8 + at
    (folder / "film.avi").write_bytes(film[:begin] + b"\xaa" * 12 + film[begin + 12 :])
    return folder / "film.avi"


@pytest.mark.parametrize("frame", [0, 4, 8])
@pytest.mark.parametrize("at", [0, 2, 4, 30, 170, 300, 640, 700])
def test_a_damaged_picture_is_counted_as_it_decodes(tmp_path: Path, film: bytes, frame: int, at: int) -> None:
    assert_counted(damaged(tmp_path, film, frame, at))


@pytest.mark.parametrize("factor", [2, 3, 4, 6])
def test_reduced_pictures_are_the_means_of_squares_nearly(tmp_path: Path, factor: int) -> None:
    smooth = cv2.GaussianBlur(np.random.default_rng(5).integers(0, 255, (50, 66, 3), np.uint8), (0, 0), 5.0)
    path = write_at_rate(tmp_path / "film.avi", [np.asarray(smooth, np.uint8)])
    camera = Camera("cam1", (66, 50), np.eye(3), np.array([0.0, 0.0, -1.0]))
    reduced = VideoStream(Source("video", path), camera, factor=factor).read()
    whole = VideoStream(Source("video", path), camera).read()
    assert reduced is not None and whole is not None
    assert reduced.shape == (50 // factor, 66 // factor, 3)
    difference = reduced.astype(float) - reduced_picture(whole, factor)
    assert abs(difference.mean()) < 1.0
    assert difference.std() < 2.0


@pytest.mark.parametrize("frame", [0, 4, 8])
@pytest.mark.parametrize("at", [0, 2, 30, 170, 640])
def test_a_damaged_picture_leaves_the_reduced_frames(tmp_path: Path, film: bytes, frame: int, at: int) -> None:
    path = damaged(tmp_path, film, frame, at)
    times = decoded(path)
    stream = VideoStream(Source("video", path), CAMERA, times, factor=2)
    shown = 0
    while stream.read() is not None:
        shown += 1
    assert shown == len(times)


@pytest.mark.parametrize("frame", [0, 3, 8])
def test_frames_are_found_by_seeking_packets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frame: int) -> None:
    path = video(tmp_path / "film.avi", "MJPG")
    monkeypatch.setattr(video_stream, "_SEQUENTIAL_FRAMES", 1)
    one, other = (VideoStream(Source("video", path), CAMERA, times, factor=2) for times in (None, decoded(path)))
    assert one.skip(frame) == other.skip(frame) == frame
    np.testing.assert_array_equal(one.read(), other.read())
