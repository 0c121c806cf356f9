"""What live cameras did not show, as events of the run: nothing is left out without a word."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.io.live.live_frames import LiveFrameSet
from stseg.model.tables import EVENT


class BlindViews:
    """Remembers which views were missing until the frames are decided.

    Parameters
    ----------
    cameras
        Their names, in the rig's order.
    """

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = cameras
        self._dropped: set[int] = set()
        self._missing: dict[int, list[int]] = {}

    def note(self, moment: LiveFrameSet) -> None:
        """A moment, whose views may be missing."""
        missing = [k for k, view in enumerate(moment.views) if view is None]
        if moment.dropped:
            self._dropped.add(moment.frame)
        elif missing:
            self._missing[moment.frame] = missing

    def events(self, frames: Sequence[int]) -> Rows:
        """EVENT rows of decided frames: one of how many were dropped, and one of each camera that was blind."""
        told = []
        dropped = [frame for frame in frames if frame in self._dropped]
        if dropped:
            told.append(
                (dropped[0], f"{len(dropped)} of {len(frames)} frames dropped: tracking is slower than the cameras")
            )
        for k, name in enumerate(self._cameras):
            blind = [frame for frame in frames if k in self._missing.get(frame, ())]
            if blind:
                told.append((blind[0], f"camera {name} showed nothing in {len(blind)} of {len(frames)} frames"))
        return np.array([(frame, b"blind", 0, 0, text.encode()) for frame, text in told], EVENT)

    def forget(self, before: int) -> None:
        """Frames before one will not be asked for again."""
        self._dropped = {frame for frame in self._dropped if frame >= before}
        self._missing = {frame: missing for frame, missing in self._missing.items() if frame >= before}
