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

    def extend(self, later: Piece) -> None:
        """Append what is the same body later."""
        self.chain = later.chain or self.chain
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


def chain_pieces(
    blobs: Sequence[Blobs], chains: Sequence[Ints], first: int, frame_rate: float, config: IdentityConfig
) -> list[Piece]:
    """The pieces of a window.

    Blobs that hold people of one chain are one piece. Blobs that hold nobody are joined to the pieces that end before
    or begin after them, where a walker would be: so the cut bridges frames in which the pass missed somebody.

    Parameters
    ----------
    blobs
        Of each frame of the window.
    chains
        For each frame the chain of each of its people (`identity.linking`).
    first
        The window's first frame.
    """
    held: dict[int, Piece] = {}
    alone: list[Piece] = []
    for offset, (found, chain) in enumerate(zip(blobs, chains, strict=True)):
        for b, person in enumerate(found.person):
            if person >= 0:
                piece = held.setdefault(int(chain[person]), Piece(int(chain[person])))
            else:
                piece = Piece(0)
                alone.append(piece)
            piece.add(first + offset, b, found.ground[b])
    pieces = join([*held.values(), *alone], frame_rate, config)
    return [_supported(piece, blobs, first) for piece in pieces if _people(piece, blobs, first)]


def _people(piece: Piece, blobs: Sequence[Blobs], first: int) -> list[int]:
    """Places in the piece whose blob holds a person of the frame's pass."""
    pairs = enumerate(zip(piece.frames, piece.blobs, strict=True))
    return [k for k, (frame, blob) in pairs if blobs[frame - first].person[blob] >= 0]


def _supported(piece: Piece, blobs: Sequence[Blobs], first: int) -> Piece:
    """The piece from its first to its last frame with a person: the cut bridges what a frame's pass missed, no more."""
    held = _people(piece, blobs, first)
    kept = slice(held[0], held[-1] + 1)
    return Piece(piece.chain, piece.frames[kept], piece.blobs[kept], piece.ground[kept])


def join(pieces: list[Piece], frame_rate: float, config: IdentityConfig) -> list[Piece]:
    """Join pieces across gaps of at most `patience`, the best pairs first, until none fits."""
    patience = max(round(config.patience * frame_rate), 1)
    while True:
        cost = np.array([[gap_cost(a, b, patience, frame_rate, config) for b in pieces] for a in pieces])
        rows, columns = assign(cost.reshape(len(pieces), len(pieces)), 1.0)
        if not len(rows):
            return pieces
        best = int(cost[rows, columns].argmin())
        a, b = pieces[rows[best]], pieces[columns[best]]
        a.extend(b)
        pieces = [piece for piece in pieces if piece is not b]


def gap_cost(ended: Piece, begun: Piece, patience: int, frame_rate: float, config: IdentityConfig) -> float:
    """Cost of one body in both pieces, below 1 where a walker could be; infinite where none could.

    The squared distance between where the two would meet at constant velocity, in units of what the places are
    uncertain by and half of how far a walker comes meanwhile.
    """
    gap = begun.frames[0] - ended.frames[-1]
    apart = begun.ground[0] - ended.ground[-1]
    stride = config.walking_speed * gap / frame_rate
    linked_apart = ended.chain and begun.chain and ended.chain != begun.chain
    if linked_apart or not 0 < gap <= patience + 1 or np.hypot(*apart) > stride + config.slack:
        return np.inf
    miss = apart - 0.5 * gap * (ended.velocity(True) + begun.velocity(False))
    return float((np.hypot(*miss) / (config.slack + 0.5 * stride)) ** 2)
