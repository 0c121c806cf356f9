"""Window tracklets: the blobs of one window that belong to one track."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Floats
from stseg.config import TrackingConfig
from stseg.geometry.distances import distances
from stseg.records.blobs import UNASSIGNED, Blobs
from stseg.tracking.filter.assignment import assign


@dataclass
class Tracklet:
    """A window tracklet, at most one blob a frame: parallel lists, in the order of time."""

    filter_track: int
    """Track of the filter (`TrackFilter`), 0 if none of the blobs holds a detection."""
    frames: list[int] = field(default_factory=list)
    """Frame numbers of the recording."""
    blobs: list[int] = field(default_factory=list)
    """Index of the blob in each frame."""
    ground: list[Floats] = field(default_factory=list)
    """list of float64 (2,): metres."""

    def add(self, frame: int, blob: int, ground: Floats) -> None:
        """Append a blob of a later frame."""
        self.frames.append(frame)
        self.blobs.append(blob)
        self.ground.append(ground)

    def insert(self, frame: int, blob: int, ground: Floats) -> None:
        """Insert a blob into a gap."""
        place = bisect(self.frames, frame)
        self.frames.insert(place, frame)
        self.blobs.insert(place, blob)
        self.ground.insert(place, ground)

    def between(self, frame: int) -> Floats:
        """Linearly interpolated place in a gap, metres, float64 (2,)."""
        place = bisect(self.frames, frame)
        before, after = self.frames[place - 1], self.frames[place]
        fraction = (frame - before) / (after - before)
        return np.asarray(self.ground[place - 1] * (1 - fraction) + self.ground[place] * fraction)

    def extend(self, later: Tracklet) -> None:
        """Append a later tracklet of the same track."""
        self.filter_track = later.filter_track or self.filter_track
        self.frames += later.frames
        self.blobs += later.blobs
        self.ground += later.ground


def form_tracklets(blobs: Sequence[Blobs], first: int, config: TrackingConfig) -> list[Tracklet]:
    """The tracklets of a window, which begins with frame `first`.

    Blobs that hold detections of one filter track are one tracklet. A blob without a detection joins the tracklet with
    a gap there, near the interpolated place, unless another track claims it. So the cut bridges missed detections, and
    nothing more. `blobs` are those of each frame of the window; `track` of them holds filter tracks.
    """
    tracklets: dict[int, Tracklet] = {}
    for offset, found in enumerate(blobs):
        for b in np.flatnonzero(found.person >= 0).tolist():
            track = int(found.track[b])
            tracklets.setdefault(track, Tracklet(track)).add(first + offset, b, found.ground[b])
    for offset, found in enumerate(blobs):
        _bridge(list(tracklets.values()), first + offset, found, config)
    return list(tracklets.values())


def _bridge(tracklets: Sequence[Tracklet], frame: int, found: Blobs, config: TrackingConfig) -> None:
    """Assign a frame's blobs without a detection to tracklets that have a gap there."""
    open_ = [one for one in tracklets if one.frames[0] < frame < one.frames[-1] and frame not in one.frames]
    unheld = np.flatnonzero(found.person < 0)
    if not open_ or not len(unheld):
        return
    predicted = np.array([tracklet.between(frame) for tracklet in open_])
    away = distances(predicted, found.ground[unheld])
    track = np.array([tracklet.filter_track for tracklet in open_])
    others = (found.track[unheld] != UNASSIGNED) & (found.track[unheld] != track[:, None])
    for row, column in zip(*assign(np.where(others, np.inf, away), config.assignment_distance), strict=True):
        blob = int(unheld[column])
        open_[row].insert(frame, blob, found.ground[blob])
