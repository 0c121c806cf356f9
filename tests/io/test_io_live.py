"""Arriving files and live streams as frame sets: files lose no frame, cameras none without a message."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from threading import Event, Timer, current_thread

import numpy as np
import pytest
from arrivals import FRAMES, PIECE, StandIn, arrive, meanwhile, write_pieces
from checks import refused
from films import write_at_rate
from recordings import PLACES, filmed_rig

from stseg.arrays import AnyArray, Bytes
from stseg.config import LiveConfig
from stseg.errors import RigError, SourceError
from stseg.geometry import Rig
from stseg.io.live.arriving_files import ArrivingFiles, FileNotes
from stseg.io.live.followed_cameras import FollowedCameras
from stseg.io.live.followed_files import FollowedFiles
from stseg.io.live.live_stream import Capture, is_live, now
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource, Recording, Source, mask_passwords
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig, read_recording
from stseg.io.recording.video.video_stream import VideoStream
from stseg.io.runfile.provenance import gather_provenance

QUICK = LiveConfig(
    file_quiet_time=0.3, stream_timeout=0.5, reconnect_wait=0.02, longest_reconnect_wait=1.0, frame_tolerance=0.1
)


@pytest.fixture(scope="module")
def arriving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig whose recording has arrived completely."""
    path = write_pieces(tmp_path_factory.mktemp("arriving"), empty=True)
    arrive(path.parent, 1, 2, 3, 4)
    return path


def followed(rig: Path, folder: Path, first: int = 0, stop: int | None = None) -> FollowedFiles:
    """The files of a rig, with notes in a folder."""
    return FollowedFiles(read_recording(rig), first, stop, QUICK, FileNotes(folder / "files.json"), Event(), print)


def test_files_are_taken_in_order_once_they_are_complete(tmp_path: Path) -> None:
    halt, reported = Event(), list[str]()
    files = ArrivingFiles(tmp_path / "cam_*.mp4", 0.3, halt, reported.append)
    for number in (9, 10, 11):
        (tmp_path / f"cam_{number}.mp4").write_bytes(b"whole")
    begun = time.monotonic()
    assert [files.next(), files.next()] == [tmp_path / "cam_9.mp4", tmp_path / "cam_10.mp4"]
    assert time.monotonic() - begun < 0.3
    growing = meanwhile(partial(add_to, tmp_path / "cam_11.mp4"))
    assert files.next() == tmp_path / "cam_11.mp4" and not growing.is_alive()
    assert time.monotonic() - begun > 0.6
    (tmp_path / "cam_8.mp4").write_bytes(b"late")
    (tmp_path / "cam_12.mp4").write_bytes(b"")
    Timer(0.5, halt.set).start()
    assert files.next() is None  # nothing was ever added to it
    assert [line.split(":")[0] for line in reported] == [str(tmp_path / "cam_8.mp4")]


def add_to(path: Path) -> None:
    for _ in range(4):
        time.sleep(0.1)
        with path.open("ab") as file:
            file.write(b"more")


def test_files_that_arrive_show_what_they_show_afterwards(arriving: Path, tmp_path: Path) -> None:
    recording = read_recording(arriving)
    assert index_streams(recording).length == FRAMES
    for first in (0, 13):
        with open_frames(recording, first) as after, followed(arriving, tmp_path, first, FRAMES) as frame_sets:
            for expected, frame_set in zip(after, frame_sets, strict=True):
                assert frame_set.frame == expected.frame and now() - 60 < frame_set.arrived < now()
                np.testing.assert_array_equal(np.stack(frame_set.views), np.stack(expected.views))  # type: ignore[arg-type]
    assert FileNotes(tmp_path / "files.json").read["east"] == [(f"east_{k}.avi", PIECE) for k in (1, 2, 3)]


def test_files_that_were_read_may_go(tmp_path: Path) -> None:
    rig = write_pieces(tmp_path, empty=True)
    arrive(tmp_path, 1, 2, 3)
    with followed(rig, tmp_path, 0, 25) as frame_sets:
        expected = list(frame_sets)[22]
    for name in PLACES:
        (tmp_path / "in" / f"{name}_1.avi").unlink()
    with followed(rig, tmp_path, 22, 23) as frame_sets:
        (frame_set,) = frame_sets
    np.testing.assert_array_equal(np.stack(frame_set.views), np.stack(expected.views))  # type: ignore[arg-type]
    with followed(rig, tmp_path, 5, 23) as frame_sets:
        refused(SourceError, r"expected west_1\.avi", next, frame_sets)


def test_who_is_waited_for_is_said(tmp_path: Path) -> None:
    rig, reported = write_pieces(tmp_path, empty=True), list[str]()
    arrive(tmp_path, 1)
    (tmp_path / "in" / "east_1.avi").unlink()
    halt, notes = Event(), FileNotes(tmp_path / "files.json")
    Timer(1.6, halt.set).start()
    with FollowedFiles(read_recording(rig), 0, None, QUICK, notes, halt, reported.append) as frame_sets:
        assert list(frame_sets) == []
    assert reported == ["waiting for the next file of east, at frame 0"]


def test_reading_waits_for_who_takes_frames(arriving: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read, whole = list[int](), VideoStream.read

    def counted(stream: VideoStream) -> AnyArray | None:
        read.append(1)
        return whole(stream)

    monkeypatch.setattr(VideoStream, "read", counted)
    with followed(arriving, tmp_path, 0, FRAMES) as frame_sets:
        for count, frame_set in enumerate(frame_sets, 1):
            if count < 4:
                time.sleep(0.1)
                assert len(read) <= (count + 1) * len(PLACES)
            assert frame_set.frame == count - 1
    assert count == FRAMES


def test_broken_videos_and_those_not_complete_are_told(tmp_path: Path) -> None:
    rig = write_pieces(tmp_path, empty=True)
    arrive(tmp_path, 1)
    content = (tmp_path / "pieces" / "east_1.avi").read_bytes()
    (tmp_path / "in" / "east_1.avi").write_bytes(content[: len(content) // 2])
    said = rf"{len(content)} bytes, of which only the first .* expected live\.file_quiet_time above"
    with followed(rig, tmp_path) as frame_sets:
        next(frame_sets)
        arrive(tmp_path, 1, 2)
        refused(SourceError, said, lambda: list(frame_sets))
    (tmp_path / "in" / "east_1.avi").write_bytes(b"no video")
    write_at_rate(tmp_path / "in" / "east_2.avi", numbered(0, 2))
    with followed(rig, tmp_path / "in") as frame_sets:
        refused(SourceError, r"east_1\.avi: ", next, frame_sets)


@pytest.mark.parametrize("source", [
    Source("video", Path("cam.avi")), Source("images", Path("*.png")), Source("video", Path("a*"), more=(Path("b*"),)),
])  # fmt: skip
def test_what_cannot_be_followed_is_refused(arriving: Path, source: Source) -> None:
    recording = read_recording(arriving)
    assert not is_live(recording) and is_live(live())
    other = replace(recording, sources=(CameraSource(source), *recording.sources[1:]))
    refused(SourceError, "by a pattern", is_live, other)
    late = replace(recording, sources=tuple(replace(one, offset=9) for one in recording.sources))
    starts = "camera west, frame 8: found a stream that starts at frame 9"
    refused(SourceError, starts, FollowedFiles, late, 8, None, QUICK, FileNotes(Path("files.json")), Event(), print)


def numbered(number: int, count: int = 200) -> list[Bytes]:
    """Pictures that tell which they are."""
    return [np.full((96, 128, 3), (k, number, 0), np.uint8) for k in range(count)]


def live(offsets: tuple[int, ...] = (0, 0)) -> Recording:
    rig = filmed_rig()
    cameras = rig.cameras[: len(offsets)]
    sources = (
        CameraSource(Source("video", Path("live"), address="rtsp://me:secret@there/live"), None, offset)
        for offset in offsets
    )
    return Recording(Path("rig.toml"), Rig("room", 20.0, rig.grid, cameras), tuple(sources))


def opening(*cameras: StandIn) -> Callable[[str, float], Capture]:
    """Each thread opens its own camera, the same one whenever it does."""
    own = dict(zip([f"camera {place}" for place in PLACES], cameras, strict=False))
    return lambda address, silence: own[current_thread().name].open(address, silence)


def test_cameras_are_aligned_by_when_their_pictures_arrive() -> None:
    """The second camera shows everything five frames late, so its offset is -5, and it runs at twice the rate."""
    cameras = (StandIn(numbered(0), 0.05), StandIn(numbered(1), 0.025))
    cameras[1].begun = cameras[0].begun
    with FollowedCameras(live((0, -5)), QUICK, None, Event(), print, opening(*cameras)) as frame_sets:
        some = list(islice(frame_sets, 20))
    assert [frame_set.frame for frame_set in some] == list(range(20))
    assert frame_sets.dropped == 0
    shown = np.array([[int(view[0, 0, 0]) for view in frame_set.views if view is not None] for frame_set in some])  # type: ignore[index]
    assert shown.shape == (20, 2)
    # Half a frame off at most, and what a busy machine adds.
    np.testing.assert_allclose(np.median(shown[:, 1] / 2 - shown[:, 0]), 5, atol=1.1)
    np.testing.assert_allclose(np.median(np.diff(shown, axis=0), 0), [1, 2])


def test_broken_streams_are_reopened_and_full_queues_drop() -> None:
    steady, breaking = StandIn(numbered(0), 0.05), StandIn(numbered(1), 0.05, breaks=[30], refused=3)
    reported = list[str]()
    with FollowedCameras(live(), QUICK, None, Event(), reported.append, opening(steady, breaking)) as frame_sets:
        some = list(islice(frame_sets, 50))
    blind = [k for k, frame_set in enumerate(some) if frame_set.views[1] is None]
    assert blind and blind == list(range(blind[0], blind[-1] + 1))
    assert blind[-1] < 49
    assert not any(frame_set.dropped for frame_set in some)
    assert [line.split(";")[0] for line in reported] == [
        "camera east: no pictures from rtsp://me:***@there/live",
        "camera east: the stream is back",
    ]
    pauses = np.diff(breaking.opened[1:])
    assert (pauses[1:] > 1.5 * pauses[:-1]).all(), pauses
    small = replace(QUICK, buffer_memory=5 * 2 * 128 * 96 * 3 / 2**20)
    cameras, halt, reported = (StandIn(numbered(0), 0.05), StandIn(numbered(1), 0.05)), Event(), list[str]()
    with FollowedCameras(live(), small, None, halt, reported.append, opening(*cameras)) as frame_sets:
        first = next(frame_sets)
        time.sleep(1.0)
        halt.set()
        rest = list(frame_sets)
    assert [frame_set.frame for frame_set in (first, *rest)] == list(range(len(rest) + 1))
    dropped = [frame_set.dropped for frame_set in rest]
    kept = dropped.count(False)
    assert dropped == [True] * (len(rest) - kept) + [False] * kept
    assert 5 <= kept <= 8  # what came while they were taken
    assert all((view is None) == frame_set.dropped for frame_set in rest for view in frame_set.views)
    assert frame_sets.dropped == sum(dropped) > 3 and len(reported) == 1
    assert reported[0].startswith("tracking is slower than the cameras: 1 frame sets dropped so far")


def test_a_run_goes_on_by_its_clock_and_ends_at_other_sizes() -> None:
    connect = opening(StandIn(numbered(0), 0.05))
    with FollowedCameras(live((0,)), QUICK, now() - 100, Event(), print, connect) as frame_sets:
        assert 2000 < next(frame_sets).frame < 2100
    wrong = StandIn([np.zeros((10, 10, 3), np.uint8)], 0.05)
    with FollowedCameras(live((0,)), QUICK, None, Event(), print, opening(wrong)) as frame_sets:
        refused(SourceError, "10x10", next, frame_sets)


def test_an_address_in_the_rig_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    text = format_rig(live(), path).replace("rtsp://me:secret@there/live", "rtsp://me:secret@there:554/live?channel=1")
    recording = parse_rig(text, path)
    assert recording.sources[0].source.address == "rtsp://me:secret@there:554/live?channel=1"
    assert format_rig(recording, path) == text
    provenance = gather_provenance(recording, "")
    assert "secret" not in provenance.rig + str(provenance.sources)
    assert "rtsp://me:***@there:554/live?channel=1" in provenance.rig
    assert "secret" not in refused(SourceError, "--follow", index_streams, recording)
    refused(RigError, "one address", parse_rig, text.replace('kind = "video"', 'kind = "masks"'), path)
    assert mask_passwords('"rtsp://a:b@c/d" "rtsp://c:554/d@e"') == '"rtsp://a:***@c/d" "rtsp://c:554/d@e"'
