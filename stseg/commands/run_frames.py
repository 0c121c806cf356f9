"""`--frames A:B` of the frames that a run file has."""

from __future__ import annotations

from stseg.arrays import Ints
from stseg.engine.offline.frame_range import FrameRange
from stseg.errors import ConfigError
from stseg.io.runfile.runs import Run


def select_frames(run: Run, text: str | None) -> Ints:
    """Frame numbers of a range A:B, all of the run's by default, int64 (n,).

    Raises
    ------
    ConfigError
        Where the run has no frames, or the range is not within them.
    """
    frames = run.frames
    if not len(frames):
        raise ConfigError(run.path, "", "a run without frames", "one that has some")
    if text is None:
        return frames
    given = FrameRange.parse(text)
    some = f"A:B, half open, of the run's frames {frames[0]}:{frames[-1] + 1}"
    first = int(frames[0]) if given.first is None else given.first
    stop = int(frames[-1]) + 1 if given.stop is None else given.stop
    if not frames[0] <= first < stop <= frames[-1] + 1:
        raise ConfigError("command line", "--frames", repr(text), some)
    return frames[(frames >= first) & (frames < stop)]
