"""Stitching: tracks of one segment of a recording become those of the next (docs/how-it-works.md, Tracks).

A segment processes the last frames of the one before as its warm-up, so both have tracks there. A track takes the name
of the earlier track with the same place in most of those frames, one to one; unmatched tracks are born or die at the
boundary. Encounters near a boundary are decided again by global association. All tracks end at a gap of the recording
that is longer than patience.
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Labels, Rows, ground_of
from stseg.geometry.distances import distances
from stseg.records.tables import EVENT, TRAJECTORY
from stseg.tracking.filter.assignment import assign

_EventRow = tuple[int, bytes, int, int, bytes]
"""A row of EVENT."""
_SAME_PLACE_DISTANCE = 0.35
"""Greatest distance between two segments' places of one person, metres."""


@dataclass(frozen=True)
class SegmentTracks:
    """The tracks of one segment, under its own names."""

    first: int
    """First frame that the segment commits."""
    trajectory: Rows
    """TRAJECTORY (n,): includes its warm-up, the frames before `first`."""
    events: Rows
    """EVENT (m,): of the frames that it commits."""
    gap: int = 0
    """Frames before `first` that no camera has; 0 where the segment continues the one before."""


@dataclass(frozen=True)
class StitchedTracks:
    """The tracks of one segment, under names of the run."""

    committed: Rows
    """TRAJECTORY (n,): without its warm-up."""
    events: Rows
    """EVENT (m,): with those of the boundary before it."""
    names: Ints
    """int64 (track,): the run's name of each, by its name in the segment."""


class Stitcher:
    """Stitches segments in their order; `patience` is the longest undetected interval of a track, frames."""

    def __init__(self, patience: int = 0) -> None:
        self.issued, self.patience = 0, patience
        self._latest: list[StitchedTracks] = []

    def add(self, part: SegmentTracks) -> StitchedTracks:
        """Stitch the next segment to those before."""
        lead = part.trajectory[part.trajectory["frame"] < part.first]
        rows = part.trajectory[part.trajectory["frame"] >= part.first]
        local = np.unique(np.concatenate([rows["id"], part.events["id"], part.events["other"]]))
        local = local[local > 0]
        before = self._tail(lead)
        named = matches(before, lead)
        births = [
            (int(rows["frame"][rows["id"] == i].min()), int(i))
            for i in np.unique(lead["id"])
            if i not in named and (rows["id"] == i).any()
        ]
        for i in local.tolist():
            if i not in named:
                self.issued += 1
                named[i] = self.issued
        names = np.zeros(int(local.max(initial=0)) + 1, np.int64)
        names[local] = [named[i] for i in local.tolist()]
        committed, events = rows.copy(), part.events.copy()
        committed["id"] = names[rows["id"]]
        events["id"], events["other"] = names[events["id"]], names[events["other"]]
        reason = b"nobody known was near, where a segment begins"
        added = [(frame, b"birth", names[i], 0, reason) for frame, i in births]
        added += self._deaths(before, set(committed["id"].tolist()))
        if part.gap:
            added += self._ended(part)
        events = np.concatenate([events, np.array(added, EVENT)])
        stitched = StitchedTracks(committed, events[np.argsort(events["frame"], kind="stable")], names)
        self._latest = [*self._latest[-1:], stitched]
        return stitched

    def _tail(self, lead: Rows) -> Rows:
        """Rows of the earlier segments in the frames of a warm-up."""
        if not self._latest or not len(lead):
            return np.zeros(0, TRAJECTORY)
        rows = self._latest[-1].committed
        return np.asarray(rows[rows["frame"] >= lead["frame"].min()])

    def _ended(self, part: SegmentTracks) -> list[_EventRow]:
        """Deaths of the tracks that were alive when the gap before a segment began."""
        rows = np.concatenate([one.committed for one in self._latest] or [part.trajectory[:0]])
        alive = rows[rows["frame"] >= part.first - part.gap - self.patience - 1]
        events = np.concatenate([one.events for one in self._latest] or [part.events[:0]])
        reason = f"gap: no camera has any of the {part.gap} frames before frame {part.first}"
        return _deaths(alive, _dead(events), reason)

    def _deaths(self, before: Rows, living: set[int]) -> list[_EventRow]:
        """Deaths at the boundary: tracks that no track of the segment continues and that have no death event yet."""
        if not len(before):
            return []
        over = living | _dead(self._latest[-1].events)
        return _deaths(before, over, "not found again where a segment ends")


def _dead(events: Rows) -> set[int]:
    return set(events["id"][events["kind"] == b"death"].tolist())


def _deaths(rows: Rows, others: set[int], reason: str) -> list[_EventRow]:
    """A death event at the last row of each track but those in `others`."""
    gone = sorted(set(rows["id"].tolist()) - others)
    return [(int(rows["frame"][rows["id"] == i].max()), b"death", i, 0, reason.encode()) for i in gone]


def renamed_labels(label: Labels, names: Ints, identity: Ints) -> Labels:
    """The labels of a frame, int32 (plane, y, x), as identities of the run; dropped tracks become background.

    `names` int64 (n,) are those of the frame's tracks in the segment, and `identity` int64 (n,) those in the run, 0 for
    a dropped track.
    """
    identity_of = np.zeros(max(int(label.max(initial=0)), int(names.max(initial=0))) + 1, np.int32)
    identity_of[names] = identity
    return identity_of[label]


def matches(before: Rows, lead: Rows) -> dict[int, int]:
    """The earlier track with the same place, for each matched track of a warm-up."""
    earlier, later = np.unique(before["id"]), np.unique(lead["id"])
    shared = np.zeros((len(earlier), len(later)))
    for frame in np.intersect1d(before["frame"], lead["frame"]).tolist():
        a, b = before[before["frame"] == frame], lead[lead["frame"] == frame]
        matched = distances(ground_of(a), ground_of(b)) < _SAME_PLACE_DISTANCE
        rows, columns = np.nonzero(matched)
        shared[earlier.searchsorted(a["id"][rows]), later.searchsorted(b["id"][columns])] += 1
    a, b = assign(np.where(shared > 0, -shared, np.inf), 0.0)
    return dict(zip(later[b].tolist(), earlier[a].tolist(), strict=True))
