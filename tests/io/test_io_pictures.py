"""Image files: kinds, indexed PNG, broken files, order and gaps of folders; films counted by their packets."""

import struct
import zlib
from pathlib import Path
from unittest.mock import Mock, patch

import cv2
import numpy as np
import pytest
from checks import cases, drawn, refused
from films import write_at_rate
from hypothesis import strategies as st
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import decode_indexed, read_picture, reduced_picture, stores_numbers
from stseg.io.recording.recording import Source, SourceKind
from stseg.io.recording.source_files import image_paths
from stseg.io.recording.video import video_stream
from stseg.io.recording.video.packets import packet_times
from stseg.io.recording.video.video_stream import VideoStream

GREY, INDEXED = 0, 3


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_of(chunks: bytes) -> bytes:
    return b"\x89PNG\r\n\x1a\n" + chunks + chunk(b"IEND", b"")


def png_by_hand(numbers: Bytes, bits: int, colour: int) -> bytes:
    """A PNG of numbers below 2^bits, with a palette that says nothing of them where it is indexed.

    Its lines are not filtered: filters are undone by Pillow, which has tests of them.
    """
    ones = (numbers[..., None] >> np.arange(bits)[::-1]) & 1
    stored = b"".join(b"\0" + np.packbits(row).tobytes() for row in ones.astype(np.uint8))
    header = struct.pack(">IIBBBBB", numbers.shape[1], numbers.shape[0], bits, colour, 0, 0, 0)
    palette = chunk(b"PLTE", bytes(reversed(range(3 * 2**bits)) if bits < 8 else 768 * b"\x11"))
    colours = palette + chunk(b"tRNS", b"\0") if colour == INDEXED else b""
    return png_of(chunk(b"IHDR", header) + colours + chunk(b"IDAT", zlib.compress(stored)))


@drawn(40, st.sampled_from([1, 2, 4, 8]), st.integers(1, 9), st.integers(1, 19), st.integers(0, 2**32 - 1))
def test_indexed_png_gives_its_numbers(bits: int, height: int, width: int, seed: int) -> None:
    numbers = np.random.default_rng(seed).integers(0, 2**bits, (height, width)).astype(np.uint8)
    data = png_by_hand(numbers, bits, INDEXED)
    assert stores_numbers(data)
    np.testing.assert_array_equal(decode_indexed(data), numbers)


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_grey_png_of_few_bits_is_not_stretched(tmp_path: Path, bits: int) -> None:
    numbers = (np.arange(12, dtype=np.uint8) % 2**bits).reshape(3, 4)
    (tmp_path / "a.png").write_bytes(png_by_hand(numbers, bits, GREY))
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png", "instances", (4, 3), ""), numbers)


def test_interlaced_png_and_masks_of_three_channels(tmp_path: Path) -> None:
    """Of the seven passes of Adam7 a 2x2 image has the first, the sixth and the seventh."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, INDEXED, 0, 0, 1))
    passes = zlib.compress(bytes([0, 1, 0, 2, 0, 3, 4]))
    (tmp_path / "a.png").write_bytes(png_of(header + chunk(b"PLTE", bytes(768)) + chunk(b"IDAT", passes)))
    assert read_picture(tmp_path / "a.png", "instances", (2, 2), "").tolist() == [[1, 2], [3, 4]]
    mask = np.random.default_rng(0).integers(0, 256, (6, 8)).astype(np.uint8)
    for name, picture in (("grey", mask), ("equal", np.dstack([mask] * 3)), ("alpha", np.dstack([mask] * 3 + [mask]))):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
        np.testing.assert_array_equal(read_picture(tmp_path / f"{name}.png", "masks", (8, 6), ""), mask)
    cv2.imwrite(str(tmp_path / "green.png"), np.dstack([0 * mask, mask, 0 * mask]))
    refused(SourceError, "a picture in colours", read_picture, tmp_path / "green.png", "masks", (8, 6), "camera a")


@pytest.mark.parametrize(
    "numbers", [np.array([[0, 1, 2], [200, 7, 255]], np.uint8), np.array([[0, 1, 2], [200, 7, 65535]], np.uint16)]
)
def test_instances_keep_their_numbers(tmp_path: Path, numbers: Bytes | NDArray[np.uint16]) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), numbers)
    read = read_picture(tmp_path / "a.png", "instances", (3, 2), "")
    assert read.dtype == np.uint16
    np.testing.assert_array_equal(read, numbers)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_images_are_blue_green_red(tmp_path: Path, channels: int) -> None:
    picture = np.full((2, 3, channels), np.arange(1, channels + 1) * 50, np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), picture)
    expected = [50, 50, 50] if channels == 1 else [50, 100, 150]
    read = read_picture(tmp_path / "a.png", "images", (3, 2), "")
    assert read.shape == (2, 3, 3) and read[1, 2].tolist() == expected


@cases()
def test_pictures_of_another_kind_are_refused(
    tmp_path: Path, kind: SourceKind, shape: list[int], values: str, reported: str
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros(shape, values))
    refused(SourceError, f"a.png: camera a: {reported}", read_picture, tmp_path / "a.png", kind, (3, 2), "camera a")


@pytest.mark.parametrize("kind", ["images", "instances"])
def test_broken_files_are_refused(tmp_path: Path, kind: SourceKind) -> None:
    whole = png_by_hand(np.zeros((20, 30), np.uint8), 8, INDEXED)
    for data in (b"", b"no image", whole[:20], whole[:-30], whole[:24] + b"\x03" + whole[25:]):
        (tmp_path / "a.png").write_bytes(data)
        refused(SourceError, "a broken file", read_picture, tmp_path / "a.png", kind, (30, 20), "")


def names(folder: Path, *files: str) -> None:
    for file in files:
        (folder / file).touch()


def test_folders_and_patterns_give_files_in_order(tmp_path: Path) -> None:
    names(tmp_path, "cam1_10.png", "cam1_8.png", "cam1_6.png", "readme.txt", "._cam1_6.png")
    assert [path.name for path in image_paths(tmp_path, "")] == ["cam1_6.png", "cam1_8.png", "cam1_10.png"]
    folder = tmp_path / "scene [1]"
    folder.mkdir()
    names(folder, "view-f9-c0.png", "view-f10-c0.png", "view-f9-c1.png", "view-f10-c1.png")
    found = image_paths(folder / "view-f*-c1.png", "")
    assert [path.name for path in found] == ["view-f9-c1.png", "view-f10-c1.png"]
    assert [path.name for path in image_paths(folder / "view-f9-c0.png", "")] == ["view-f9-c0.png"]
    refused(SourceError, "no such file or folder", image_paths, tmp_path / "none", "camera a")
    refused(SourceError, "no images", image_paths, tmp_path / "none_*.png", "camera a")


@cases()
def test_folders_without_a_clear_order_are_refused(tmp_path: Path, files: tuple[str, ...], reported: str) -> None:
    names(tmp_path, *files)
    refused(SourceError, reported, image_paths, tmp_path, "camera a")


SIZE = (32, 24)
CAMERA = Camera("cam1", SIZE, np.eye(3), np.array([0.0, 0.0, -1.0]))


def picture(frame: int) -> Bytes:
    return np.random.default_rng(frame).integers(0, 255, (*SIZE[::-1], 3), np.uint8)


def video(path: Path, codec: str, frames: int = 9) -> Path:
    return write_at_rate(path, [picture(frame) for frame in range(frames)], 5.0, codec)


def decoded(path: Path) -> Floats:
    """The times of what really decodes, behind pictures that do not, too."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    times = []
    while any(capture.grab() for _ in range(20)):
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
    assert packet_times(path) is None and len(counted(path)) == 9


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
    stream = VideoStream(Source("video", path), camera)
    whole = stream.read()
    with patch.object(stream, "_capture", Mock(retrieve=lambda: (False, None))):
        refused(SourceError, "frame 1: found a broken frame", stream.read)
    with patch.object(VideoStream, "_grab", Mock(return_value=False)):
        refused(SourceError, "no frame that decodes", VideoStream(Source("video", path), camera).read)
    assert reduced is not None and whole is not None
    assert reduced.shape == (50 // factor, 66 // factor, 3)
    difference = reduced.astype(float) - reduced_picture(whole, factor)
    assert abs(difference.mean()) < 1.0 and difference.std() < 2.0


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
    monkeypatch.setattr(video_stream, "lost_frames", Mock(side_effect=[None, np.zeros(0, int)]))
    moments = (None, decoded(path), decoded(path))
    one, lost, other = (VideoStream(Source("video", path), CAMERA, times, factor=2) for times in moments)
    assert one.skip(frame) == lost.skip(frame) == other.skip(frame) == frame
    np.testing.assert_array_equal(one.read(), shown := other.read())
    np.testing.assert_array_equal(lost.read(), shown)
