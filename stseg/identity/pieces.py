"""Track pieces: the blobs of one window that are one body (METHODS 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import IdentityConfig
from stseg.identity.linking import assign
from stseg.segmentation.blobs import Blobs


@dataclass
class Piece:
    """Blobs of one body, one a frame at most: parallel lists, in the order of time.

    Attributes
    ----------
    frames
        Frames of the recording.
    blobs
        Index of the blob in each frame.
    ground : list of float64 (2,)
        Metres.
    """

    frames: list[int] = field(default_factory=list)
    blobs: list[int] = field(default_factory=list)
    ground: list[Floats] = field(default_factory=list)

    def add(self, frame: int, blob: int, ground: Floats) -> None:
        """Append the body's blob in a later frame."""
        self.frames.append(frame)
        self.blobs.append(blob)
        self.ground.append(ground)

    def extend(self, later: Piece) -> None:
        """Append what is the same body later."""
        self.frames += later.frames
        self.blobs += later.blobs
        self.ground += later.ground

    def velocity(self, at_end: bool) -> Floats:
        """Metres per frame over up to four steps at the piece's end or beginning, float64 (2,)."""
        few = slice(-5, None) if at_end else slice(0, 5)
        frames, ground = self.frames[few], self.ground[few]
        if len(frames) < 2:
            return np.zeros(2)
        return np.asarray((ground[-1] - ground[0]) / (frames[-1] - frames[0]))


def chain(blobs: Sequence[Blobs], before: Sequence[Ints], first: int, frame_rate: float, config: IdentityConfig) -> list[Piece]:
    """The pieces of a window.

    Blobs that hold linked people are one piece; then pieces that end are joined to pieces that begin soon after, where
    a walker would be.

    Parameters
    ----------
    blobs
        Of each frame of the window.
    before
        For each frame and each of its people the index in the frame before, -1 for nobody.
    first
        The window's first frame.
    """
    pieces: list[Piece] = []
    open_: dict[int, Piece] = {}
    for offset, (found, links) in enumerate(zip(blobs, before, strict=True)):
        held: dict[int, Piece] = {}
        for b, person in enumerate(found.person):
            piece = open_.get(int(links[person])) if person >= 0 and links[person] >= 0 else None
            if piece is None:
                piece = Piece()
                pieces.append(piece)
            piece.add(first + offset, b, found.ground[b])
            if person >= 0:
                held[int(person)] = piece
        open_ = held
    return join(pieces, frame_rate, config)


def join(pieces: list[Piece], frame_rate: float, config: IdentityConfig) -> list[Piece]:
    """Join pieces across gaps of at most `patience`, the best pairs first, until none fits."""
    patience = max(round(config.patience * frame_rate), 1)
    while True:
        cost = np.array([[gap_cost(a, b, patience, frame_rate, config) for b in pieces] for a in pieces])
        rows, columns = assign(cost.reshape(len(pieces), len(pieces)), np.finfo(float).max)
        if not len(rows):
            return pieces
        best = int(cost[rows, columns].argmin())
        a, b = pieces[rows[best]], pieces[columns[best]]
        a.extend(b)
        pieces = [piece for piece in pieces if piece is not b]


def gap_cost(ended: Piece, begun: Piece, patience: int, frame_rate: float, config: IdentityConfig) -> float:
    """Metres between where the two would meet at constant velocity; infinite where a walker could not be both."""
    gap = begun.frames[0] - ended.frames[-1]
    if not 0 < gap <= patience + 1:
        return np.inf
    apart = begun.ground[0] - ended.ground[-1]
    if np.hypot(*apart) > config.walking_speed * gap / frame_rate + config.slack:
        return np.inf
    miss = apart - 0.5 * gap * (ended.velocity(True) + begun.velocity(False))
    return float(np.hypot(*miss)) + config.slack * (gap - 1) / patience
