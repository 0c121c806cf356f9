"""Track pieces: the blobs of one window that are one body (METHODS 5)."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Floats
from stseg.config import TrackingConfig
from stseg.model.blobs import UNASSIGNED, Blobs
from stseg.tracking.assignment import assign, distances


@dataclass
class Tracklet:
    """Blobs of one body, one a frame at most: parallel lists, in the order of time.

    Attributes
    ----------
    chain
        The chain of the people whom the blobs hold, 0 where they hold nobody.
    frames
        Frames of the recording.
    blobs
        Index of the blob in each frame.
    ground : list of float64 (2,)
        Metres.
    """

    chain: int
    frames: list[int] = field(default_factory=list)
    blobs: list[int] = field(default_factory=list)
    ground: list[Floats] = field(default_factory=list)

    def add(self, frame: int, blob: int, ground: Floats) -> None:
        """Append the body's blob in a later frame."""
        self.frames.append(frame)
        self.blobs.append(blob)
        self.ground.append(ground)

    def insert(self, frame: int, blob: int, ground: Floats) -> None:
        """Put the body's blob into a gap."""
        place = bisect(self.frames, frame)
        self.frames.insert(place, frame)
        self.blobs.insert(place, blob)
        self.ground.insert(place, ground)

    def between(self, frame: int) -> Floats:
        """Where the body would be in a gap on a straight line, metres, float64 (2,)."""
        place = bisect(self.frames, frame)
        before, after = self.frames[place - 1], self.frames[place]
        share = (frame - before) / (after - before)
        return np.asarray(self.ground[place - 1] * (1 - share) + self.ground[place] * share)

    def extend(self, later: Tracklet) -> None:
        """Append what is the same body later."""
        self.chain = later.chain or self.chain
        self.frames += later.frames
        self.blobs += later.blobs
        self.ground += later.ground

    def velocity(self) -> Floats:
        """Metres per frame over up to four steps at the piece's end, float64 (2,)."""
        frames, ground = self.frames[-5:], self.ground[-5:]
        if len(frames) < 2:
            return np.zeros(2)
        return np.asarray((ground[-1] - ground[0]) / (frames[-1] - frames[0]))


def form_tracklets(blobs: Sequence[Blobs], first: int, config: TrackingConfig) -> list[Tracklet]:
    """The pieces of a window.

    Blobs that hold people of one chain are one piece. A blob that holds nobody, but is of that chain or of no known
    one, belongs to the piece in whose gap it lies, where the walker would be: so the cut bridges frames in which the
    pass missed somebody, and no more.

    Parameters
    ----------
    blobs
        Of each frame of the window; their tracks are chains (`identity.linking`).
    first
        The window's first frame.
    """
    pieces: dict[int, Tracklet] = {}
    for offset, found in enumerate(blobs):
        for b in np.flatnonzero(found.person >= 0).tolist():
            chain = int(found.track[b])
            pieces.setdefault(chain, Tracklet(chain)).add(first + offset, b, found.ground[b])
    for offset, found in enumerate(blobs):
        _bridge(list(pieces.values()), first + offset, found, config)
    return list(pieces.values())


def _bridge(pieces: Sequence[Tracklet], frame: int, found: Blobs, config: TrackingConfig) -> None:
    """Give a frame's blobs that hold nobody to pieces that have a gap there."""
    open_ = [piece for piece in pieces if piece.frames[0] < frame < piece.frames[-1] and frame not in piece.frames]
    nobody = np.flatnonzero(found.person < 0)
    if not open_ or not len(nobody):
        return
    expected = np.array([piece.between(frame) for piece in open_])
    away = distances(expected, found.ground[nobody])
    chain = np.array([piece.chain for piece in open_])
    others = (found.track[nobody] != UNASSIGNED) & (found.track[nobody] != chain[:, None])
    for row, column in zip(*assign(np.where(others, np.inf, away), config.assignment_distance), strict=True):
        blob = int(nobody[column])
        open_[row].insert(frame, blob, found.ground[blob])
