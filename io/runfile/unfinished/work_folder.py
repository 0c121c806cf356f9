"""State of an unfinished run for resuming: the folder `RUN.h5.segments` beside its output.

    stseg-work-folder           the mark: without it the folder is not ours, and left alone
    begun.json                  the request: the same command resumes from here, any other is refused
    streams.npz                 time stamps of all streams, read once
    files.json, clock.json      of a followed recording: files that were read, and the time of frame 0
    segment-00003-CHECKSUM.h5   the run file of one segment
    result.h5                   the finished run file, which the output is a second name of
    lock                        held by the run that writes here

Files are written atomically. A segment's name contains its checksum; a segment that has changed is made again. All of
it is read as untrusted: whatever cannot be read is made again, or refused in one line.
"""

import json
import math
import os
import re
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self

from stseg.errors import OutputError
from stseg.io.outputs.whole_files import (
    Inputs,
    create_part,
    output_error,
    publish_part,
    require_output,
    sync_folder,
    write_file,
)
from stseg.io.recording.aligned_stream import StreamIndex
from stseg.io.recording.recording import Recording
from stseg.io.runfile.unfinished.part_file import locked_file
from stseg.io.runfile.unfinished.work_files import (
    FinishedSegments,
    finished_segments,
    read_stream_times,
    write_stream_times,
)
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import is_regular, parse_json, read_text
from stseg.io.untrusted.values import abbreviated

_MARK = "stseg-work-folder"
_STREAMS = "streams.npz"
_ABOUT = "Made by stseg: it may delete the files in this folder that it made.\n"
_FILE_NAME = re.compile(
    r"(begun\.json|streams\.npz|files\.json|clock\.json|result\.h5|segment-\d{5}(-[0-9a-f]{32})?\.h5)"
    r"(\.[0-9a-f]{16}\.part)?"
)
"""Names of files in the folder that are ours."""
_PUBLISHED_FILES = frozenset((_MARK, "lock", "begun.json", "result.h5"))
"""Files by which a published run is known, until the folder is gone."""


class WorkFolder:
    """The folder of one output, the future run file.

    The request is everything that determines the result, in nested tables; equal to that of the unfinished run.
    OutputError where the folder is not ours, a different run is unfinished or running here, or it cannot be written.
    """

    def __init__(self, output: Path, request: dict[str, Any]) -> None:
        self.output, self.path = output, output.parent / f"{output.name}.segments"
        self._request = request
        self._lock: BinaryIO | None = None
        self.broken: list[Path] = []
        """Deleted segments, whose bytes had changed."""

    def __enter__(self) -> Self:
        try:
            self._make()
            self._lock = locked_file(self.path / "lock")
        except OSError as error:
            raise output_error(self.output, error) from error
        try:
            self._begin()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; a folder without a run in it is removed."""
        if self._lock is None:
            return
        if not self.begun:
            self._remove_own()
        self._lock.close()
        self._lock = None

    @property
    def begun(self) -> bool:
        """Whether the folder is ours and holds an unfinished run."""
        return self._is_own() and is_regular(self.path / "begun.json")

    @property
    def result(self) -> Path:
        """Path at which the finished run file is written, before `publish`."""
        return self.path / "result.h5"

    @property
    def published(self) -> bool:
        """Whether the output already is the finished run file: a kill came before the folder was removed."""
        try:
            return self.begun and is_regular(self.output) and self.output.samefile(self.result)
        except OSError:
            return False

    def require_output(self, overwrite: bool, inputs: Inputs) -> None:
        """Refuse an output that may not be replaced, unless it is the finished run file of this folder."""
        self._finish_removals()
        if not self.published:
            require_output(self.output, overwrite, inputs)

    def publish(self, overwrite: bool) -> None:
        """Give the finished run file its name; the folder keeps it too, until it is removed.

        OutputError where the output has appeared meanwhile, or cannot be written; the result stays in the folder.
        """
        try:
            try:
                if overwrite:
                    part, descriptor = create_part(self.output)
                    os.close(descriptor)
                    part.unlink()
                    os.link(self.result, part)
                    publish_part(part, self.output, overwrite)
                else:
                    os.link(self.result, self.output)
                    sync_folder(self.output.parent)
            except FileExistsError:
                raise
            except OSError:  # a file system without links
                publish_part(self.result, self.output, overwrite)
        except OSError as error:
            cause = output_error(self.output, error)
            kept = f"{cause.expected}; the whole result is kept in {self.result}"
            raise OutputError(cause.place, "", cause.found, kept) from error

    def whole_segments(self) -> dict[int, Path]:
        """The finished segments by number; files whose bytes have changed are deleted and listed in `broken`."""
        found = finished_segments(self.path) if self._is_own() else FinishedSegments({}, [])
        self.broken += found.broken
        for path in found.broken:
            path.unlink()
        return found.whole

    def draft(self, index: int) -> Path:
        """Path at which a segment is written, before `keep_segment`."""
        return self.path / f"segment-{index:05}.h5"

    def streams(self, recording: Recording) -> StreamIndex | None:
        """The stream index of the stored time stamps; None where there are none, or not of this recording."""
        return read_stream_times(self.path / _STREAMS, recording)

    def keep_streams(self, streams: StreamIndex) -> None:
        """Store the time stamps of all streams."""
        write_stream_times(self.path / _STREAMS, streams)

    def clock(self) -> float | None:
        """Stored time of frame 0 of a live recording, seconds since 1970, or None."""
        try:
            start = parse_json(read_text(self.path / "clock.json", limits.LINE))
        except (OSError, ValueError):
            return None
        return start if isinstance(start, float) and math.isfinite(start) else None

    def keep_clock(self, start: float) -> None:
        """Store the time of frame 0."""
        write_file(self.path / "clock.json", json.dumps(start).encode())

    def remove(self) -> None:
        """Delete the folder, once the output exists; files in it that are not ours stay."""
        self._remove_own()
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _make(self) -> None:
        """The folder with our mark; an empty one is adopted, any other without the mark refused."""
        with suppress(FileExistsError):
            self.path.mkdir()
        if self.path.is_symlink() or not self.path.is_dir():
            raise OutputError(self.path, "", "what is no folder", "none, or that of an unfinished run")
        if self._is_own():
            return
        if any(self.path.iterdir()):
            expected = "none, or that of an unfinished run; move it, or give another output"
            raise OutputError(self.path, "", "a folder that stseg did not make", expected)
        descriptor = os.open(self.path / _MARK, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        with os.fdopen(descriptor, "w") as file:
            file.write(_ABOUT)

    def _is_own(self) -> bool:
        return not self.path.is_symlink() and is_regular(self.path / _MARK)

    def _remove_own(self) -> None:
        """Delete what we made; the mark stays beside files that are not ours.

        Until the folder is renamed, by which it is gone, `published` holds: a run that is killed on the way is finished
        by the same command.
        """
        if not self._is_own():
            return
        with suppress(OSError):
            for path in self.path.iterdir():
                if _FILE_NAME.fullmatch(path.name) and path.name not in _PUBLISHED_FILES and is_regular(path):
                    path.unlink()
            if {path.name for path in self.path.iterdir()} <= _PUBLISHED_FILES:
                _delete(self.path.rename(self.path.with_name(f"{self.path.name}.{secrets.token_hex(8)}.removed")))
            else:
                for name in ("result.h5", "begun.json"):
                    (self.path / name).unlink(missing_ok=True)

    def _finish_removals(self) -> None:
        """Delete the folders of runs of this output that were killed while they deleted them."""
        name = re.compile(rf"{re.escape(self.path.name)}\.[0-9a-f]{{16}}\.removed")
        with suppress(OSError):
            for path in self.path.parent.iterdir():
                if name.fullmatch(path.name) and not path.is_symlink() and _is_deletable(path):
                    _delete(path)

    def _begin(self) -> None:
        path = self.path / "begun.json"
        try:
            before = parse_json(read_text(path))
        except FileNotFoundError:
            write_file(path, json.dumps(self._request, indent=1).encode())
            return
        except (OSError, ValueError) as error:
            raise OutputError(path, "", f"what cannot be read ({error})", self._anew("the run's notes")) from error
        if not isinstance(before, dict):
            raise OutputError(path, "", f"{abbreviated(before)}", self._anew("the run's notes"))
        for difference in differences(self._request, before):
            found = f"{difference.now}, where the unfinished run of {self.path.name} has {difference.begun}"
            raise OutputError(self.output, difference.key, found, self._anew("the same, to go on"))

    def _anew(self, expected: str) -> str:
        return f"{expected}; or delete the folder {self.path.name} to begin anew"


def _delete(folder: Path) -> None:
    """Delete a folder that was renamed to be deleted; the mark goes last."""
    for name in sorted(_PUBLISHED_FILES - {_MARK}):
        (folder / name).unlink(missing_ok=True)
    (folder / _MARK).unlink(missing_ok=True)
    folder.rmdir()


def _is_deletable(folder: Path) -> bool:
    """Whether a folder holds our mark and else only what a published run leaves; or nothing, where a kill came last."""
    names = {path.name for path in folder.iterdir()}
    return names <= _PUBLISHED_FILES and (not names or is_regular(folder / _MARK))


class Difference(NamedTuple):
    """A key that differs, with its values in the present request and in that of the unfinished run."""

    key: str
    now: str
    begun: str


def differences(now: dict[str, Any], begun: dict[str, Any], prefix: str = "") -> list[Difference]:
    """All differences of two nested tables; lists are tables of their places."""
    found = []
    for key in now | begun:
        a, b, name = now.get(key, "nothing"), begun.get(key, "nothing"), f"{prefix}{key}"
        if isinstance(a, list) and isinstance(b, list):
            a, b = ({str(place): value for place, value in enumerate(one)} for one in (a, b))
        if isinstance(a, dict) and isinstance(b, dict):
            found += differences(a, b, f"{name}.")
        elif a != b:
            words = (one[: limits.NAME] if isinstance(one, str) else abbreviated(one) for one in (a, b))
            found.append(Difference(name, *words))
    return found
