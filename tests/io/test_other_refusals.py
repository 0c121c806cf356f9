"""What is refused of names, videos, live streams, notes and outputs: what was found, in one line."""

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import cv2
import h5py
import numpy as np
import pytest
from attacks import film
from refusals import refused

from stseg.errors import ConfigError, FormatError, OutputError, SourceError
from stseg.io.config_file import read_config
from stseg.io.exports.archive import ARCHIVES
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.live_stream import FFmpegCapture
from stseg.io.live.live_tables import LiveTable
from stseg.io.outputs import simulated_scene
from stseg.io.outputs.video_writer import write_film
from stseg.io.outputs.whole_files import clear_frames, publish_part
from stseg.io.recording.video.ffmpeg import read_video_size
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.io.toml import parse_toml
from stseg.io.track_csv import read_tracks_csv
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes
from stseg.io.untrusted.safe_hdf5 import read_whole, require_sound_heaps
from stseg.io.untrusted.values import is_file_name, is_name, is_title
from stseg.records.tables import TRAJECTORY


@pytest.mark.parametrize(
    ("question", "wrong"),
    [
        (is_name, [5, "€" * 90, "x" * 101, " a", "..", "a/b", "\x1b"]),
        (is_title, [5, "", "x" * 101, " a", "\x1b"]),
        (is_file_name, [5, "", ".", "..", "a/b", "a\0b", "x" * 256, "x" * 5000]),
    ],
)
def test_names_of_three_kinds(question: Callable[[object], bool], wrong: list[object]) -> None:
    assert not any(map(question, wrong)) and question("a b")


_BEGIN, _SEVEN = "GCOL\1\0\0\0", "\0" * 7
HEAPS = f"{_BEGIN}\x40{_SEVEN}\1{_SEVEN}\x10{_SEVEN}{_BEGIN}{_SEVEN}\0{_SEVEN}\0\x10{_SEVEN}"
"""A heap of an object, in which another one begins, and of 16 free bytes."""


@pytest.mark.parametrize(
    ("kind", "call", "message"),
    [
        (ValueError, lambda _: parse_toml("#" * (limits.TEXT_FILE + 1)), "characters, more than"),
        (FormatError, lambda at: read_tracks_csv(text(at / "t.csv", "frame,id,x,y\n3e7,1,0,0")), "a frame up to 2"),
        (SourceError, lambda at: read_video_size(at), "no regular file, expected a video"),
        (SourceError, lambda at: read_video_size(text(at / "a.avi", "")), "no frame that decodes"),
        (SourceError, lambda at: read_video_size(text(at / "a.avi", "\ufeff#EXTM3U")), "a text, such as a playlist"),
        (OSError, lambda at: read_bytes(at), "Is a directory"),
        (ValueError, lambda at: read_bytes(pipe(at / "a")), "what is no regular file"),
        (ValueError, lambda at: read_bytes(text(at / "a", "abc"), 2), "more than 2 bytes"),
        (ValueError, lambda at: require_sound_heaps(text(at / "a", HEAPS)), "a global heap at byte 32 inside of anoth"),
        (ValueError, lambda at: read_whole(unwritten(at / "a")), "80000 bytes declared, 0 stored"),
        (ConfigError, lambda _: read_config(None, ("detection.hidden_visibility=1",)), "0 to below full_visibility"),
        (ConfigError, lambda _: read_config(None, ("body.height_mean=0.01",)), "more than two standard deviations"),
        (OSError, lambda _: FFmpegCapture("file:///etc/passwd", 1.0), "no address of a live stream"),
        (OSError, lambda _: FFmpegCapture("rtsp://127.0.0.1:9/x", 0.1), "no stream that FFmpeg opens"),
        (ValueError, lambda at: LiveTable(at / "l.csv", 5.0, 0).append(np.zeros(1, TRAJECTORY)), "that is not open"),
        (OutputError, lambda at: write_film(at / "a.avi", [], 5.0, False), "the ending '.avi'"),
        (OutputError, lambda at: write_film(at / os.fsdecode(b"\xff.mp4"), [], 5.0, False), "a path that is no UTF-8"),
        (OutputError, lambda at: write_film(at / "a.mp4", [np.zeros((0, 0, 3), np.uint8)], 5.0, False), "cannot be op"),
        (OSError, lambda at: clear_frames(link(at / "link", at)), "link is a link"),
        (OutputError, lambda at: begin_anew(at / "q.h5", '["\\u001b"]'), r"found \['\\x1b'\], expected the run"),
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


def test_large_pictures_and_headers_of_videos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film(tmp_path / "a.avi", tmp_path / "plain.avi")
    (tmp_path / "a.y4m").write_bytes(b"YUV4MPEG2 W64 H48 F5:1 Ip A1:1 C420jpeg\nFRAME\n" + bytes(64 * 48 * 3 // 2))
    assert read_video_size(tmp_path / "a.avi") == read_video_size(tmp_path / "a.y4m") == (64, 48)
    monkeypatch.setattr(limits, "PIXELS", 1000)
    refused(SourceError, "found frames of 64x48, expected at most", read_video_size, tmp_path / "a.avi")


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


def test_names_are_archived_without_escape_codes(run_path: Path) -> None:
    (path := run_path.with_name("q")).touch()
    ARCHIVES["sqlite"](path, [read_run(run_path.rename(run_path.with_name("\x1b[31m.h5")))])
    assert b"\x1b[" not in path.read_bytes() and rb"\x1b[31m.h5" in path.read_bytes()


def test_tables_that_do_not_fit_are_not_archived(run_path: Path) -> None:
    run = read_run(run_path)
    run.tracks["first"] = 0
    refused(FormatError, "/tracks: found other frames", ARCHIVES["sqlite"], run_path.with_name("q"), [run])
