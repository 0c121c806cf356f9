"""One camera's frames from videos that a recorder writes into a folder one after the other."""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Event, Lock

from stseg.arrays import Floats, Observation
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.live.live_stream import now
from stseg.io.outputs.whole_files import write_file
from stseg.io.recording.recording import Source
from stseg.io.recording.source_files import files_of_pattern, numeric_order
from stseg.io.recording.video.video_stream import VideoStream
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_json, read_text
from stseg.io.untrusted.values import is_file_name

_POLL = 0.1
"""Interval at which a folder is listed, seconds."""


class FileNotes:
    """The files of each camera that were read to their ends, with their numbers of frames; kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, Lock()
        self.read: dict[str, list[tuple[str, int]]] = {}
        with suppress(OSError, ValueError):
            self.read = _checked_notes(parse_json(read_text(path)))

    def note(self, camera: str, name: str, frames: int) -> None:
        """Record a file that was read to its end."""
        with self._lock:
            self.read.setdefault(camera, []).append((name, frames))
            write_file(self._path, json.dumps(self.read, indent=1).encode())


def _checked_notes(notes: object) -> dict[str, list[tuple[str, int]]]:
    """Files and their numbers of frames by camera; ValueError where the notes are of another form."""
    if not isinstance(notes, dict):
        raise ValueError("no notes")
    checked = {}
    for camera, files in notes.items():
        if not isinstance(files, list) or not all(isinstance(entry, list) and len(entry) == 2 for entry in files):
            raise ValueError("no list of files")
        if not all(
            is_file_name(name) and type(frames) is int and 0 <= frames <= limits.FRAMES for name, frames in files
        ):
            raise ValueError("no file and number of frames")
        checked[str(camera)] = [(name, frames) for name, frames in files]
    return checked


class ArrivingFiles:
    """The files of a pattern such as `cam1_*.mp4` in the order of their names, numbers by value, once complete.

    A file is complete when a later one exists, or when it has not grown for `settled` seconds. `halt` ends all
    waiting; `report` receives a line for each file that came too late to be read.
    """

    def __init__(self, pattern: Path, settled: float, halt: Event, report: Callable[[str], None]) -> None:
        self._pattern, self._settled, self._halt, self._report = pattern, settled, halt, report
        self._taken: set[str] = set()
        self._last: Path | None = None
        self._pending: list[Path] = []
        self._size, self._since = -1, 0.0

    def pass_over(self, name: str) -> None:
        """Mark a file as read, whether it still exists or not."""
        self._last = self._pattern.with_name(name)
        self._taken.add(name)

    def next(self) -> Path | None:
        """Wait for the next complete file; None once `halt` is set."""
        while not self._halt.is_set():
            if len(self._pending) < 2:
                self._list_folder()
            if len(self._pending) > 1 or (self._pending and self._is_settled(self._pending[0])):
                path = self._pending.pop(0)
                self.pass_over(path.name)
                return path
            self._halt.wait(_POLL)
        return None

    def _list_folder(self) -> None:
        found = [path for path in files_of_pattern(self._pattern) if path.name not in self._taken]
        last = None if self._last is None else numeric_order(self._last)
        self._pending = sorted(
            (path for path in found if last is None or numeric_order(path) > last), key=numeric_order
        )
        for path in found:
            if path not in self._pending:
                self._taken.add(path.name)
                self._report(f"{path}: it arrived after later files had been read, and is left out")

    def _is_settled(self, path: Path) -> bool:
        try:
            size = path.stat().st_size
        except OSError:
            size = -1
        if size != self._size:
            self._size, self._since = size, time.monotonic()
        return size > 0 and time.monotonic() - self._since >= self._settled


class ArrivingVideos:
    """One camera's frames from arriving files of a pattern of colour or mask videos; reading waits for them.

    Files of `notes` were read before: they are skipped unopened. Colour frames are reduced by a whole factor.
    """

    def __init__(self, source: Source, camera: Camera, files: ArrivingFiles, notes: FileNotes, factor: int = 1) -> None:
        self._source, self._camera, self._files, self._notes, self._factor = source, camera, files, notes, factor
        self._known = list(notes.read.get(camera.name, []))
        self._stream: VideoStream | None = None
        self._path, self._read, self._size = Path(), 0, 0
        self.arrived = 0.0
        """When the file of the last frame became complete, by `stseg.io.live.live_stream.now`."""

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""
        skipped = 0
        while self._stream is None and self._known and skipped + self._known[0][1] <= count:
            name, frames = self._known.pop(0)
            self._files.pass_over(name)
            skipped += frames
        while skipped < count and self._open():
            more = self._stream.skip(count - skipped) if self._stream is not None else 0
            skipped, self._read = skipped + more, self._read + more
            if skipped < count:
                self._end()
        return skipped

    def read(self) -> Observation:
        """Wait for the next frame; None once waiting has ended."""
        while self._open() and self._stream is not None:
            view = self._stream.read()
            if view is not None:
                self._read += 1
                return view
            self._end()
        return None

    def times(self) -> list[Floats]:
        """Time stamps of files that have not arrived are unknown: there are none."""
        return []

    def close(self) -> None:
        """Close what is open."""
        if self._stream is not None:
            self._stream.close()

    def _open(self) -> bool:
        """Open the next file unless one is open; return whether one is."""
        if self._stream is None:
            path = self._files.next()
            if path is None:
                return False
            if self._known and path.name != self._known[0][0]:
                found, expected = f"{path.name} next", f"{self._known[0][0]}, from which the run is to go on"
                raise SourceError(self._source.path, f"camera {self._camera.name}", found, expected)
            self._require_unchanged()
            self._size = path.stat().st_size
            self._stream = VideoStream(replace(self._source, path=path), self._camera, factor=self._factor)
            self._path, self._read, self.arrived = path, 0, now()
        return True

    def _require_unchanged(self) -> None:
        """Raise SourceError where the previous file has grown since: some of its frames were missed."""
        try:
            size = self._path.stat().st_size if self._path.name else 0
        except OSError:  # it may have been deleted since
            size = self._size
        if size != self._size:
            found = f"{size} bytes, of which only the first {self._size} were there when it was read"
            expected = "live.file_quiet_time above the pauses of the recorder"
            raise SourceError(self._path, f"camera {self._camera.name}", found, expected)

    def _end(self) -> None:
        self.close()
        self._stream = None
        if self._known and self._known[0][0] == self._path.name:
            self._known.pop(0)
        else:
            self._notes.note(self._camera.name, self._path.name, self._read)
