"""Results of one camera, frame by frame, kept as they are made: a kill costs the last seconds alone.

CAMERA.csv              the boxes, once they are whole; CAMERA.features.npy their features
CAMERA.csv.unfinished   until then
CAMERA.json             the request (detector, video, classes, score), the frames done, and the bytes of their results

Results of another request are never taken for those wanted.
"""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Self

from stseg.errors import OutputError
from stseg.io.outputs.whole_files import MARK, output_errors, sync_folder, write_file
from stseg.io.runfile.unfinished.part_file import locked_file
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import is_regular, parse_json, read_text
from stseg.io.untrusted.values import abbreviated


@dataclass(frozen=True)
class State:
    """Contents of the notes."""

    request: Mapping[str, str]
    frames: int = 0
    """Frames done."""
    size: int = 0
    """Bytes of their results, and of the header before them."""
    whole: bool = False
    by_stamps: bool = False
    """Whether the time stamps of the video place its frames in time."""
    made: str = MARK.decode()

    def __post_init__(self) -> None:
        """Refuse what no state can be; raises ValueError."""
        numbers = self.frames, self.size
        if not isinstance(self.request, dict) or any(type(one) is not int or one < 0 for one in numbers):
            raise ValueError("no state")


class KeptFile:
    """A file of one camera's results.

    OutputError where files there are not ours, or of another request and not to be overwritten.

    Parameters
    ----------
    path
        The whole file.
    request
        Everything that determines the results.
    overwrite
        Whether results of another request may be replaced.
    """

    def __init__(self, path: Path, request: Mapping[str, str], overwrite: bool) -> None:
        self.path = path
        self._unfinished, self._notes = path.with_name(f"{path.name}.unfinished"), path.with_suffix(".json")
        found = self._found()
        if found is None:
            for path in (self.path, self._unfinished, self._notes):
                if os.path.lexists(path):
                    raise OutputError(path, "", "a file that stseg did not make", "another folder")
        elif (other := _difference(request, found.request)) and not overwrite:
            key, now, before = other
            found_text = f"{abbreviated(now)}, where those there have {abbreviated(before)}"
            raise OutputError(self.path, key, found_text, "the same, another folder, or --overwrite")
        elif not other:
            if _size(self.path) == found.size and not self._unfinished.exists():  # killed after the last step but one
                found = replace(found, whole=True)
            if _size(self.path if found.whole else self._unfinished) >= found.size:
                self.state = found
                return
        self.state = State(dict(request))

    def _found(self) -> State | None:
        """The state on the disk; None where there is none."""
        if not is_regular(self._notes):
            return None
        try:
            state = State(**dict(parse_json(read_text(self._notes, limits.TEXT_FILE))))  # type: ignore[call-overload]
        except (OSError, ValueError, TypeError):
            return None
        return state if state.made == MARK.decode() else None

    def begin(self, header: bytes, by_stamps: bool) -> Self:
        """Make the file as long as the state says, and hold it; a new one begins with the header."""
        with output_errors(self.path):
            self._file = locked_file(self._unfinished)
            if not self.state.frames:
                self._file.truncate(0)
                self._file.write(header)
                self.path.unlink(missing_ok=True)
                self.state = replace(self.state, size=len(header))
            self._file.truncate(self.state.size)
            self._file.seek(self.state.size)
            self._keep(replace(self.state, by_stamps=by_stamps))
        return self

    def append(self, data: bytes, frames: int) -> None:
        """Keep the results of further frames; raises OutputError."""
        with output_errors(self.path):
            self._file.write(data)
            size = self._file.tell()
            self._keep(replace(self.state, frames=self.state.frames + frames, size=size))

    def finish(self) -> None:
        """Give the whole file its name; raises OutputError."""
        with output_errors(self.path):
            self._unfinished.replace(self.path)
            sync_folder(self.path.parent)
            self._keep(replace(self.state, whole=True))

    def close(self) -> None:
        """Release the file."""
        with suppress(AttributeError):
            self._file.close()

    def _keep(self, state: State) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())
        write_file(self._notes, json.dumps(asdict(state), indent=1).encode())
        self.state = state


def _difference(now: Mapping[str, str], before: Mapping[str, object]) -> tuple[str, str, object] | None:
    """The first key that differs, and its values."""
    return next(((key, now[key], before.get(key)) for key in now if now[key] != before.get(key)), None)


def _size(path: Path) -> int:
    return path.stat().st_size if is_regular(path) else 0
