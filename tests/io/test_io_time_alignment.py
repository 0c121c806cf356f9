"""Temporal alignment of cameras: trusted stamps and nearest frames."""

import pickle
import tracemalloc
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from checks import cases, drawn, refused
from films import write_at_rate, write_stamped
from hypothesis import strategies as st
from recordings import blank_recording

from stseg.arrays import Boxes, Bytes, Floats, Observation
from stseg.engine.offline.segments import find_gaps
from stseg.errors import RigError, SourceError
from stseg.io.recording.aligned_stream import StreamIndex, index_streams
from stseg.io.recording.frames import open_frames, read_camera
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import read_recording, write_rig
from stseg.io.recording.time_alignment import (
    TimeAlignment,
    align_in_time,
    nearest_frames,
    visible_ranges,
    with_alignment,
)
from stseg.io.recording.video.time_stamps import concatenate_files, interpret_stamps
from stseg.io.runfile.provenance import gather_provenance
from stseg.io.runfile.unfinished.work_folder import WorkFolder

RATE = 10.0
recording = partial(blank_recording, rate=RATE)
NONE = np.zeros(0)


def video(name: str = "a.mp4", **reported: object) -> CameraSource:
    return replace(CameraSource(Source("video", Path(name))), **reported)  # type: ignore[arg-type]


def decided(*cameras: tuple[CameraSource, Floats]) -> TimeAlignment:
    """The alignment of cameras of one file each with these time stamps, in ticks."""
    times = [[own / RATE * 1000] for _, own in cameras]
    return align_in_time(recording(*[source for source, _ in cameras]), times)


def every(step: float, frames: int) -> Floats:
    return np.asarray(np.arange(frames) * step)


WAVERING = np.delete(every(1.0, 61), 30)
"""Sixty frames at the rig's rate, one of which was dropped."""


@pytest.fixture(autouse=True)
def a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """a.mp4, of which nothing but that it is no AVI is asked."""
    monkeypatch.chdir(tmp_path)
    Path("a.mp4").write_bytes(b"RIFF\0\0\0\0WAVE")


@drawn(100, st.lists(st.floats(-0.5, 0.5), min_size=1, max_size=60))
def test_frames_within_half_a_tick_of_their_numbers_show_them(off: list[float]) -> None:
    position = np.arange(len(off)) + np.array([0.0, *off[1:]])
    position = np.maximum.accumulate(position) + 1e-9 * np.arange(len(off))
    frame_at_tick = nearest_frames(position, 1.0)
    assert frame_at_tick[: len(off)].tolist() == list(range(len(frame_at_tick[: len(off)])))
    assert len(off) - 1 <= len(frame_at_tick) <= len(off) + 1


@drawn(100, st.lists(st.floats(0.05, 6.0), min_size=1, max_size=60), st.floats(0.2, 4.0))
def test_what_is_shown_is_near_and_in_order(steps: list[float], period: float) -> None:
    position = np.cumsum([0.0, *steps])
    frame_at_tick = nearest_frames(position, period)
    ticks = np.flatnonzero(frame_at_tick >= 0)
    assert (np.diff(frame_at_tick[ticks]) >= 0).all()
    away = np.abs(position[frame_at_tick[ticks]] - ticks)
    least = np.abs(position[:, None] - np.arange(len(frame_at_tick))).min(axis=0, initial=np.inf)
    assert (away <= 0.75 * max(1.0, period)).all() and (away <= least[ticks] + 0.5 * max(1.0, period)).all()
    assert (least[np.flatnonzero(frame_at_tick < 0)] > 0.25 * max(1.0, period)).all()


@cases()
def test_other_rates(step: float, expected: list[int]) -> None:
    assert nearest_frames(every(step, 40), step)[:6].tolist() == expected


def test_frames_between_ticks_are_steady_dropped_ones_holes() -> None:
    """A late second frame, then frames that are a little early or late, half-way between ticks."""
    off = np.random.default_rng(3).uniform(-0.1, 0.1, 500)
    position = np.append(0.0, np.arange(1, 500) + 0.5 + off[1:])
    frame_at_tick = nearest_frames(position, 1.0)
    assert frame_at_tick[:499].tolist() in (list(range(499)), [0, *range(2, 500)])
    assert nearest_frames(np.array([0.0, 1, 2, 5, 6, 8]), 1.0).tolist() == [0, 1, 2, -1, -1, 3, 4, -1, 5]


@drawn(50, st.sampled_from([10.0, 15.0, 25.0, 29.97, 30.0]), st.lists(st.integers(1, 400), min_size=2, max_size=8))
def test_files_join_as_if_they_were_one(rate: float, lengths: list[int]) -> None:
    """Stamps in whole milliseconds, at the rig's rate or, for 29.97, that of the standard: no border leaves a trace."""
    true = 30000 / 1001 if rate == 29.97 else rate
    times = [np.round(np.arange(length) / true * 1000) for length in lengths]
    stamps = interpret_stamps(times, rate, [Path("x.mkv")] * len(times), NONE)
    assert stamps is not None and np.abs(stamps.position - np.arange(sum(lengths))).max() < 0.1


def test_a_week_of_hours_does_not_drift_nor_does_another_rate() -> None:
    times = [np.round(every(1000 / RATE, 3600) + 0.3)] * 168
    stamps = interpret_stamps(times, RATE, [Path("x.mkv")] * 168, NONE)
    assert stamps is not None and stamps.fits(np.arange(3600.0 * 168))
    times = [every(40.0, 500)] * 3
    stamps = interpret_stamps(times, RATE, [Path("x.mkv")] * 3, NONE)
    assert stamps is not None
    np.testing.assert_allclose(stamps.position, 0.4 * np.arange(1500), atol=1e-6)
    assert stamps.period == pytest.approx(0.4) and stamps.steady


@pytest.mark.parametrize("times", [[0.0, 100, 100], [0.0, 100, 0], [np.nan] * 3, [0.0, 0.0, 0.0], [0.0, 100, 1e8]])
def test_stamps_that_do_not_rise_are_none(times: list[float]) -> None:
    assert interpret_stamps([np.array(times)], RATE, [Path("x.mkv")], NONE) is None


def test_starts_and_blind_cameras_leave_gaps() -> None:
    files, paths = [every(1.0, 3), every(1.0, 2)], [Path("a"), Path("b")]
    assert concatenate_files(files, 1.0, RATE, paths, np.array([0.0, 0.7])).tolist() == [0, 1, 2, 7, 8]
    said = r"b: starts: found 0\.200 s, when the previous file goes on until 0\.200 s"
    refused(SourceError, said, concatenate_files, files, 1.0, RATE, paths, np.array([0.0, 0.2]))
    shown = [np.array([[2, 8], [24, 29]]), np.array([[6, 10], [15, 22]])]
    assert find_gaps(shown, 0, 30, 2) == [(10, 15)]
    assert find_gaps(shown, 0, 30, 1) == [(0, 2), (10, 15), (22, 24)]
    assert find_gaps(shown, 12, 23, 2) == [(12, 15)] and find_gaps(shown, 11, 14, 2) == [(11, 14)]


WRONG_HEADERS = "cam1, cam2: the time stamps say 20 frames per second, the rig 10; the frames are counted"


@pytest.mark.parametrize(
    ("cameras", "notes"),
    [
        pytest.param([every(1.0, 60), every(1.0, 60) + 0.4 * (np.arange(60) % 2)], [], id="the rate of the rig"),
        pytest.param([every(0.5, 60), every(0.5, 60)], [WRONG_HEADERS], id="headers that are all wrong"),
        pytest.param(
            [np.array([0.0, 1, 1, 2]), np.full(4, np.nan)],
            ["cam1: the time stamps do not rise, or jump by a day; the frames are counted"], id="broken stamps",
        ),
        pytest.param([every(1.0, 60), every(0.5, 60)], ["cam2: "], id="as many frames as a camera with a true header"),
    ],
)  # fmt: skip
def test_frames_are_counted(cameras: list[Floats], notes: list[str]) -> None:
    clock = decided(*((video(), own) for own in cameras))
    assert clock.frame_at_tick == (None, None)
    assert [note[: len(start)] for note, start in zip(clock.notes, notes, strict=True)] == notes
    assert all("the frames are counted" in note for note in clock.notes)


def test_stamps_that_vary_or_drift_or_are_asked_for_count() -> None:
    clock = decided((video(), WAVERING), (video(), every(1.0, 61)))
    assert clock.frame_at_tick[1] is None
    assert np.flatnonzero(np.asarray(clock.frame_at_tick[0]) < 0).tolist() == [30]
    assert [note[:26] for note in clock.notes] == ["cam1: the time stamps vary"]
    clock = decided((video(), every(1.0, 2000)), (video(), every(1.001, 1998)))
    assert np.asarray(clock.frame_at_tick[1])[[0, 1, 2, 1900]].tolist() == [0, 1, 2, 1898]
    assert decided((video(clock="count"), WAVERING)) == TimeAlignment((None,), ())
    clock = decided((video(clock="stamps"), every(0.5, 60)))
    assert np.asarray(clock.frame_at_tick[0]).tolist() == list(range(0, 60, 2)) and clock.notes == ()
    said = "camera cam1, clock: found files without time stamps that rise"
    refused(SourceError, said, decided, (video(clock="stamps"), np.full(3, np.nan)))


@pytest.mark.parametrize("other", [every(1.0, 60), WAVERING])
def test_another_rate_counts_if_a_camera_keeps_the_rigs(other: Floats) -> None:
    clock = decided((video(), other), (video(), every(0.5, 120)))
    assert np.asarray(clock.frame_at_tick[1])[:60].tolist() == list(range(0, 120, 2))
    assert any("20 frames per second, the rig 10; each tick shows the nearest frame" in n for n in clock.notes)


def test_avi_holds_no_times_and_no_stamps_cost_no_memory(tmp_path: Path) -> None:
    path = write_at_rate(tmp_path / "a.avi", [np.zeros((12, 16, 3), np.uint8)] * 3, RATE)
    assert decided((video(str(path)), WAVERING)) == TimeAlignment((None,), ())
    (tmp_path / "boxes.csv").write_text("frame,left,top,width,height\n5,1,2,3,4\n19999990,1,2,3,4\n")
    far = recording(CameraSource(Source("boxes", tmp_path / "boxes.csv")))
    tracemalloc.start()
    streams = pickle.loads(pickle.dumps(index_streams(far)))
    with WorkFolder(tmp_path / "run.h5", {}) as work:
        work.keep_streams(streams)
        kept = work.streams(far)
    assert tracemalloc.get_traced_memory()[1] < 60e6
    tracemalloc.stop()
    assert [index and index.multi_view_range(far) for index in (streams, kept)] == [(0, 19_999_991)] * 2


@pytest.mark.parametrize("blind", [False, True])
def test_ends_that_nearly_meet_are_made_to(blind: bool) -> None:
    missing = "blind" if blind else "error"
    sources = [video(on_missing=missing), video(on_missing=missing), video(on_missing=missing, offset=2)]
    clock = decided(*zip(sources, (every(1.0, 60), WAVERING[:55], np.append(WAVERING, [64.0, 65.0])), strict=True))
    lengths = [None if own is None else len(own) for own in clock.frame_at_tick]
    assert lengths == ([None, 56, 66] if blind else [None, 60, 58])


@cases()
def test_starts_are_one_for_each_file(starts: list[float], reported: str) -> None:
    source = CameraSource(Source("video", Path("a"), more=(Path("b"),), starts=tuple(starts)))
    times = [[every(100.0, 3), every(100.0, 3)]]
    refused(SourceError, f"camera cam1, source.starts: found {reported}", align_in_time, recording(source), times)


@drawn(60, st.lists(st.tuples(st.integers(1, 9), st.integers(-4, 6), st.booleans()), min_size=1, max_size=3))
def test_seen_is_what_is_not_blind(cameras: list[tuple[int, int, bool]]) -> None:
    rng = np.random.default_rng(0)
    sources, length = [], max(1, *(count + offset for count, offset, _ in cameras), 1)
    for count, offset, timed in cameras:
        frame_at_tick = np.where(rng.random(count) < 0.7, np.arange(count), -1) if timed else None
        sources.append(video(offset=offset, frame_at_tick=frame_at_tick))
    shown = visible_ranges(recording(*sources), [count for count, _, _ in cameras], length)
    for own, source, (count, offset, _) in zip(shown, sources, cameras, strict=True):
        for frame in range(length):
            tick = frame - offset
            expected = 0 <= tick < count and (source.frame_at_tick is None or source.frame_at_tick[tick] >= 0)
            assert any(first <= frame < stop for first, stop in own) == expected


def shown_number(view: Observation) -> int | None:
    """The number of the frame that a view shows."""
    assert not isinstance(view, Boxes)
    return None if view is None else round(float(view[6, 8, 0]) / 8)


def stamped(path: Path, seconds: Floats) -> CameraSource:
    pictures: list[Bytes] = [np.full((12, 16, 3), 8 * k, np.uint8) for k in range(len(seconds))]
    write_stamped(path, pictures, seconds.tolist())
    return CameraSource(Source("video", path))


@pytest.fixture
def uneven(tmp_path: Path) -> Recording:
    """One camera in time, one that drops frames, one of half the rate."""
    return recording(
        stamped(tmp_path / "a.mkv", every(0.1, 20)),
        stamped(tmp_path / "b.mkv", np.delete(every(0.1, 20), [5, 6, 12])),
        stamped(tmp_path / "c.mkv", every(0.2, 10)),
    )


def test_frames_are_read_where_they_were_taken(uneven: Recording) -> None:
    streams = index_streams(uneven)
    assert streams.length == 20
    with open_frames(uneven, 0, None, streams) as reader:
        views = [tuple(map(shown_number, frame_set.views)) for frame_set in reader]
    dropped = iter(range(17))
    assert [row[0] for row in views] == list(range(20))
    assert [row[1] for row in views] == [None if k in (5, 6, 12) else next(dropped) for k in range(20)]
    assert [row[2] for row in views[::2]] == list(range(10))
    for first in range(20):
        with open_frames(uneven, first, min(first + 2, 20), streams) as reader:
            assert [tuple(map(shown_number, frame_set.views)) for frame_set in reader] == views[first : first + 2]
    assert [shown_number(view) for view in read_camera(uneven, 1, [4, 6, 13], streams)] == [4, None, 10]
    assert [int(np.diff(own).sum()) for own in streams.visible_ranges(uneven)] == [20, 17, 19]


def test_the_rig_says_clocks_and_ends_apart_are_refused(tmp_path: Path) -> None:
    rec = recording(
        stamped(tmp_path / "a.mkv", every(0.1, 31)), stamped(tmp_path / "b.mkv", np.delete(every(0.1, 20), 5))
    )
    reported = r'cam2: found its end at frame 20.* or on_missing = "blind", or clock = "count" where time stamps'
    refused(SourceError, reported, index_streams, rec)
    path = tmp_path / "rig.toml"
    source = Source("video", tmp_path / "a.mkv", more=(tmp_path / "b.mkv",), starts=(0.0, 3600.5))
    write_rig(path, recording(CameraSource(source, clock="stamps")))
    assert read_recording(path).sources[0].source.starts == (0.0, 3600.5)
    assert read_recording(path).sources[0].clock == "stamps"
    path.write_text(path.read_text().replace('clock = "stamps"', 'clock = "sundial"'))
    refused(RigError, "clock", read_recording, path)


def test_what_was_found_of_time_is_kept(uneven: Recording, tmp_path: Path) -> None:
    streams = index_streams(uneven)
    with WorkFolder(tmp_path / "run.h5", {}) as folder:
        folder.keep_streams(streams)
        kept = folder.streams(uneven)
    for again in (kept, pickle.loads(pickle.dumps(streams))):
        assert isinstance(again, StreamIndex)
        assert (again.length, again.notes) == (streams.length, streams.notes)
        np.testing.assert_equal(tuple(again.frame_at_tick), tuple(streams.frame_at_tick))
    provenance = gather_provenance(with_alignment(uneven, streams.frame_at_tick), "")
    assert sorted(provenance.frame_at_tick) == ["cam2", "cam3"]
