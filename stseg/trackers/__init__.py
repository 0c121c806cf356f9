"""Trackers: multi-target tracking methods behind one protocol."""

from __future__ import annotations

from stseg.baselines.du_piater_2006 import BeliefTracker
from stseg.baselines.huang_wang_2012.kalman import KalmanTracker
from stseg.baselines.kim_davis_2006 import ParticleTracker
from stseg.errors import ConfigError
from stseg.trackers.cut import CutTracker
from stseg.trackers.frames import FrameTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame, Tracker

TRACKERS: dict[str, type[Tracker]] = {
    "cut": CutTracker,
    "frames": FrameTracker,
    "kalman": KalmanTracker,
    "particles": ParticleTracker,
    "belief": BeliefTracker,
}
"""cut: graph cuts of windows of the volume (the default). frames: detections with their tracks, without a cut.
kalman: a Kalman filter for each track (Hwang and Wang 2012). particles: particle filters on joint states with colour
models (Kim and Davis 2006). belief: particle filters in every view, fused by belief propagation over the ground (Du and
Piater 2006)."""


def find_tracker(name: str) -> type[Tracker]:
    """The tracker of that name."""
    if name not in TRACKERS:
        raise ConfigError("--tracker", "", repr(name), f"one of {', '.join(TRACKERS)}")
    return TRACKERS[name]


__all__ = ["TRACKERS", "Commit", "FrameObservations", "FusedFrame", "Tracker", "find_tracker"]
