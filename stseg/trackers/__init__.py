"""Trackers: multi-target tracking methods behind one protocol, imported when they are asked for."""

from importlib import import_module
from typing import cast

from stseg.errors import ConfigError, one_of
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame, TrackingMethod

TRACKERS = {
    "cut": "stseg.trackers.cut:CutTracker",
    "frames": "stseg.trackers.framewise:FrameTracker",
    "kalman": "stseg.baselines.huang_wang_2012.kalman:KalmanTracker",
    "particles": "stseg.baselines.kim_davis_2006.tracker:ParticleTracker",
    "belief": "stseg.baselines.du_piater_2006.tracker:BeliefTracker",
}
"""Module and class of each tracker.

cut: graph cuts of windows of the volume (the default). frames: detections with their tracks, without a cut.
kalman: a Kalman filter for each track (Huang and Wang 2012). particles: particle filters on joint states with colour
models (Kim and Davis 2006). belief: particle filters in every view, fused by belief propagation over the ground (Du and
Piater 2006)."""


def find_tracker(name: str) -> type[TrackingMethod]:
    """The tracker of that name."""
    if name not in TRACKERS:
        raise ConfigError("--tracker", "", repr(name), one_of(name, TRACKERS))
    module, found = TRACKERS[name].split(":")
    return cast(type[TrackingMethod], getattr(import_module(module), found))


__all__ = ["TRACKERS", "Commit", "FrameObservations", "FusedFrame", "TrackingMethod", "find_tracker"]
