"""Ways to follow people, all behind one protocol."""

from __future__ import annotations

from stseg.errors import ConfigError
from stseg.trackers.belief import BeliefTracker
from stseg.trackers.cut import CutTracker
from stseg.trackers.frames import FrameTracker
from stseg.trackers.kalman import KalmanTracker
from stseg.trackers.particles import ParticleTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame, Tracker

TRACKERS: dict[str, type[Tracker]] = {
    "cut": CutTracker,
    "frames": FrameTracker,
    "kalman": KalmanTracker,
    "particles": ParticleTracker,
    "belief": BeliefTracker,
}
"""cut: graph cuts of windows of the volume (the default). frames: each frame by itself, linked by motion alone.
kalman: a filter for each person over the people of each frame (HW12). particles: hypotheses of where everybody stands,
guided by the colours of their clothes (KD06). belief: particles in every view, which tell each other by way of the
ground (DP06)."""


def find_tracker(name: str) -> type[Tracker]:
    """The tracker of that name."""
    if name not in TRACKERS:
        raise ConfigError("--tracker", "", repr(name), f"one of {', '.join(TRACKERS)}")
    return TRACKERS[name]


__all__ = ["TRACKERS", "Commit", "FrameObservations", "FusedFrame", "Tracker", "find_tracker"]
