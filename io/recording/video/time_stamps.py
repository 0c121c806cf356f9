"""Time stamps of one camera's files: frame positions on a clock that ticks at the rig's rate.

Stamps start again with each file. A file follows the previous one without a gap, unless the rig gives its start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import SourceError

_RESOLUTION = 0.002
"""Rounding error of stamps in containers, seconds."""
_ROUNDED = 1e-5
"""Rounding error of rates in the rig file (29.97 for 30000 / 1001), relative."""
_LONGEST_GAP = 24 * 3600.0
"""Distance of two frames of one file from which stamps count as broken, seconds."""
_REGULAR = 0.5
"""Distance between stamp and frame number up to which both agree, ticks."""


@dataclass(frozen=True)
class TimeStamps:
    """Frame positions of one camera on its own clock; tick 0 is the first frame of its first file."""

    position: Floats
    """float64 (n,): position of each frame, ticks of the rig's clock, rising."""
    period: float
    """Usual distance of two frames, ticks."""
    steady: bool
    """Whether all distances equal it: the stamps may then come from a header rather than a clock."""

    def fits(self, counted: Floats) -> bool:
        """Whether all stamps agree with positions by counting, float64 (n,) ticks, within half a tick."""
        far = np.abs(self.position - counted)
        return bool((far <= _REGULAR + _ROUNDED * np.arange(len(counted))).all())

    @property
    def rate(self) -> float:
        """Frames to a tick."""
        return 1.0 / self.period


def interpret_stamps(
    times: Sequence[Floats], frame_rate: float, paths: Sequence[Path], starts: Floats
) -> TimeStamps | None:
    """Frame positions by the stamps of a camera's files; None where stamps lack, do not rise, or jump by a day.

    AVI has a rate and no stamps: the times that decoders give to its B-frames and empty chunks are no clock.

    SourceError where a file starts before the previous one has ended.

    Parameters
    ----------
    times : float64 (n,) each
        Stamps of the frames of each file, milliseconds; nan where there is none.
    frame_rate
        Of the rig, frames per second.
    paths
        The files.
    starts : float64 (file,)
        Start of each file, seconds; empty where files follow one another.
    """
    if any(np.isnan(stamps[:1]).any() for stamps in times):
        return None
    files = [(stamps - stamps[:1]) / 1000 * frame_rate for stamps in times]
    steps = np.concatenate([np.diff(stamps) for stamps in files])
    rises = ((steps > 0) & (steps < _LONGEST_GAP * frame_rate)).all()
    if not rises or not all(np.isfinite(stamps).all() for stamps in files):
        return None
    if not len(steps):
        return TimeStamps(concatenate_files(files, 1.0, frame_rate, paths, starts), 1.0, True)
    mean = float(steps.mean())
    fuzzy = _RESOLUTION * frame_rate
    steady = all(bool((np.abs(stamps - mean * np.arange(len(stamps))) <= fuzzy).all()) for stamps in files)
    if not steady and any(map(_is_avi, paths)):
        return None
    period = mean if steady else float(np.median(steps))
    return TimeStamps(concatenate_files(files, period, frame_rate, paths, starts), period, steady)


def no_stamps(frames: int) -> Floats:
    """The stamps of a file that has none: nan for each frame, float64 (n,), in the memory of one."""
    return np.broadcast_to(np.nan, frames)


def pack_stamps(stamps: Floats) -> Floats | Ints:
    """Stamps to store or send: as they are, or the number of frames where there are none, int64 (1,)."""
    return np.array([len(stamps)], np.int64) if np.isnan(stamps).all() else stamps


def unpack_stamps(packed: Floats | Ints) -> Floats:
    """The stamps of `pack_stamps`."""
    return no_stamps(int(packed[0])) if packed.dtype == np.int64 else packed.astype(float)


def have_stamps(times: Sequence[Floats], paths: Sequence[Path]) -> bool:
    """Whether a camera's files have a time stamp for each frame."""
    return all(np.isfinite(stamps).all() for stamps in times) and not any(map(_is_avi, paths))


def concatenate_files(
    files: Sequence[Floats], period: float, frame_rate: float, paths: Sequence[Path], starts: Floats
) -> Floats:
    """Frame positions of all files on one clock, ticks; those of each file count from its own first frame.

    Without `starts` a file begins one period after the last frame of the previous one. Where that equals its number of
    frames up to rounding it is exactly that number, so that splitting a recording changes nothing.

    SourceError where a file starts before the previous one has ended.
    """
    begin, parts = 0.0, list[Floats]()
    for k, stamps in enumerate(files):
        if len(starts):
            begin = _after(parts, float(starts[k]) * frame_rate, frame_rate, paths[k])
        parts.append(begin + stamps)
        length = len(stamps)
        last = float(stamps[-1]) if length else -period
        fuzzy = _RESOLUTION * frame_rate + _ROUNDED * length
        begin += length if abs(last + 1 - length) <= fuzzy else last + period
    return np.concatenate(parts)


def _after(parts: Sequence[Floats], begin: float, frame_rate: float, path: Path) -> float:
    """The start of a file, checked to lie after all frames before it."""
    last = float(parts[-1][-1]) if parts else -np.inf
    if begin <= last:
        found = f"{begin / frame_rate:.3f} s, when the previous file goes on until {last / frame_rate:.3f} s"
        raise SourceError(path, "starts", found, "files that follow one another")
    return begin


def _is_avi(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(12)
    return head[:4] == b"RIFF" and head[8:] == b"AVI "


def require_starts(starts: Sequence[float], files: int, path: Path, key: str) -> None:
    """Raise SourceError where `starts` are given, but not one for each file, rising."""
    if starts and len(starts) != files:
        raise SourceError(path, key, f"{len(starts)} starts of {files} files", "one for each")
    if any(after <= before for before, after in pairwise(starts)) or min(starts, default=0.0) < 0:
        found = f"starts {', '.join(f'{start:g}' for start in starts)}"
        raise SourceError(path, key, found, "seconds from 0 on, rising")
