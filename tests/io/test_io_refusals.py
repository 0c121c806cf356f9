"""What readers and writers refuse, of detections, calibrations, runs, names, videos and notes: one line says what."""

import errno
import json
import os
import re
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import cv2
import h5py
import numpy as np
import pytest
from attacks import film, write_rig
from checks import cases, frozen, refused, tables

from stseg import InputError, Source, read_config, read_recording, read_run, read_tracks_csv
from stseg.commands.measure import measure
from stseg.commands.review import review
from stseg.errors import ConfigError, FormatError, OutputError, SourceError
from stseg.io.answers import read_answers, read_names
from stseg.io.calibrations.formats import ImportOptions, read_cameras
from stseg.io.detections.source_detections import read_source
from stseg.io.exports.archive import ARCHIVES
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.live_stream import FFmpegCapture
from stseg.io.live.live_tables import LiveTable
from stseg.io.outputs import simulated_scene
from stseg.io.outputs.video_writer import write_film
from stseg.io.outputs.whole_files import clear_frames, publish_part
from stseg.io.recording.video.ffmpeg import read_video_size
from stseg.io.runfile.corrected import write_corrected
from stseg.io.runfile.provenance import sampled_checksum
from stseg.io.runfile.unfinished.work_files import read_stream_times
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.io.toml import parse_toml
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes
from stseg.io.untrusted.numpy_files import parse_npy, read_npz
from stseg.io.untrusted.safe_hdf5 import read_whole, require_sound_heaps
from stseg.io.untrusted.values import is_file_name, is_name, is_title
from stseg.records.tables import ANSWER, TRAJECTORY, Tracks
from stseg.tasks.correction import answered_before

SIZE = (80, 60)
TEXTS = tables(Path(__file__).with_suffix(".toml"))["texts"]
"""A calibration of each format."""


def read(folder: Path, name: str, text: str, **keys: Any) -> object:
    """A source of one file, or of the folder that holds it."""
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    given = {key: frozen(value) for key, value in keys.items()}
    return read_source(Source("boxes", folder / name.split("/")[0], **given), SIZE)


@cases()
def test_unknown_json_is_named(tmp_path: Path, name: str, texts: list[str]) -> None:
    assert read(tmp_path, "frames/0.json", "[]"), "a frame without detections"
    for text in texts:
        refused(InputError, "found JSON of no known detections, expected one of Ultral", read, tmp_path, name, text)


@cases(("x.json", f'[[{{"box":{{"x1":1}},"segments":{{"x":[1{"0" * 400}],"y":[1]}}}}]]', {}, "detection 0: found x"))
def test_detections_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, keys: dict[str, Any], message: str
) -> None:
    if name.endswith(".parquet"):
        pytest.importorskip("pyarrow")
    monkeypatch.setattr(limits, "BOXES_PER_FRAME", 1)
    monkeypatch.setattr(limits, "ROWS", 2)
    keys = keys | ({"image_list": tmp_path / name} if "image_list" in keys else {})
    assert "\n" not in refused(InputError, message, read, tmp_path, name, text, **keys)


@cases(("krt", "c.json", "", "[" * 100_000, "what is not JSON"))
def test_calibrations_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str, name: str, old: str, new: str, message: str
) -> None:
    if format == "kalibr":
        pytest.importorskip("yaml")
    monkeypatch.setattr(limits, "CAMERAS", 2)
    (tmp_path / name).write_text(TEXTS[format].replace(old, new) if old else new)
    said = refused(InputError, message, read_cameras, format, [tmp_path / name], ImportOptions(SIZE, "m", 1.8))
    assert "\n" not in said and f"{name}: " in said


@pytest.mark.parametrize(("size", "unit", "missing"), [(None, "m", "--size"), (SIZE, None, "--unit")])
def test_homographies_of_pom_need_size_and_unit(size: Any, unit: str | None, missing: str) -> None:
    refused(InputError, f"{missing}: found nothing", read_cameras, "pom", [], ImportOptions(size, unit, 1.8))


READERS: dict[str, Callable[[Path], object]] = {
    "answers": partial(read_answers, actions=("split", "swap", "name")), "names": read_names, "tracks": read_tracks_csv,
}  # fmt: skip


@cases()
def test_tables_are_refused(tmp_path: Path, reader: str, text: str, message: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    assert "\n" not in refused(FormatError, f"t.csv: {message}", READERS[reader], tmp_path / "t.csv")


def put(file: h5py.File, name: str, value: Any, **keys: Any) -> None:
    """An object in place of another; an attribute is `object@name`, a column's first value `object.column`."""
    name, mark, part = re.split("([@.]|$)", name, maxsplit=1)
    if mark == "@":
        file[name].attrs[part] = value
        return
    if mark:
        rows = file[name][:]
        rows[part][0], value = value, rows
    rate = file[name].attrs.get("fps", 1.0) if name in file else 1.0
    if name in file:
        del file[name]
    file.create_dataset(name, data=value, **keys).attrs["fps"] = rate


CELLS = np.zeros((6, 3, 4, 6), "i4")
GROWING = {"maxshape": (None, 3, 4, 6), "chunks": (65, 3, 4, 6)}
LONG = "x" * 9999
MADE: dict[str, Callable[..., Any]] = {"twice": lambda rows: np.repeat(rows, 2), "as floats": lambda rows: rows + 0.0}


@cases(
    ("/provenance/sources", np.zeros(3), "provenance", "sources of another form"),
    ("/provenance/shown/0", np.zeros(3), "provenance", "shown of camera left: no frames by tick"),
    ("/provenance/shown/0", np.zeros((3, 3), int), "provenance", "shown of camera left: no frames by tick"),
    ("/entry/occupancy/label", GROWING, "frames", r"label: frames of \(3, 4, 6\) in chunks of \(65, 3, 4, 6\)"),
    ("/entry/occupancy/views", np.zeros(9**5, "u1"), "frames", "."),
    ("/entry/occupancy@kept", LONG, "frames", "occupancy@kept: found 'xxx.*, expected one of all, tracks, none"),
    ("/trajectory@fps", LONG, "frames", "trajectory@fps: found 'xxx"),
    ("/@cameras", [LONG], "frames", "/@cameras: found .'xxx"),
)
def test_objects_are_refused(run_path: Path, name: str, value: Any, part: str, message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        if value is GROWING:
            put(file, name, CELLS, **GROWING)
        else:
            make = MADE.get(value) if isinstance(value, str) else None
            put(file, name, value if make is None else make(file[name][:]))
        if "shown" in name:
            file[name].attrs["camera"] = "left"

    def read() -> object:
        found = getattr(read_run(run_path), part)
        return found() if callable(found) else found

    said = refused(FormatError, message, read)
    assert said.isprintable() and len(said) < 600 + len(str(run_path))
    for command in (measure, review) if part == "require_consistency" else ():
        refused(FormatError, message, command, run_path, output=run_path.with_name("out"))


@pytest.mark.parametrize(("name", "value", "message"), [
    ("/boxes", None, "/boxes: found a table of fixed size"),
    ("/entry/occupancy/label", -1, "label: found labels that are no ids"),
    ("/answers", np.array([(1, 0, 0)], ANSWER), "/answers: found a row after its other"),
])  # fmt: skip
def test_runs_that_cannot_be_corrected_are_refused(run_path: Path, name: str, value: Any, message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        put(file, "/committed", file["trajectory"][[0, -1]])
        if isinstance(value, int):
            file[name][0, 0, 0, 1] = value
        else:
            put(file, name, file[name][:] if value is None else value)
    run = read_run(run_path)

    def correct() -> None:
        rows = answered_before(run).table
        tracks = Tracks(run.trajectory, run.boxes, run.events)
        write_corrected(run_path, run_path.with_name("n.h5"), tracks, rows, lambda old, _: old, {}, "", False)

    refused(FormatError, message, correct)
    assert not run_path.with_name("n.h5").exists()


def test_titles_print_without_escape_codes(run_path: Path) -> None:
    with h5py.File(run_path, "r+") as file:
        put(file, "/entry/title", "\x1b[31m")
        put(file, "/provenance@created", "\x1b[31m")
    run = read_run(run_path)
    assert (run.scene, run.provenance.created) == (r"\x1b[31m", r"\x1b[31m")


@pytest.mark.parametrize(("make", "message"), [
    (lambda file: file.create_group("a/b/c/d/e/f/g/h/i/j"), "i/j: more than 10000 objects, or groups nested too"),
    (lambda file: file.create_dataset("x", (9,), "u1", compression="lzf"), r"/x: packed with filters \[32000\]"),
    (lambda file: file.create_dataset("x", (1 << 30,), "u1", chunks=(1 << 30,)), "/x: chunks of 1073741824 bytes"),
])  # fmt: skip
def test_structures_of_hdf5_are_refused(run_path: Path, make: Callable[[h5py.File], object], message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        make(file)
    refused(FormatError, message, read_run, run_path)


def test_short_addresses_of_hdf5_are_refused(tmp_path: Path) -> None:
    properties = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    properties.set_sizes(4, 4)
    h5py.h5f.create(bytes(tmp_path / "a.h5"), fcpl=properties).close()
    refused(FormatError, r"addresses and lengths of \(4, 4\) bytes", read_run, tmp_path / "a.h5")


NOW, COUNT, ONE = np.arange(4.0), np.array([4]), np.ones(1, int)


@pytest.mark.parametrize("stored", [
    {"times0_0": NOW},
    *({"files": files, "times0_0": NOW} for files in (COUNT[:0], np.ones(1), np.ones(257, int))),
    {"files": ONE},
    *({"files": ONE, "times0_0": t} for t in (NOW.astype("f4"), NOW[:, None], -ONE, ONE + limits.FRAMES)),
])  # fmt: skip
def test_stored_time_stamps_are_refused(tmp_path: Path, stored: dict[str, np.ndarray]) -> None:
    recording = read_recording(write_rig(tmp_path))
    np.savez(tmp_path / "streams.npz", files=np.ones(1, int), times0_0=COUNT)
    kept = read_stream_times(tmp_path / "streams.npz", recording)
    assert kept is not None and kept.length == 4
    np.savez(tmp_path / "streams.npz", **stored)  # type: ignore[arg-type]
    assert read_stream_times(tmp_path / "streams.npz", recording) is None


@pytest.mark.parametrize(("question", "wrong"), [
    (is_name, [5, "€" * 90, "x" * 101, " a", "..", "a/b", "\x1b", "@a"]),
    (is_title, [5, "", "x" * 101, " a", "\x1b", "=1+1", "-2+3", "+a"]),
    (is_file_name, [5, "", ".", "..", "a/b", "a\0b", "x" * 256, "x" * 5000]),
])  # fmt: skip
def test_names_of_three_kinds(question: Callable[[object], bool], wrong: list[object]) -> None:
    assert not any(map(question, wrong)) and question("a b") and question("-1")


_BEGIN, _SEVEN = "GCOL\1\0\0\0", "\0" * 7
HEAPS = f"{_BEGIN}\x40{_SEVEN}\1{_SEVEN}\x10{_SEVEN}{_BEGIN}{_SEVEN}\0{_SEVEN}\0\x10{_SEVEN}"
"""A heap of an object, in which another one begins, and of 16 free bytes."""
NINE = ", 1" * 9
CROWD = "frame,id,x,y\n" + "".join(f"0,{k},0,0\n" for k in range(20_000))


@pytest.mark.parametrize(
    ("kind", "call", "message"),
    [
        (ValueError, lambda _: parse_toml("#" * (limits.TEXT_FILE + 1)), "characters, more than"),
        (FormatError, lambda at: read_tracks_csv(text(at / "t.csv", "frame,id,x,y\n3e7,1,0,0")), "a frame up to 2"),
        (FormatError, lambda at: read_tracks_csv(text(at / "t.csv", CROWD)), "frame 0: found 20000 rows, expected"),
        (SourceError, lambda at: read_video_size(at), "no regular file, expected a video"),
        (SourceError, lambda at: read_video_size(text(at / "a.avi", "")), "no frame that decodes"),
        (SourceError, lambda at: read_video_size(text(at / "a.avi", "\ufeff#EXTM3U")), "a text, such as a playlist"),
        (SourceError, lambda at: read_video_size(text(at / "a.avi", "ffconcat version 1.0\nfile a.avi")), "playlist"),
        (OSError, lambda at: read_bytes(at), "Is a directory"),
        (OSError, lambda at: read_bytes(pipe(at / "a")), "what is no regular file"),
        (ValueError, lambda at: read_bytes(text(at / "a", "abc"), 2), "more than 2 bytes"),
        (ValueError, lambda at: require_sound_heaps(text(at / "a", HEAPS)), "a global heap at byte 32 inside of anoth"),
        (ValueError, lambda at: read_whole(unwritten(at / "a")), "80000 bytes declared, 0 stored"),
        (ConfigError, lambda _: read_config(None, ("detection.full_visibility=0",)), "above 0, at most 1"),
        (ConfigError, lambda _: read_config(None, ("body.height_mean=0.01",)), "more than two standard deviations"),
        (OSError, lambda _: FFmpegCapture("file:///etc/passwd", 1.0), "no address of a live stream"),
        (OSError, lambda _: FFmpegCapture("rtsp://127.0.0.1:9/x", 0.1), "no stream that FFmpeg opens"),
        (ValueError, lambda at: LiveTable(at / "l.csv", 5.0, 0).append(np.zeros(1, TRAJECTORY)), "that is not open"),
        (OutputError, lambda at: write_film(at / "a.avi", [], 5.0, False), "the ending '.avi'"),
        (OutputError, lambda at: write_film(at / os.fsdecode(b"\xff.mp4"), [], 5.0, False), "a path that is no UTF-8"),
        (OutputError, lambda at: write_film(at / "a.mp4", [np.zeros((0, 0, 3), np.uint8)], 5.0, False), "cannot be op"),
        (OSError, lambda at: clear_frames(link(at / "link", at)), "link is a link"),
        (OutputError, lambda at: begin_anew(at / "q.h5", f'["\\u001b"{NINE}]'), r"found \['\\x1b', .*, \.\.\.\], exp"),
        (OutputError, lambda at: begin_anew(at / "q.h5", f'{{"a": [1{NINE}]}}'), r"has \[1, .*, \.\.\.\], exp"),
        (ValueError, lambda at: require_sound_heaps(text(at / "a", HEAPS[:56])), "64 bytes, more than the file has"),
        (ValueError, lambda _: parse_npy(b"\x93NUMPY\1\0v\0"), "a .npy header that is cut off"),
    ],
)  # fmt: skip
def test_calls_are_refused(tmp_path: Path, kind: type[Exception], call: Callable[[Path], object], message: str) -> None:
    refused(kind, message, call, tmp_path)


def begin_anew(output: Path, notes: str) -> None:
    for _ in range(2):
        with WorkFolder(output, {}) as work:
            (work.path / "begun.json").write_text(notes)


def text(path: Path, content: str) -> Path:
    path.write_text(content)
    return path


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def unwritten(path: Path) -> h5py.Dataset:
    return h5py.File(path, "w").create_dataset("a", (80_000,), "u1")


def link(path: Path, target: Path) -> Path:
    path.symlink_to(target)
    return path


def test_large_pictures_headers_and_archives_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film(tmp_path / "a.avi", tmp_path / "plain.avi")
    (tmp_path / "a.y4m").write_bytes(b"YUV4MPEG2 W64 H48 F5:1 Ip A1:1 C420jpeg\nFRAME\n" + bytes(64 * 48 * 3 // 2))
    assert read_video_size(tmp_path / "a.avi") == read_video_size(tmp_path / "a.y4m") == (64, 48)
    assert sampled_checksum(Source("boxes", Path("/dev/null"))) == "nothing"
    monkeypatch.setattr(limits, "PIXELS", 1000)
    refused(SourceError, "found frames of 64x48, expected at most", read_video_size, tmp_path / "a.avi")
    np.savez(tmp_path / "a.npz", a=NOW, b=NOW)
    np.save(tmp_path / "a.npy", np.zeros((1,) * 9))
    refused(ValueError, r"a .npy header of shape \(1, 1", parse_npy, (tmp_path / "a.npy").read_bytes())
    monkeypatch.setattr(limits, "MEMBERS", 1)
    refused(ValueError, "2 members, more than 1", read_npz, tmp_path / "a.npz")
    with zipfile.ZipFile(tmp_path / "b.npz", "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a.npy", b"0")
    refused(ValueError, "packed in another way", read_npz, tmp_path / "b.npz")


@pytest.mark.parametrize("notes", [[], {"a": 5}, {"a": [[1]]}, *({"a": [[*k]]} for k in ("ab", ("a/b", 1), ("a", -1)))])
def test_notes_of_arrived_files_of_another_form_are_none(tmp_path: Path, notes: object) -> None:
    (tmp_path / "notes.json").write_text(json.dumps(notes))
    assert FileNotes(tmp_path / "notes.json").read == {}


def test_what_appears_meanwhile_is_kept_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part, path = text(tmp_path / "part", "new"), text(tmp_path / "path", "old")
    monkeypatch.setattr(os, "link", Mock(side_effect=OSError(errno.EPERM, "no links")))
    refused(FileExistsError, "appeared meanwhile", publish_part, part, path, False)
    assert path.read_text() == "old"


@pytest.mark.parametrize(("opened", "message"), [(False, "a video that cannot be opened"), (True, "an empty file")])
def test_a_film_of_a_scene_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, opened: bool, message: str
) -> None:
    monkeypatch.setattr(cv2, "VideoWriter", Mock(fourcc=cv2.VideoWriter.fourcc))
    cv2.VideoWriter.return_value.isOpened.return_value = opened  # type: ignore[attr-defined]
    camera = Mock(size=(64, 48))
    refused(OutputError, message, lambda: simulated_scene._Video(tmp_path / "a.avi", camera, 5.0, None).close())


def test_archives_have_no_escape_codes_and_tables_that_fit(run_path: Path) -> None:
    (path := run_path.with_name("q")).touch()
    run = read_run(run_path.rename(run_path.with_name("\x1b[31m.h5")))
    ARCHIVES["sqlite"](path, [run])
    assert b"\x1b[" not in path.read_bytes() and rb"\x1b[31m.h5" in path.read_bytes()
    run.tracks["first"] = 0
    refused(FormatError, "/tracks: found other frames", ARCHIVES["sqlite"], path, [run])
