"""Run files: contents, atomic writing, and errors for broken files."""

import gc
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from fcntl import LOCK_EX, flock
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, BinaryIO
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from checks import cases, in_ci, refused
from recordings import assert_same
from run_files import (
    CONFIG,
    FRAMES,
    append_frames,
    fill,
    small_ghosts,
    small_recording,
    small_trajectory,
    small_volume,
    table_of,
    trajectory_of,
    write_empty_run,
    write_small_run,
)

from stseg.arrays import Bytes
from stseg.errors import FormatError, OutputError
from stseg.geometry import Grid
from stseg.io.outputs.whole_files import create_part, parts_of, replacing
from stseg.io.recording.rig_text import format_rig
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import packed_frame
from stseg.io.runfile.runs import RunWriter, read_run, read_trajectory
from stseg.io.runfile.unfinished import part_file
from stseg.records.tables import RATES, TRAJECTORY, Tracks
from stseg.tasks.overview import summarise_run

if TYPE_CHECKING:
    from _typeshed import TraceFunction

VIEWS: Bytes = np.full((3, 4, 6), 2, np.uint8)


def writer_at(path: Path, overwrite: bool = False) -> RunWriter:
    return RunWriter(path, small_recording(path.parent), VIEWS, CONFIG, overwrite=overwrite)


class Hindered:
    """A file of which every write calls something first."""

    def __init__(self, file: BinaryIO, hinder: Callable[[memoryview], object]) -> None:
        self._file, self._hinder = file, hinder

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)

    def write(self, data: memoryview) -> int:
        self._hinder(data)
        return self._file.write(data)


def patch_file(monkeypatch: pytest.MonkeyPatch, hinder: Callable[[memoryview], object]) -> None:
    fdopen: Callable[..., BinaryIO] = os.fdopen
    monkeypatch.setattr(os, "fdopen", lambda *given, **how: Hindered(fdopen(*given, **how), hinder))
    monkeypatch.setattr(part_file, "lock", lambda _: None)


def test_every_table_frame_rig_and_stream_reads_back(run_path: Path) -> None:
    run, (log_odds, label) = read_run(run_path), small_volume()
    assert (run.scene, run.frame_rate, run.cameras) == ("hall", 5.0, ("left", "right"))
    np.testing.assert_array_equal(run.frames, FRAMES)
    np.testing.assert_array_equal(run.trajectory, small_trajectory())
    np.testing.assert_array_equal(run.tracks, Tracks(small_trajectory()).summary())
    np.testing.assert_array_equal(run.ghosts, small_ghosts())
    np.testing.assert_array_equal(run.views, VIEWS)
    assert [len(table) for table in (run.boxes, run.events, run.windows, run.rates, run.timings)] == [1, 2, 2, 4, 4]
    assert run.windows["energy"].tolist() == [12345, 12345]
    for index, frame in enumerate(FRAMES):
        read_log_odds, read_label = run.read_frame(int(frame))
        np.testing.assert_allclose(read_log_odds, log_odds[index], rtol=1e-3)
        assert read_log_odds.dtype == np.float32
        np.testing.assert_array_equal(read_label, label[index])
    np.testing.assert_array_equal(read_trajectory(run_path), small_trajectory())
    recording = small_recording(run_path.parent)
    assert format_rig(run.recording, recording.path) == format_rig(recording, recording.path)
    assert run.recording.sources == recording.sources and run.provenance.config == CONFIG
    assert {"stseg", "python", "numpy", "h5py", "hdf5", "numba"} <= set(run.provenance.versions)
    left, right = run.provenance.sources
    assert (left["camera"].decode(), left["files"], left["size"]) == ("left", 1, 5)
    assert left["modified"] == (run_path.parent / "left.avi").stat().st_mtime
    assert (right["files"], right["size"]) == (0, 0) and np.isnan(right["modified"])


def test_equal_runs_differ_only_in_timings_and_provenance(tmp_path: Path) -> None:
    assert_same(write_small_run(tmp_path / "first.h5"), write_small_run(tmp_path / "second.h5"))


def test_runs_of_no_frames_of_far_log_odds_and_many_appends(tmp_path: Path) -> None:
    with writer_at(tmp_path / "none.h5") as writer:
        writer.finish(Tracks(trajectory_of()).summary())
    run = read_run(tmp_path / "none.h5")
    assert len(run.frames) == len(run.trajectory) == len(run.tracks) == 0
    refused(ValueError, "frame 3", run.read_frame, 3)
    log_odds, label = small_volume(1)
    log_odds[0, 0, 0, 1:5] = np.inf, -1e6, 0.3, -0.33
    with writer_at(tmp_path / "far.h5") as writer:
        append_frames(writer, FRAMES[:1], log_odds, label)
        writer.finish(Tracks(trajectory_of()).summary())
    kept = read_run(tmp_path / "far.h5").read_frame(10)[0][0, 0, :5]
    np.testing.assert_array_equal(kept, [np.nan, 65536, -65536, 10 / 32, -11 / 32])
    rows = table_of(TRAJECTORY, frame=np.arange(10_000), id=1)
    with writer_at(tmp_path / "long.h5") as writer:
        for start in range(0, len(rows), 7):
            part = rows[start : start + 7].copy()
            writer.append("trajectory", part)
            part["frame"] = -1  # the caller may use the array again
        writer.finish(Tracks(rows[:0]).summary())
    np.testing.assert_array_equal(read_trajectory(tmp_path / "long.h5"), rows)


def test_slips_are_refused_and_parts_of_killed_runs_removed(tmp_path: Path) -> None:
    log_odds, label = small_volume(2)
    with writer_at(tmp_path / "slip.h5") as writer:
        append_frames(writer, np.array([4, 6]), log_odds, label)
        refused(ValueError, "after frame 6", append_frames, writer, np.array([6, 7]), log_odds, label)
        refused(ValueError, "labels of 3 frames for 2", writer.append_packed_labels, [packed_frame(label[0])])
        writer.append_packed_log_odds(np.array([7]), [packed_frame(log_odds[0])])
        refused(ValueError, "labels of 2 frames for 3", writer.finish, Tracks(trajectory_of()).summary())
        refused(ValueError, "rows", writer.append, "ghosts", np.zeros(1, layout.ghost_type(3)))
    other = tmp_path / "other.h5"
    refused(ValueError, "views", RunWriter, other, small_recording(tmp_path), VIEWS[:2], CONFIG, overwrite=False)
    part, descriptor = create_part(tmp_path / "night.h5")
    os.close(descriptor)
    (tmp_path / "night.h5.part").write_text("precious")
    assert len(read_run(write_small_run(tmp_path / "night.h5")).frames) == 6 and not part.exists()
    assert (tmp_path / "night.h5.part").read_text() == "precious"


def test_overwriting_replaces_at_the_end_in_chunks_and_polygon(run_path: Path) -> None:
    before = run_path.read_bytes()
    refused(OutputError, "exists", writer_at, run_path)
    assert run_path.read_bytes() == before and not parts_of(run_path)
    with writer_at(run_path, overwrite=True) as writer:
        fill(writer)
        assert run_path.read_bytes() == before and parts_of(run_path)
        writer.finish(Tracks(small_trajectory()[:0]).summary())
    assert len(read_run(run_path).tracks) == 0 and not parts_of(run_path)
    with h5py.File(run_path) as file:
        assert (file.attrs["NX_class"], file["entry/occupancy"].attrs["NX_class"]) == ("NXroot", "NXdata")
        for signal in ("log_odds", "label"):
            dataset = file["entry/occupancy"][signal]
            assert (dataset.chunks, dataset.compression, dataset.shuffle) == ((1, 3, 4, 6), "gzip", True)
            assert (dataset.compression_opts, dataset.maxshape[0]) == (1, None)
        assert file["entry/occupancy/log_odds"].dtype == np.float32
    triangle = Grid((0, 1), (0, 1), polygon=np.array([[0, 0], [1, 0], [0, 1.0]]))
    assert layout.walkable_area(triangle) == "POLYGON ((0.0 0.0, 1.0 0.0, 0.0 1.0, 0.0 0.0))"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_the_old_file_and_no_part(run_path: Path, error: type[BaseException]) -> None:
    before = run_path.read_bytes()
    with pytest.raises(error), writer_at(run_path, overwrite=True) as writer:
        fill(writer)
        raise error
    assert run_path.read_bytes() == before and not parts_of(run_path)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Interrupts as at a terminal: a process in the background of a shell may ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("step", [0, 50, 110, *in_ci(1, 3, 10, 30, 70, 90, 100)])
def test_an_interrupt_inside_a_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    steps = iter(range(1000))
    patch_file(monkeypatch, lambda _: signal.raise_signal(signal.SIGINT) if next(steps) == step else None)
    with pytest.raises(KeyboardInterrupt):
        write_small_run(tmp_path / "night.h5")
    assert next(steps) > step
    assert [file.name for file in tmp_path.iterdir()] == ["left.avi"]
    gc.collect()  # a file that HDF5 could not close would crash here
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.slow
@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_at_any_line_leaves_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once at each line of the code that makes a part, writes to it and publishes it, and while the system makes it."""
    reached, interrupted = list[tuple[str, int]](), False

    def interrupt(frame: FrameType, event: str, _: object) -> "TraceFunction | None":
        nonlocal interrupted
        name = Path(frame.f_code.co_filename).name
        if name not in ("part_file.py", "whole_files.py"):
            return None
        if event == "line" and not interrupted and (name, frame.f_lineno) not in reached:
            reached.append((name, frame.f_lineno))
            interrupted = True
            signal.raise_signal(signal.SIGINT)
        return interrupt

    def interrupted_open(*arguments: Any) -> int:
        descriptor = system_open(*arguments)
        if not reached and str(arguments[0]).endswith(".part"):
            signal.raise_signal(signal.SIGINT)
        return descriptor

    def write(trace: "TraceFunction | None") -> None:
        sys.settrace(trace)
        try:
            write_empty_run(tmp_path / "night.h5")
        finally:
            sys.settrace(None)
            assert not parts_of(tmp_path / "night.h5"), reached[-1:]

    system_open = os.open
    monkeypatch.setattr(os, "open", interrupted_open)
    with pytest.raises(KeyboardInterrupt):
        write(None)
    interrupted = True
    while interrupted:
        interrupted = False
        with suppress(KeyboardInterrupt):
            write(interrupt)
    assert len(reached) > 50


@pytest.mark.skipif(os.name == "nt", reason="needs the locks of POSIX systems")
def test_two_runs_into_one_file_are_refused(tmp_path: Path) -> None:
    with writer_at(tmp_path / "night.h5") as writer:
        fill(writer)
        refused(OutputError, "another run", write_small_run, tmp_path / "night.h5")
        writer.finish(Tracks(small_trajectory()).summary())
    assert len(read_run(tmp_path / "night.h5").frames) == 6


def test_a_file_that_appears_meanwhile_is_not_destroyed(tmp_path: Path) -> None:
    path = tmp_path / "night.h5"
    with pytest.raises(OutputError, match=r"kept in .*night\.h5\..*\.part"), writer_at(path) as writer:
        fill(writer)
        path.write_text("precious")
        writer.finish(Tracks(small_trajectory()).summary())
    assert path.read_text() == "precious"
    (part,) = parts_of(path)
    assert len(read_run(part).frames) == 6


@cases()
def test_impossible_places_are_refused_before_any_work(tmp_path: Path, name: str, found: str) -> None:
    small_recording(tmp_path)
    refused(OutputError, found, RunWriter, tmp_path / name, small_recording(tmp_path), VIEWS, CONFIG, overwrite=True)


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "open", Mock(side_effect=PermissionError(13, "Permission denied")))
    refused(OutputError, "Permission denied", write_small_run, tmp_path / "night.h5")


@pytest.mark.parametrize("room", [0, 8000, 20000, *in_ci(100, 3000, 12000, 16000)])
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    path, written = tmp_path / "night.h5", 0
    path.write_text("old")

    def fill_up(data: memoryview) -> None:
        nonlocal written
        written += data.nbytes
        if written > room:
            raise OSError(28, "No space left on device")

    patch_file(monkeypatch, fill_up)
    refused(OutputError, "No space left on device", write_small_run, path, overwrite=True)
    assert path.read_text() == "old" and not parts_of(path)
    gc.collect()  # a file that HDF5 could not close would crash here


def test_bytes_refused_by_a_full_disk_are_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A buffer that is not filled has what lay there in memory before, which HDF5 would take for its own."""

    def fill_up(data: memoryview) -> None:
        if data.nbytes > 4:
            raise OSError(28, "No space left on device")

    patch_file(monkeypatch, fill_up)
    file = part_file.PartFile(tmp_path / "night.h5")
    for place, data in ((0, b"abcd"), (2, b"CDEFGH"), (10, b"kl")):
        file.seek(place)
        assert file.write(memoryview(data)) == len(data)
    buffer = bytearray(b"?" * 14)
    file.seek(1)
    assert file.readinto(memoryview(buffer)) == 14 and bytes(buffer) == b"bCDEFGH\0\0kl\0\0\0"
    file.discard(lambda: None)


def test_text_outputs_replace_only_when_whole(tmp_path: Path) -> None:
    path = tmp_path / "tracks.csv"
    path.write_text("old")
    refused(OutputError, "exists", replacing(path, overwrite=False).__enter__)
    with pytest.raises(RuntimeError), replacing(path, overwrite=True) as part:
        part.write_text("new")
        raise RuntimeError
    assert path.read_text() == "old"
    with pytest.raises(OutputError, match=r"tracks\.csv: found gone"), replacing(path, overwrite=True) as part:
        raise OutputError(part, "", "gone", "a place")
    with replacing(path, overwrite=True) as part:
        part.write_text("new")
    assert [file.read_text() for file in tmp_path.iterdir()] == ["new"]


def test_what_is_no_run_file_and_no_table_is_told(tmp_path: Path, run_path: Path) -> None:
    refused(FormatError, "no such file", read_run, tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("frame,id,x,y\n")
    refused(FormatError, "not HDF5", read_run, tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    refused(FormatError, "/@format: found nothing", read_run, tmp_path / "other.h5")
    refused(FormatError, "found", read_run, tmp_path)
    with h5py.File(run_path, "r+") as file:
        del file["boxes"]
        file.create_group("boxes")
    refused(FormatError, "/boxes: found no array", read_run, run_path)
    with run_path.open("rb") as file:
        flock(file, LOCK_EX)
        refused(FormatError, "still being written", read_run, run_path)
    run_path.write_bytes(run_path.read_bytes()[:-3000])
    refused(FormatError, "whole run file", read_run, run_path)


@cases(
    ("/windows", np.zeros((2, 2)), "/windows: found the type float64"),
    ("/tracks", np.zeros((2, 2), TRAJECTORY), "/tracks: found the type"),
    ("/entry/occupancy/views", np.zeros((3, 4, 5), "u1"), "/entry/occupancy/views: found the shape"),
    ("/entry/occupancy/log_odds", np.zeros((6, 3), "f4"), "/entry/occupancy/log_odds: found 2 dim"),
)
def test_what_is_missing_or_wrong_is_named(run_path: Path, place: str, value: object, named: str) -> None:
    name, _, attribute = place.partition("@")
    with h5py.File(run_path, "r+") as file:
        values, key = (file[name].attrs, attribute) if attribute else (file, name)
        del values[key]
        if not isinstance(value, list):
            values[key] = value
    refused(FormatError, re.escape(f"{run_path}: {named}"), read_run, run_path)


def test_runs_without_rates_and_with_a_broken_chunk(run_path: Path) -> None:
    with h5py.File(run_path, "r+") as file:
        file["rates"].resize((0,))
    run = read_run(run_path)
    assert (len(run.rates), run.rates.dtype) == (0, RATES) and not len(run.data_frame("rates"))
    assert (summarise_run(run).rates, len(run.windows)) == ({}, 2)
    with h5py.File(run_path) as file:
        chunk = file["trajectory"].id.get_chunk_info(0)
    data = bytearray(run_path.read_bytes())
    data[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    run_path.write_bytes(data)
    refused(FormatError, "/trajectory", getattr, read_run(run_path), "trajectory")
