"""Synchronised reading: every kind of stream, offsets, ranges, and streams that end early."""

import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import Captured, cases, data_path, drawn, refused
from films import write_at_rate
from hypothesis import assume
from hypothesis import strategies as st
from recordings import blank_recording

from stseg.arrays import AnyArray, Boxes, Observation
from stseg.errors import ConfigError, FormatError, SourceError
from stseg.io.recording.aligned_stream import StreamIndex, index_streams
from stseg.io.recording.frames import FrameSet, open_frames, read_background, read_camera
from stseg.io.recording.recording import CameraSource, Recording, Source, SourceKind

SIZE = (16, 12)
SHOWN = [("video", (3,), np.uint8), ("masks", (), np.uint8), ("images", (3,), np.uint8), ("instances", (), np.uint16)]


def shade(frame: int) -> AnyArray:
    """A frame that tells its number."""
    return np.full(SIZE[::-1], 10 * frame, np.uint8)


def video(path: Path, frames: int, codec: str = "FFV1") -> Path:
    return write_at_rate(path, [np.dstack([shade(frame)] * 3) for frame in range(frames)], 5.0, codec)


def images(folder: Path, frames: int) -> Path:
    folder.mkdir()
    for frame in range(frames):
        cv2.imwrite(str(folder / f"frame_{frame + 5}.png"), shade(frame))
    return folder


def boxes(path: Path, frames: int) -> Path:
    lines = [f"{frame},{10 * frame},0,1,1" for frame in range(frames)]
    path.write_text("\n".join(["frame,left,top,width,height", *lines]))
    return path


def box_camera(folder: Path, frames: int, offset: int = 0, blind: bool = False) -> CameraSource:
    path = boxes(folder / f"boxes{frames}.csv", frames)
    return CameraSource(Source("boxes", path), None, offset, "blind" if blind else "error")


def number(view: Observation) -> int | None:
    """The camera's own frame that a view shows."""
    if view is None:
        return None
    value = view.pixel[0, 0] if isinstance(view, Boxes) else view.flat[0]
    return int(value) // 10


def shown(rec: Recording, first: int = 0, stop: int | None = None) -> list[tuple[int | None, ...]]:
    """Frame number and the cameras' own frame numbers of each frame set."""
    with open_frames(rec, first, stop) as reader:
        return [(frame_set.frame, *map(number, frame_set.views)) for frame_set in reader]


@pytest.mark.parametrize(("kind", "colours", "dtype"), SHOWN)
def test_kinds_give_arrays(tmp_path: Path, kind: SourceKind, colours: tuple[int, ...], dtype: type[np.generic]) -> None:
    path = video(tmp_path / "a.avi", 3) if kind == "video" else images(tmp_path / "a", 3)
    rec = blank_recording(CameraSource(Source(kind, path)))
    with open_frames(rec) as reader:
        for frame_set in reader:
            (view,) = map(np.asarray, frame_set.views)
            assert view.shape == (12, 16, *colours) and view.dtype == dtype
            assert (view == 10 * frame_set.frame).all()
    assert (frame_set.frame, index_streams(rec).length) == (2, 3)


def test_all_kinds_together(tmp_path: Path) -> None:
    rec = blank_recording(
        CameraSource(Source("video", video(tmp_path / "a.avi", 4))),
        CameraSource(Source("masks", video(tmp_path / "b.avi", 4))),
        CameraSource(Source("masks", images(tmp_path / "c", 4) / "frame_*.png")),
        box_camera(tmp_path, 4),
    )
    assert shown(rec) == [(frame, frame, frame, frame, frame) for frame in range(4)]
    assert shown(rec, 1, 3) == [(1, 1, 1, 1, 1), (2, 2, 2, 2, 2)]
    assert shown(rec, 2) == [(2, 2, 2, 2, 2), (3, 3, 3, 3, 3)] and shown(rec, 4) == shown(rec, 2, 2) == []


def test_frames_are_counted_by_decoding_boxes_by_their_number(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("1 -1 0 0 5 5 -1\n3 -1 0 0 5 5 -1\n")
    with open_frames(blank_recording(CameraSource(Source("boxes", path, first_frame=1, frames=4)))) as reader:
        views = [frame_set.views[0] for frame_set in reader]
    assert [isinstance(view, Boxes) and len(view) for view in views] == [1, 0, 1, 0]
    film = video(tmp_path / "a.avi", 5, "MJPG")
    head = bytearray(film.read_bytes())
    for name, total in ((b"avih", 16), (b"strh", 32)):
        struct.pack_into("<I", head, head.index(name) + 8 + total, 7)
    film.write_bytes(head)
    assert cv2.VideoCapture(str(film)).get(cv2.CAP_PROP_FRAME_COUNT) == 7
    recording = blank_recording(CameraSource(Source("video", film)))
    assert index_streams(recording).length == 5 and len(shown(recording)) == 5


def test_offsets_align_cameras_and_late_ones_are_blind_or_wrong(tmp_path: Path) -> None:
    early, late = box_camera(tmp_path, 6, offset=-2), box_camera(tmp_path, 3, offset=1)
    assert shown(blank_recording(early, late), first=1) == [(1, 3, 0), (2, 4, 1), (3, 5, 2)]
    assert index_streams(blank_recording(early, late)).length == 4
    punctual = box_camera(tmp_path, 3)
    unlike = blank_recording(punctual, box_camera(tmp_path, 1, offset=2))
    refused(SourceError, "camera cam2, frame 1: found a stream that starts at frame 2", open_frames, unlike, first=1)
    rec = blank_recording(punctual, box_camera(tmp_path, 1, offset=2, blind=True))
    assert shown(rec) == [(0, 0, None), (1, 1, None), (2, 2, 0)]


def test_short_cameras_are_errors_or_blind_and_end_recordings(tmp_path: Path) -> None:
    whole, short = box_camera(tmp_path, 4), box_camera(tmp_path, 2)
    reported = (
        "boxes2.csv: camera cam2: found its end at frame 2, where others continue, "
        "expected frames as long as camera cam1"
    )
    seen: list[FrameSet] = []
    with pytest.raises(SourceError, match=reported), open_frames(blank_recording(whole, short)) as reader:
        seen.extend(reader)
    assert [frame_set.frame for frame_set in seen] == [0, 1]
    refused(SourceError, reported, index_streams, blank_recording(whole, short))
    for stop in (None, 4):
        refused(SourceError, reported, shown, blank_recording(whole, short), 3, stop)
    assert shown(blank_recording(whole, short), 0, 2) == [(0, 0, 0), (1, 1, 1)]
    rec = blank_recording(whole, box_camera(tmp_path, 2, blind=True))
    assert shown(rec) == [(0, 0, 0), (1, 1, 1), (2, 2, None), (3, 3, None)] and index_streams(rec).length == 4
    rec = blank_recording(box_camera(tmp_path, 2), box_camera(tmp_path, 5, blind=True))
    assert [row[0] for row in shown(rec)] == [0, 1]
    both_blind = blank_recording(box_camera(tmp_path, 2, blind=True), box_camera(tmp_path, 5, blind=True))
    assert shown(both_blind, 3) == [(3, None, 3), (4, None, 4)] and index_streams(both_blind).length == 5


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize(("first", "stop", "least"), [(0, 5, 5), (4, None, 4), (9, 12, 12)])
def test_ranges_beyond_the_end_are_told(tmp_path: Path, blind: bool, first: int, stop: int | None, least: int) -> None:
    rec = blank_recording(box_camera(tmp_path, 3, blind=blind))
    said = f"rig.toml: frames: found a recording of 3 frames, expected at least {least}"
    refused(SourceError, said, shown, rec, first, stop)


@pytest.mark.parametrize(("first", "stop"), [(-1, None), (3, 2)])
def test_ranges_that_are_none_are_errors(tmp_path: Path, first: int, stop: int | None) -> None:
    refused(ConfigError, "0 <= first <= stop", open_frames, blank_recording(box_camera(tmp_path, 3)), first, stop)


@drawn(
    40,
    cameras=st.lists(st.tuples(st.integers(1, 6), st.integers(-2, 3)), min_size=1, max_size=3),
    cuts=st.sets(st.integers(0, 9)),
)
def test_the_split_of_a_film_does_not_matter(tmp_path: Path, cameras: list[tuple[int, int]], cuts: set[int]) -> None:
    rec = blank_recording(*[box_camera(tmp_path, frames, offset, blind=True) for frames, offset in cameras])
    length = max(frames + offset for frames, offset in cameras)
    assume(length >= 0)
    own = [[f - offset if 0 <= f - offset < frames else None for frames, offset in cameras] for f in range(length)]
    edges = [0, *sorted(cut for cut in cuts if cut < length), length]
    parts = [row for first, stop in pairwise(edges) for row in shown(rec, first, stop)]
    assert parts == shown(rec) == [(f, *views) for f, views in enumerate(own)]


def test_videos_of_lossy_codecs_are_grey_and_skipping_is_exact(tmp_path: Path) -> None:
    rec = blank_recording(CameraSource(Source("masks", video(tmp_path / "a.avi", 3, "MJPG"))))
    with open_frames(rec) as reader:
        grey = [np.asarray(one.views[0]) for one in reader]
    np.testing.assert_allclose(grey, [shade(frame) for frame in range(3)], atol=2)
    rec = blank_recording(CameraSource(Source("video", video(tmp_path / "a.mp4", 20, "mp4v")), offset=-3))
    with open_frames(rec, 7, 9) as reader:
        views = [frame_set.views[0] for frame_set in reader]
    np.testing.assert_allclose([np.mean(view) for view in views if isinstance(view, np.ndarray)], [100, 110], atol=4.5)


def test_reading_goes_on_and_backgrounds_are_by_camera(tmp_path: Path) -> None:
    with open_frames(blank_recording(box_camera(tmp_path, 4))) as reader:
        assert next(reader).frame == 0 and [frame_set.frame for frame_set in reader] == [1, 2, 3]
        assert list(reader) == []
    rec = blank_recording(box_camera(tmp_path, 3), CameraSource(Source("images", images(tmp_path / "a", 3))))
    (tmp_path / "a" / "frame_6.png").write_bytes(b"broken")
    refused(SourceError, r"frame_6\.png: camera cam2, frame 1: found a broken file", shown, rec)
    source = Source("video", video(tmp_path / "a.avi", 2))
    rec = blank_recording(
        CameraSource(source), CameraSource(source, background=Source("images", images(tmp_path / "empty", 3)))
    )
    assert [number(view) for view in read_background(rec, 1)] == [0, 1, 2]
    refused(SourceError, "camera cam1, background: found none", next, read_background(rec, 0))


@pytest.mark.parametrize("kind", ["video", "masks", "images"])
def test_pictures_of_another_size_are_refused(tmp_path: Path, kind: SourceKind) -> None:
    path = images(tmp_path / "a", 2) if kind == "images" else video(tmp_path / "a.avi", 2)
    rec = blank_recording(CameraSource(Source(kind, path)), size=(20, 12))
    refused(SourceError, "camera cam1, frame 0: found an image of 16x12, expected 20x12", shown, rec)


def beside(folder: Path, detections: int, frames: int, offset: int = 0) -> CameraSource:
    """A camera of boxes, with colour frames."""
    own = box_camera(folder, detections, offset)
    return replace(own, images=Source("images", images(folder / f"beside{frames}", frames)))


def test_colour_frames_stand_beside_detections_to_their_end(tmp_path: Path) -> None:
    """Frame k of the images is that of frame k of the boxes; more of them are left over."""
    rec = blank_recording(box_camera(tmp_path, 5), beside(tmp_path, 3, 9, offset=2))
    with open_frames(rec, 2, 5) as reader:
        found = [(number(frame_set.views[1]), *map(number, frame_set.images)) for frame_set in reader]
    assert found == [(0, None, 0), (1, None, 1), (2, None, 2)]
    with open_frames(rec.without_images(), 2, 5) as reader:
        assert all(frame_set.images == () for frame_set in reader)
    rec = blank_recording(beside(tmp_path, 5, 3))
    refused(SourceError, "camera cam1, images: found its end at frame 3, where the detections go on", shown, rec)


@cases()
def test_sources_that_cannot_be_read(
    tmp_path: Path, capfd: Captured, kind: SourceKind, name: str, reported: str
) -> None:
    (tmp_path / "text.avi").write_text("no video, no boxes")
    (tmp_path / "empty.avi").touch()
    (tmp_path / "folder").mkdir()
    rec = blank_recording(box_camera(tmp_path, 3), CameraSource(Source(kind, tmp_path / name)))
    with pytest.raises((SourceError, FormatError), match=reported):
        shown(rec)
    assert capfd.readouterr().err == ""


def test_real_silhouettes_and_boxes() -> None:
    folders = [data_path("uu4") / f"cam{i}" for i in range(1, 5)]
    cameras = [
        CameraSource(Source("masks", folder / "foreground_cropped.avi"), Source("video", folder / "background.avi"))
        for folder in folders
    ]
    rec = blank_recording(*cameras, size=(644, 486))
    assert index_streams(rec).length == 272
    with open_frames(rec, 270) as reader:
        frame_sets = list(reader)
    assert [frame_set.frame for frame_set in frame_sets] == [270, 271]
    view = np.asarray(frame_sets[0].views[3])
    assert view.shape == (486, 644) and 0 < np.mean(view) < 100
    assert np.asarray(next(read_background(rec, 0))).shape == (486, 644, 3)


def long_video(path: Path, frames: range) -> Path:
    """A video in which most frames are coded by differences; each shows its number in stripes."""
    bits = 255 * (np.array(frames)[:, None] >> np.arange(12) & 1).astype(np.uint8)
    stripes = np.pad(np.repeat(bits, 5, axis=1), ((0, 0), (0, 4)))
    return write_at_rate(path, [np.tile(row[:, None], (48, 1, 3)) for row in stripes], 10.0, "mp4v")


def shown_number(view: Observation) -> int:
    return sum(int(np.asarray(view)[24, 5 * k + 2, 1] > 127) << k for k in range(12))


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One video of 900 frames, and the same in three files."""
    folder = tmp_path_factory.mktemp("hour")
    long_video(folder / "whole.mp4", range(900))
    for k in range(3):
        long_video(folder / f"part_{9 + k}.mp4", range(300 * k, 300 * k + 300))
    return folder


def camera_of(path: Path, *more: Path) -> Recording:
    return blank_recording(CameraSource(Source("video", path, more=more)), size=(64, 48))


@pytest.mark.parametrize("first", [0, 1, 249, 251, 299, 300, 301, 555, 599, 600, 899])
@pytest.mark.parametrize("parts", ["whole", "pattern", "list"])
def test_far_frames_are_sought_exactly(hour: Path, parts: str, first: int) -> None:
    files = [hour / f"part_{9 + k}.mp4" for k in range(3)]
    rec = {
        "whole": camera_of(hour / "whole.mp4"),
        "pattern": camera_of(hour / "part_*.mp4"),
        "list": camera_of(files[0], *files[1:]),
    }[parts]
    streams = index_streams(rec)
    assert streams.length == 900
    assert list(map(len, streams.times[0])) == ([900] if parts == "whole" else [300] * 3)
    stop = min(first + 3, 900)
    with open_frames(rec, first, stop, streams) as sought, open_frames(rec, first, stop) as decoded:
        for one, other in zip(sought, decoded, strict=True):
            np.testing.assert_array_equal(one.views[0], other.views[0])
            assert shown_number(one.views[0]) == one.frame


def test_times_that_tell_nothing_are_no_harm(hour: Path) -> None:
    """Where the landing frame is ambiguous, the video is decoded from its beginning."""
    rec = camera_of(hour / "whole.mp4")
    for times in (np.zeros(900), np.full(900, np.nan), np.arange(900.0)):
        with open_frames(rec, 700, 702, StreamIndex(900, ((times,),))) as reader:
            assert [shown_number(frame_set.views[0]) for frame_set in reader] == [700, 701]
    rec = camera_of(hour / "part_*.mp4")
    views = read_camera(rec, 0, range(10, 900, 290), index_streams(rec))
    assert [shown_number(view) for view in views] == [10, 300, 590, 880]
