"""Who is who over the whole recording: pieces of windows become tracks (METHODS 5).

Each piece of a window takes the identity that the earlier window gave to the same cells on the frames that both solved:
a one-to-one assignment by shared ground mass. A piece that no earlier track claims may be somebody who was unseen for a
moment; else somebody new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Ints, Labels
from stseg.config import TrackingConfig
from stseg.model.blobs import Blobs
from stseg.tracking.assignment import assign
from stseg.tracking.encounters import touches
from stseg.tracking.tracklets import Tracklet
from stseg.tracking.windows import Window


@dataclass
class ActiveTrack:
    """A track that may still go on: its identity and its latest piece."""

    identity: int
    tail: Tracklet


@dataclass(frozen=True)
class WindowAssignment:
    """Identities of one window.

    Attributes
    ----------
    identity : list of int64 (blob,)
        For each frame of the window the track of each blob.
    events
        (frame, kind, id, other, reason) of the frames that the window commits.
    """

    identity: list[Ints]
    events: list[tuple[int, str, int, int, str]]


@dataclass
class TrackAssociation:
    """The state that is carried from window to window."""

    frame_rate: float
    config: TrackingConfig
    alive: list[ActiveTrack] = field(default_factory=list)
    issued: int = 0
    shared_cells: dict[int, Labels] = field(default_factory=dict)

    def decide(self, window: Window, blobs: Sequence[Blobs], pieces: Sequence[Tracklet]) -> WindowAssignment:
        """Give every piece of a window its identity, and note what happened.

        Parameters
        ----------
        blobs
            Of each frame of the window's solve range.
        pieces
            Of the window, `identity.pieces.chain_pieces`.
        """
        names = self._names(window, blobs, pieces)
        identity = [np.zeros(len(found.person), np.int64) for found in blobs]
        for piece, name in zip(pieces, names, strict=True):
            for frame, blob in zip(piece.frames, piece.blobs, strict=True):
                identity[frame - window.solve_first][blob] = name
        events = self._births_and_deaths(window, pieces, names)
        kept = slice(window.commit_first - window.solve_first, window.commit_stop - window.solve_first)
        events += touches(window.commit_first, blobs[kept], identity[kept])
        self.shared_cells = {
            window.solve_first + k: np.append(0, identity[k])[found.cells].astype(np.int32)
            for k, found in enumerate(blobs)
            if window.solve_first + k >= window.commit_stop - (window.solve_stop - window.commit_stop)
        }
        return WindowAssignment(identity, sorted(events))

    def _names(self, window: Window, blobs: Sequence[Blobs], pieces: Sequence[Tracklet]) -> list[int]:
        names = [0] * len(pieces)
        known = [track.identity for track in self.alive]
        shared = np.zeros((len(known), len(pieces)))
        for p, piece in enumerate(pieces):
            for frame, blob in zip(piece.frames, piece.blobs, strict=True):
                if frame in self.shared_cells:
                    inside = blobs[frame - window.solve_first].cells == blob + 1
                    owners, counts = np.unique(self.shared_cells[frame][inside], return_counts=True)
                    for owner, count in zip(owners, counts, strict=True):
                        if owner in known:
                            shared[known.index(int(owner)), p] += count
        for k, p in zip(*assign(np.where(shared > 0, -shared, np.inf), 0.0), strict=True):
            names[p] = known[k]
        self._follow(names, pieces)
        for p in range(len(pieces)):
            if not names[p]:
                self.issued += 1
                names[p] = self.issued
        return names

    def _follow(self, names: list[int], pieces: Sequence[Tracklet]) -> None:
        """Give unnamed pieces to living tracks that nobody claims and that are of the same chain."""
        lost = {track.tail.chain: track.identity for track in self.alive if track.identity not in names}
        for p, piece in enumerate(pieces):
            if not names[p] and piece.chain in lost:
                names[p] = lost.pop(piece.chain)

    def _births_and_deaths(
        self, window: Window, pieces: Sequence[Tracklet], names: Sequence[int]
    ) -> list[tuple[int, str, int, int, str]]:
        """Carry the living tracks on to the window's commit range, with events for those that begin or end."""
        events: list[tuple[int, str, int, int, str]] = []
        known = {track.identity: track for track in self.alive}
        for piece, name in zip(pieces, names, strict=True):
            kept = _within(piece, window.commit_first, window.commit_stop)
            if not kept.frames:
                continue
            if name in known:
                gap = kept.frames[0] - known[name].tail.frames[-1] - 1
                if gap > 0:
                    events.append((kept.frames[0], "hand-over", name, 0, f"found again after {gap} unseen frames"))
                known[name].tail.extend(kept)
            else:
                known[name] = ActiveTrack(name, kept)
                events.append((kept.frames[0], "birth", name, 0, "nobody known was near"))
        patience = max(round(self.config.patience * self.frame_rate), 1)
        self.alive = []
        for track in known.values():
            if window.commit_stop - track.tail.frames[-1] > patience + 1:
                events.append((track.tail.frames[-1], "death", track.identity, 0, f"unseen for over {patience} frames"))
            else:
                track.tail = _within(track.tail, track.tail.frames[-1] - 8, track.tail.frames[-1] + 1)
                self.alive.append(track)
        return events


def _within(piece: Tracklet, first: int, stop: int) -> Tracklet:
    """The part of a piece in frames first .. stop - 1."""
    kept = [k for k, frame in enumerate(piece.frames) if first <= frame < stop]
    return Tracklet(
        piece.chain, [piece.frames[k] for k in kept], [piece.blobs[k] for k in kept], [piece.ground[k] for k in kept]
    )
