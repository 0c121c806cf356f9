"""Window tracklets: the blobs of one window that belong to one track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Floats
from stseg.records.blobs import Blobs


@dataclass
class Tracklet:
    """A window tracklet, at most one blob a frame: parallel lists, in the order of time."""

    filter_track: int
    """Track of the filter (`TrackFilter`)."""
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

    def extend(self, later: Tracklet) -> None:
        """Append a later tracklet of the same track."""
        self.filter_track = later.filter_track
        self.frames += later.frames
        self.blobs += later.blobs
        self.ground += later.ground


def form_tracklets(blobs: Sequence[Blobs], first: int) -> list[Tracklet]:
    """The tracklets of a window, which begins with frame `first`: blobs that hold detections of one filter track.

    `blobs` are those of each frame of the window; `track` of them holds filter tracks.
    """
    tracklets: dict[int, Tracklet] = {}
    for frame, found in enumerate(blobs, first):
        for b in np.flatnonzero(found.person >= 0).tolist():
            track = int(found.track[b])
            tracklets.setdefault(track, Tracklet(track)).add(frame, b, found.ground[b])
    return list(tracklets.values())
