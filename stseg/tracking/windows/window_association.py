"""Association of window tracklets with tracks (docs/how-it-works.md, Tracks).

A tracklet takes the identity that the window before gave to the same cells in the frames that both solved: a one-to-one
assignment by shared ground cells. An unassigned tracklet continues an undetected track of the same filter track, or is
a birth.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Ints, Labels
from stseg.config import TrackingConfig
from stseg.records.blobs import Blobs
from stseg.tracking.filter.assignment import assign
from stseg.tracking.windows.encounters import touches
from stseg.tracking.windows.tracklets import Tracklet
from stseg.tracking.windows.windows import Window


@dataclass
class ActiveTrack:
    """A track that may continue: its identity and the end of its latest tracklet."""

    identity: int
    tail: Tracklet


@dataclass(frozen=True)
class WindowAssignment:
    """Identities of one window."""

    identity: list[Ints]
    """list of int64 (blob,): for each frame of the window, the track of each blob."""
    events: list[tuple[int, str, int, int, str]]
    """(frame, kind, id, other, reason) of the frames that the window commits."""


@dataclass
class TrackAssociation:
    """Tracks carried from window to window."""

    frame_rate: float
    config: TrackingConfig
    active: list[ActiveTrack] = field(default_factory=list)
    issued: int = 0
    shared_cells: dict[int, Labels] = field(default_factory=dict)

    def decide(self, window: Window, blobs: Sequence[Blobs], tracklets: Sequence[Tracklet]) -> WindowAssignment:
        """Assign an identity to every tracklet of a window, with events.

        `blobs` are those of each frame of the window's solve range, `tracklets` those that `form_tracklets` made of
        them.
        """
        names = self._names(window, blobs, tracklets)
        identity = [np.zeros(len(found.person), np.int64) for found in blobs]
        for tracklet, name in zip(tracklets, names, strict=True):
            for frame, blob in zip(tracklet.frames, tracklet.blobs, strict=True):
                identity[frame - window.solve_first][blob] = name
        events = self._births_and_deaths(window, tracklets, names)
        kept = slice(window.commit_first - window.solve_first, window.commit_stop - window.solve_first)
        events += touches(window.commit_first, blobs[kept], identity[kept])
        self.shared_cells = {
            window.solve_first + k: np.append(0, identity[k])[found.cells].astype(np.int32)
            for k, found in enumerate(blobs)
            if window.solve_first + k >= window.commit_stop - (window.solve_stop - window.commit_stop)
        }
        return WindowAssignment(identity, sorted(events))

    def _names(self, window: Window, blobs: Sequence[Blobs], tracklets: Sequence[Tracklet]) -> list[int]:
        names = [0] * len(tracklets)
        tracks = [track.identity for track in self.active]
        shared = np.zeros((len(tracks), len(tracklets)))
        for p, tracklet in enumerate(tracklets):
            for frame, blob in zip(tracklet.frames, tracklet.blobs, strict=True):
                if frame in self.shared_cells:
                    inside = blobs[frame - window.solve_first].cells == blob + 1
                    owners, counts = np.unique(self.shared_cells[frame][inside], return_counts=True)
                    for owner, count in zip(owners, counts, strict=True):
                        if owner in tracks:
                            shared[tracks.index(int(owner)), p] += count
        for k, p in zip(*assign(np.where(shared > 0, -shared, np.inf), 0.0), strict=True):
            names[p] = tracks[k]
        self._follow(names, tracklets)
        for p in range(len(tracklets)):
            if not names[p]:
                self.issued += 1
                names[p] = self.issued
        return names

    def _follow(self, names: list[int], tracklets: Sequence[Tracklet]) -> None:
        """Assign unnamed tracklets to unassigned active tracks of the same filter track."""
        lost = {track.tail.filter_track: track.identity for track in self.active if track.identity not in names}
        for p, tracklet in enumerate(tracklets):
            if not names[p] and tracklet.filter_track in lost:
                names[p] = lost.pop(tracklet.filter_track)

    def _births_and_deaths(
        self, window: Window, tracklets: Sequence[Tracklet], names: Sequence[int]
    ) -> list[tuple[int, str, int, int, str]]:
        """Update active tracks by the window's commit range, with birth and death events."""
        events: list[tuple[int, str, int, int, str]] = []
        tracks = {track.identity: track for track in self.active}
        for tracklet, name in zip(tracklets, names, strict=True):
            kept = _within(tracklet, window.commit_first, window.commit_stop)
            if not kept.frames:
                continue
            if name in tracks:
                tracks[name].tail.extend(kept)
            else:
                tracks[name] = ActiveTrack(name, kept)
                events.append((kept.frames[0], "birth", name, 0, "nobody known was near"))
        patience = max(round(self.config.patience * self.frame_rate), 1)
        self.active = []
        for track in tracks.values():
            if window.commit_stop - track.tail.frames[-1] > patience + 1:
                events.append((track.tail.frames[-1], "death", track.identity, 0, f"unseen for over {patience} frames"))
            else:
                track.tail = _within(track.tail, track.tail.frames[-1] - 8, track.tail.frames[-1] + 1)
                self.active.append(track)
        return events


def _within(tracklet: Tracklet, first: int, stop: int) -> Tracklet:
    """The part of a tracklet in frames first .. stop - 1."""
    kept = slice(bisect_left(tracklet.frames, first), bisect_left(tracklet.frames, stop))
    return Tracklet(tracklet.filter_track, tracklet.frames[kept], tracklet.blobs[kept], tracklet.ground[kept])
