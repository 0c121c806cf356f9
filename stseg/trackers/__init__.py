"""Ways to follow people, all behind one protocol."""

from __future__ import annotations

from stseg.errors import ConfigError
from stseg.trackers.cut import CutTracker
from stseg.trackers.frames import FrameTracker
from stseg.trackers.protocol import Commit, Scene, Shown, Tracker

TRACKERS: dict[str, type[Tracker]] = {"cut": CutTracker, "frames": FrameTracker}
"""cut: graph cuts of windows of the volume (the default). frames: each frame by itself, linked by motion alone."""


def find_tracker(name: str) -> type[Tracker]:
    """The tracker of that name."""
    if name not in TRACKERS:
        raise ConfigError("--tracker", "", repr(name), f"one of {', '.join(TRACKERS)}")
    return TRACKERS[name]


__all__ = ["TRACKERS", "Commit", "Scene", "Shown", "Tracker", "find_tracker"]
