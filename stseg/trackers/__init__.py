"""Ways to follow people, all behind one protocol."""

from __future__ import annotations

from collections.abc import Callable

from stseg.config import Config
from stseg.errors import ConfigError
from stseg.geometry import Rig
from stseg.trackers.cut import CutTracker
from stseg.trackers.frames import FrameTracker
from stseg.trackers.protocol import Commit, Scene, Tracker

TRACKERS: dict[str, Callable[[Rig, Config, int], Tracker]] = {"cut": CutTracker, "frames": FrameTracker}
"""cut: graph cuts of windows of the volume (the default). frames: each frame by itself, linked by motion alone."""


def make_tracker(name: str, rig: Rig, config: Config, first: int) -> Tracker:
    """The tracker of that name for a run from frame `first` on."""
    if name not in TRACKERS:
        raise ConfigError("--tracker", "", repr(name), f"one of {', '.join(TRACKERS)}")
    return TRACKERS[name](rig, config, first)


__all__ = ["TRACKERS", "Commit", "Scene", "Tracker", "make_tracker"]
