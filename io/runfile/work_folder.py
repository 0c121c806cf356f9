"""State of an unfinished run for resuming: the folder `RUN.h5.segments` beside its output.

    begun.json                  the request: the same command resumes from here, any other is refused
    streams.npz                 the stream index, made once
    files.json, clock.json      of a followed recording: files that were read, and the time of frame 0
    segment-00003-CHECKSUM.h5   the run file of one segment
    lock                        held by the run that writes here

Files are written atomically. A segment's name contains its checksum; a segment that has changed is made again.
"""

from __future__ import annotations

import json
import re
import shutil
from contextlib import suppress
from dataclasses import dataclass
from hashlib import blake2b, file_digest
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self
from zipfile import BadZipFile

import numpy as np

from stseg.errors import OutputError
from stseg.io.outputs.whole_files import output_error, replacing, sync_folder
from stseg.io.recording.stream_index import StreamIndex
from stseg.io.runfile.locks import lock

_SEGMENT = re.compile(r"segment-(\d{5})-([0-9a-f]{32})\.h5")


@dataclass(frozen=True)
class Difference:
    """A difference between two requests.

    Attributes
    ----------
    key
        The differing key.
    now, begun
        Its value in the present request and in that of the unfinished run.
    """

    key: str
    now: str
    begun: str


class WorkFolder:
    """The folder of one output.

    Parameters
    ----------
    output
        The future run file.
    request
        Everything that determines the result, in nested tables; equal to that of the unfinished run.

    Raises
    ------
    OutputError
        Where a different run is unfinished or running here, or the folder cannot be written.
    """

    def __init__(self, output: Path, request: dict[str, Any]) -> None:
        self.output, self.path = output, output.with_name(f"{output.name}.segments")
        self._request = request
        self._lock: BinaryIO | None = None
        self.broken: list[Path] = []
        """Deleted segments, whose bytes had changed."""

    def __enter__(self) -> Self:
        try:
            self.path.mkdir(exist_ok=True)
            self._lock = (self.path / "lock").open("ab")
            lock(self._lock)
        except OSError as error:
            self.close()
            raise output_error(self.output, error) from error
        try:
            self._begin()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; an empty folder is removed."""
        if self._lock is None:
            return
        if not self.begun:
            with suppress(OSError):
                (self.path / "lock").unlink()
                self.path.rmdir()
        self._lock.close()
        self._lock = None

    @property
    def begun(self) -> bool:
        """Whether the folder holds an unfinished run."""
        return (self.path / "begun.json").exists()

    def segments(self) -> dict[int, Path]:
        """The finished segments by number; files whose bytes have changed are deleted and listed in `broken`."""
        found = {}
        for path in sorted(self.path.iterdir()):
            name = _SEGMENT.fullmatch(path.name)
            if name is None:
                continue
            if checksum(path) == name[2]:
                found[int(name[1])] = path
            else:
                self.broken.append(path)
                path.unlink()
        return found

    def draft(self, index: int) -> Path:
        """Path at which a segment is written, before `keep_segment`."""
        return self.path / f"segment-{index:05}.h5"

    def streams(self) -> StreamIndex | None:
        """The stored stream index; None where there is none or it cannot be read."""
        try:
            with np.load(self.path / "streams.npz") as kept:
                files = [range(int(count)) for count in kept["files"]]
                times = tuple(tuple(kept[f"times{k}_{j}"] for j in own) for k, own in enumerate(files))
                placed = set(kept["placed"].tolist())
                shown = tuple(kept[f"shown{k}"] if k in placed else None for k in range(len(files)))
                return StreamIndex(int(kept["length"]), times, shown, tuple(kept["notes"].tolist()))
        except (OSError, KeyError, ValueError, BadZipFile):
            return None

    def keep_streams(self, streams: StreamIndex) -> None:
        """Store the stream index."""
        with replacing(self.path / "streams.npz", overwrite=True) as part, part.open("wb") as file:
            times = {f"times{k}_{j}": own for k, files in enumerate(streams.times) for j, own in enumerate(files)}
            shown = {k: own for k, own in enumerate(streams.shown) if own is not None}
            np.savez_compressed(
                file,
                length=np.array(streams.length),
                files=np.array([len(own) for own in streams.times]),
                placed=np.array(list(shown), np.int64),
                notes=np.array(streams.notes, str),
                **times,  # type: ignore[arg-type]
                **{f"shown{k}": own for k, own in shown.items()},  # type: ignore[arg-type]
            )

    def clock(self) -> float | None:
        """Stored time of frame 0 of a live recording, seconds since 1970, or None."""
        try:
            return float(json.loads((self.path / "clock.json").read_text("utf-8")))
        except (OSError, ValueError):
            return None

    def keep_clock(self, start: float) -> None:
        """Store the time of frame 0."""
        with replacing(self.path / "clock.json", overwrite=True) as part:
            part.write_text(json.dumps(start), "utf-8")

    def remove(self) -> None:
        """Delete the folder, once the output exists."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _begin(self) -> None:
        path = self.path / "begun.json"
        try:
            before = json.loads(path.read_text("utf-8"))
        except FileNotFoundError:
            with replacing(path, overwrite=True) as part:
                part.write_text(json.dumps(self._request, indent=1), "utf-8")
            return
        except (OSError, ValueError) as error:
            raise OutputError(
                path, "", f"something that cannot be read ({error})", self._anew("the run's notes")
            ) from error
        for difference in differences(self._request, before):
            found = f"{difference.now}, where the unfinished run of {self.path.name} has {difference.begun}"
            raise OutputError(self.output, difference.key, found, self._anew("the same, to go on"))

    def _anew(self, expected: str) -> str:
        return f"{expected}; or delete the folder {self.path.name} to begin anew"


def checksum(path: Path) -> str:
    """Checksum of a file, 32 hexadecimal digits."""
    with path.open("rb") as file:
        return file_digest(file, lambda: blake2b(digest_size=16)).hexdigest()


def keep_segment(draft: Path) -> Path:
    """Rename a complete, synced segment to the name that contains its checksum."""
    kept = draft.with_name(f"{draft.stem}-{checksum(draft)}.h5")
    draft.replace(kept)
    sync_folder(kept.parent)
    return kept


def differences(now: dict[str, Any], begun: dict[str, Any], prefix: str = "") -> list[Difference]:
    """All differences of two nested tables."""
    found = []
    for key in (*now, *(key for key in begun if key not in now)):
        a, b, name = now.get(key, "nothing"), begun.get(key, "nothing"), f"{prefix}{key}"
        if isinstance(a, dict) and isinstance(b, dict):
            found += differences(a, b, f"{name}.")
        elif a != b:
            found.append(Difference(name, str(a), str(b)))
    return found
