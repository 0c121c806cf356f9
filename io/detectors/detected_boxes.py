"""Boxes of one camera as a detector finds them, kept as they are made: a kill costs the last seconds alone.

CAMERA.csv              the boxes, once they are whole
CAMERA.csv.unfinished   until then
CAMERA.json             the request (detector, video, classes, score), the frames done, and the bytes of their boxes

Boxes of another request are never taken for those wanted.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import Protocol, Self

import numpy as np

from stseg.arrays import Boxes, Bytes
from stseg.errors import ConfigError, OutputError
from stseg.geometry import Camera
from stseg.io.detectors.hog import HogDetector
from stseg.io.detectors.networks import runtime
from stseg.io.detectors.people_detector import PERSON, OnnxDetector
from stseg.io.outputs.whole_files import MARK, output_errors, sync_folder, write_file
from stseg.io.recording.recording import HOG, Source
from stseg.io.recording.streams import Stream, open_stream
from stseg.io.runfile.provenance import sampled_checksum
from stseg.io.runfile.unfinished.part_file import lock
from stseg.io.runfile.unfinished.work_files import checksum
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import is_regular, parse_json, read_text
from stseg.io.untrusted.values import abbreviated

HEADER = "frame,left,top,width,height,score\n"
_KEPT_EVERY = 5.0
"""Time after which boxes are written to the disk, seconds."""
_PICTURES = 8
"""Pictures that are decoded before they are searched."""


class BoxDetector(Protocol):
    """Finds people in colour pictures."""

    def detect(self, picture: Bytes) -> Boxes:
        """Boxes in a picture, uint8 (v, u, 3) in the order blue, green, red."""


def make_detector(source: Source) -> BoxDetector:
    """The detector that a source names; raises InputError where it is none, or has none of the classes."""
    assert source.detector is not None
    least = source.least_score or None
    if source.detector != HOG:
        return OnnxDetector(source.detector, source.classes or (PERSON,), least)
    if set(source.classes) - {PERSON}:
        raise ConfigError(str(HOG), "classes", ", ".join(source.classes), f"{PERSON}, which it finds alone")
    return HogDetector(least)


def request_of(source: Source) -> dict[str, str]:
    """Everything that determines a source's boxes; raises OSError where the model cannot be read."""
    assert source.detector is not None
    by_network = source.detector != HOG
    return {
        "detector": f"{source.detector.name} {checksum(source.detector)}" if by_network else str(HOG),
        "library": runtime() if by_network else HogDetector.runtime,
        "classes": ", ".join(source.classes),
        "score": repr(source.least_score),
        "video": f"{source.path.name} {sampled_checksum(source.without_detector())}",
    }


@dataclass(frozen=True)
class State:
    """Contents of CAMERA.json."""

    request: Mapping[str, str]
    frames: int = 0
    """Frames done."""
    size: int = len(HEADER)
    """Bytes of their boxes."""
    whole: bool = False
    by_stamps: bool = False
    """Whether the time stamps of the video place its frames in time."""
    made: str = MARK.decode()

    def __post_init__(self) -> None:
        """Refuse what no state can be; raises ValueError."""
        numbers = self.frames, self.size
        if not isinstance(self.request, dict) or any(type(one) is not int or one < 0 for one in numbers):
            raise ValueError("no state")


class DetectedBoxes:
    """The boxes of one camera in a folder.

    OutputError where files there are not ours, or of another request and not to be overwritten.

    Parameters
    ----------
    folder, camera
        The folder, and the camera's name.
    request
        Of `request_of`.
    overwrite
        Whether boxes of another request may be replaced.
    """

    def __init__(self, folder: Path, camera: str, request: Mapping[str, str], overwrite: bool) -> None:
        self.path = folder / f"{camera}.csv"
        self._unfinished, self._notes = folder / f"{camera}.csv.unfinished", folder / f"{camera}.json"
        found = self._found()
        if found is None:
            for path in (self.path, self._unfinished, self._notes):
                if os.path.lexists(path):
                    raise OutputError(path, "", "a file that stseg did not make", "another folder")
        elif (other := _difference(request, found.request)) and not overwrite:
            key, now, before = other
            found_text = f"{abbreviated(now)}, where the boxes there have {abbreviated(before)}"
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

    def begin(self, by_stamps: bool) -> Self:
        """Make the file of boxes as long as the state says, and hold it."""
        with output_errors(self.path):
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
            self._file = os.fdopen(os.open(self._unfinished, flags, 0o666), "r+b")
            lock(self._file)
            if not self.state.frames:
                self._file.truncate(0)
                self._file.write(HEADER.encode())
                self.path.unlink(missing_ok=True)
            self._file.truncate(self.state.size)
            self._file.seek(self.state.size)
            self._keep(replace(self.state, by_stamps=by_stamps))
        return self

    def append(self, text: str, frames: int) -> None:
        """Keep the boxes of further frames; raises OutputError."""
        with output_errors(self.path):
            self._file.write(text.encode())
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


def detect_frames(source: Source, camera: Camera, boxes: DetectedBoxes, advance: Callable[[int], None]) -> None:
    """Find people in all frames of a camera that are not done; raises InputError.

    Parameters
    ----------
    source, camera
        The video, with its detector.
    boxes
        Their file, begun.
    advance
        Called with each number of further frames.
    """
    detector, pictures = make_detector(source), source.without_detector()
    # A network takes all cores by itself.
    threads = (os.cpu_count() or 1) if source.detector == HOG else 1
    with closing(open_stream(pictures, camera)) as stream, ThreadPoolExecutor(threads) as pool:
        stream.skip(boxes.state.frames)
        lines, frames, kept = list[str](), 0, monotonic()
        while batch := list(islice(_pictures(stream), _PICTURES)):
            for found in pool.map(detector.detect, batch):
                lines += _lines(boxes.state.frames + frames, found)
                frames += 1
            advance(len(batch))
            if monotonic() - kept > _KEPT_EVERY:
                boxes.append("".join(lines), frames)
                lines, frames, kept = [], 0, monotonic()
        boxes.append("".join(lines), frames)
    boxes.finish()


def _pictures(stream: Stream) -> Iterator[Bytes]:
    while (view := stream.read()) is not None:
        yield np.asarray(view, np.uint8)


def _lines(frame: int, boxes: Boxes) -> list[str]:
    rows = zip(boxes.pixel.tolist(), boxes.score.tolist(), strict=True)
    return [f"{frame},{','.join(f'{edge:.2f}' for edge in pixel)},{score:.4f}\n" for pixel, score in rows]


def _difference(now: Mapping[str, str], before: Mapping[str, object]) -> tuple[str, str, object] | None:
    """The first key that differs, and its values."""
    return next(((key, now[key], before.get(key)) for key in now if now[key] != before.get(key)), None)


def _size(path: Path) -> int:
    return path.stat().st_size if is_regular(path) else 0
