"""A part of a recording, in frames."""

from __future__ import annotations

from typing import NamedTuple

from stseg.arrays import Ints
from stseg.errors import ConfigError
from stseg.io.recording.aligned_stream import StreamIndex
from stseg.io.recording.recording import Recording
from stseg.io.runfile.runs import Run
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import abbreviated, parse_whole

FrameSpan = tuple[int | None, int | None] | None
"""First and stop, half open; None for the recording's first frame and its end, or for all frames."""


class FrameRange(NamedTuple):
    """Frames first .. stop - 1; None for the recording's first frame, and for its end."""

    first: int | None
    stop: int | None

    def __str__(self) -> str:
        return f"{'' if self.first is None else self.first}:{'' if self.stop is None else self.stop}"

    @classmethod
    def of(cls, span: FrameSpan) -> FrameRange | None:
        """The range of a pair, as a Python caller gives it; None for all frames. Raises ConfigError."""
        if span is None:
            return None
        given: object = span
        if not isinstance(given, tuple | list) or len(given) != 2:  # as of a range
            raise ConfigError("frames", "", abbreviated(span), "a pair (first, stop), half open")
        return cls(*span)

    @classmethod
    def parsed(cls, text: str | None) -> FrameRange | None:
        """The range of an option's text; None without one."""
        return None if text is None else cls.parse(text)

    @classmethod
    def parse(cls, text: str) -> FrameRange:
        """The range of a text A:B; raises ConfigError."""
        head, colon, tail = text.partition(":")
        first, stop = (parse_whole(part, 0, limits.FRAMES) for part in (head, tail))
        if not colon or (head and first is None) or (tail and stop is None):
            raise ConfigError("--frames", "", abbreviated(text), f"A:B, whole numbers up to {limits.FRAMES}, half open")
        return cls(first, stop)


def resolve_frames(frames: FrameRange | None, streams: StreamIndex, recording: Recording) -> tuple[int, int]:
    """First and stop of a part of a recording; without a range, of all frames that tell where anything stands.

    Raises
    ------
    ConfigError
        Where the range is not within the recording, or is empty.
    """
    if frames is None:
        return streams.multi_view_range(recording)
    first, stop = frames.first or 0, streams.length if frames.stop is None else frames.stop
    if not 0 <= first < stop <= streams.length:
        raise ConfigError("--frames", "", f"'{frames}'", f"a part of the recording's frames, 0:{streams.length}")
    return first, stop


def frames_of_run(run: Run, frames: FrameSpan) -> Ints:
    """Frame numbers of a part of a run, all of the run's by default, int64 (n,).

    Raises
    ------
    ConfigError
        Where the run has no frames, or the range is not within them.
    """
    if not len(run.frames):
        raise ConfigError(run.path, "", "a run without frames", "one that has some")
    given, begin, end = FrameRange(*(frames or (None, None))), int(run.frames[0]), int(run.frames[-1]) + 1
    first, stop = begin if given.first is None else given.first, end if given.stop is None else given.stop
    if not begin <= first < stop <= end:
        expected = f"A:B, half open, of the run's frames {begin}:{end}"
        raise ConfigError("command line", "--frames", f"'{given}'", expected)
    return run.frames[(run.frames >= first) & (run.frames < stop)]
