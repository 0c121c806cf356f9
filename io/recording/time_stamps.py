"""What the time stamps of one camera's files say: where its frames lie on a clock that ticks at the rig's rate.

Stamps begin anew with each file. A file follows the one before without a gap, unless the rig says when it starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.errors import SourceError

_RESOLUTION = 0.002
"""How far a stamp may be off by the rounding of containers, seconds."""
_ROUNDED = 1e-5
"""How far a rate may be off by its rounding in the rig file (29.97 for 30000 / 1001), relative."""
_LEAP = 24 * 3600.0
"""What no two frames of one file lie apart, seconds: such stamps are broken."""
_REGULAR = 0.5
"""How far frames may lie from the ticks of their numbers and still be theirs, ticks."""


@dataclass(frozen=True)
class TimeStamps:
    """The frames of one camera on its own clock, whose tick 0 is the first frame of its first file.

    Attributes
    ----------
    position : float64 (n,)
        Where each frame lies, ticks of the rig's clock, rising.
    period
        What usually lies between two frames, ticks.
    steady
        Whether it always does: then a header may have said so, where no clock did.
    """

    position: Floats
    period: float
    steady: bool

    def fits(self, counted: Floats) -> bool:
        """Whether every frame lies where counting puts it, within half a tick: positions float64 (n,), ticks."""
        far = np.abs(self.position - counted)
        return bool((far <= _REGULAR + _ROUNDED * np.arange(len(counted))).all())

    @property
    def rate(self) -> float:
        """Frames to a tick."""
        return 1.0 / self.period


def interpret_stamps(
    times: Sequence[Floats], frame_rate: float, paths: Sequence[Path], starts: Floats
) -> TimeStamps | None:
    """What the stamps of a camera's files say; None where there are none, or they do not rise, or leap by a day.

    AVI states a rate and no times: what decoders make of B-frames and empty chunks in it is no clock.

    Parameters
    ----------
    times : float64 (n,) each
        Of the frames of each file, milliseconds; nan where none is stated.
    frame_rate
        The rig's, frames per second.
    paths
        The files.
    starts : float64 (file,)
        When each file begins, seconds; none where they follow one another.

    Raises
    ------
    SourceError
        Where a file starts before the one before has ended.
    """
    files = [(own - own[:1]) / 1000 * frame_rate for own in times]
    if not all(np.isfinite(own).all() and _rises(np.diff(own), _LEAP * frame_rate) for own in files):
        return None
    steps = np.concatenate([np.diff(own) for own in files])
    if not len(steps):
        return TimeStamps(concatenate_files(files, 1.0, frame_rate, paths, starts), 1.0, True)
    mean = float(steps.mean())
    fuzzy = _RESOLUTION * frame_rate
    steady = all(bool((np.abs(own - mean * np.arange(len(own))) <= fuzzy).all()) for own in files)
    if not steady and any(map(_is_avi, paths)):
        return None
    period = mean if steady else float(np.median(steps))
    return TimeStamps(concatenate_files(files, period, frame_rate, paths, starts), period, steady)


def have_stamps(times: Sequence[Floats], paths: Sequence[Path]) -> bool:
    """Whether a camera's files claim to say when each of their frames was taken."""
    return all(np.isfinite(own).all() for own in times) and not any(map(_is_avi, paths))


def _rises(steps: Floats, leap: float) -> bool:
    return bool(((steps > 0) & (steps < leap)).all())


def concatenate_files(
    files: Sequence[Floats], period: float, frame_rate: float, paths: Sequence[Path], starts: Floats
) -> Floats:
    """The frames of all files on one clock, ticks; those of each file count from its own first.

    Where there are no `starts` a file begins one period after the last frame of the one before; exactly as many ticks
    after its first as it has frames where that is the same but for rounding, so that the border leaves no trace.

    Raises
    ------
    SourceError
        Where a file starts before the one before has ended.
    """
    begin, parts = 0.0, list[Floats]()
    for k, own in enumerate(files):
        if len(starts):
            begin = _after(parts, float(starts[k]) * frame_rate, frame_rate, paths[k])
        parts.append(begin + own)
        length = len(own)
        last = float(own[-1]) if length else -period
        fuzzy = _RESOLUTION * frame_rate + _ROUNDED * length
        begin += length if abs(last + 1 - length) <= fuzzy else last + period
    return np.concatenate(parts)


def _after(parts: Sequence[Floats], begin: float, frame_rate: float, path: Path) -> float:
    """A start, which lies after all frames before it."""
    last = float(parts[-1][-1]) if parts else -np.inf
    if begin <= last:
        found = f"{begin / frame_rate:.3f} s, when the file before goes on until {last / frame_rate:.3f} s"
        raise SourceError(path, "starts", found, "files that follow one another")
    return begin


def _is_avi(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(12)
    return head[:4] == b"RIFF" and head[8:] == b"AVI "


def require_starts(starts: Sequence[float], files: int, path: Path, key: str) -> None:
    """Raise SourceError where starts are given, but not one for each file in the order of time."""
    if starts and len(starts) != files:
        raise SourceError(path, key, f"{len(starts)} starts of {files} files", "one for each")
    if any(after <= before for before, after in pairwise(starts)) or min(starts, default=0.0) < 0:
        found = f"starts {', '.join(f'{start:g}' for start in starts)}"
        raise SourceError(path, key, found, "seconds from 0 on, rising")
