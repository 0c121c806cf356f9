"""Missing views and dropped frames of live cameras, as events of the run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.io.recording.frames import FrameSet
from stseg.records.tables import EVENT


class BlindViews:
    """Record of missing views and dropped frames until their frames are committed.

    Parameters
    ----------
    cameras
        Names of the cameras, in the rig's order.
    """

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = cameras
        self._dropped: set[int] = set()
        self._missing: dict[int, list[int]] = {}

    def note(self, frame_set: FrameSet) -> None:
        """Record the missing views of a frame set."""
        missing = [k for k, view in enumerate(frame_set.views) if view is None]
        if frame_set.dropped:
            self._dropped.add(frame_set.frame)
        elif missing:
            self._missing[frame_set.frame] = missing

    def events(self, frames: Sequence[int]) -> Rows:
        """EVENT rows of committed frames: one for the number of dropped frames, and one per blind camera."""
        events = []
        dropped = [frame for frame in frames if frame in self._dropped]
        if dropped:
            events.append(
                (dropped[0], f"{len(dropped)} of {len(frames)} frames dropped: tracking is slower than the cameras")
            )
        for k, name in enumerate(self._cameras):
            blind = [frame for frame in frames if k in self._missing.get(frame, ())]
            if blind:
                events.append((blind[0], f"camera {name} showed nothing in {len(blind)} of {len(frames)} frames"))
        return np.array([(frame, b"blind", 0, 0, text.encode()) for frame, text in events], EVENT)

    def forget(self, before: int) -> None:
        """Discard the records of frames before frame `before`."""
        self._dropped = {frame for frame in self._dropped if frame >= before}
        self._missing = {frame: missing for frame, missing in self._missing.items() if frame >= before}
