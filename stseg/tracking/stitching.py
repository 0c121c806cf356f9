"""Who is who from one segment of a recording to the next (METHODS 5).

A segment looks at the last frames of the one before as its warm-up, so both have tracks there. A track takes the name
of the earlier track that it lies on in most of those frames, one to one; what nobody claims was born or has died at the
seam. Meetings near a seam are decided anew with the whole run (`identity.relink`). Over a gap, which no camera saw and
which is longer than anybody is waited for, no segment looks: all tracks end at it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Labels, Rows
from stseg.model.tables import EVENT, TRAJECTORY
from stseg.tracking.assignment import assign, distances

_Told = tuple[int, bytes, int, int, bytes]
"""A row of EVENT."""
_SAME = 0.35
"""Two segments' places of one person differ by less, metres."""


@dataclass(frozen=True)
class SegmentTracks:
    """What one segment found, under its own names.

    Attributes
    ----------
    first
        The first frame that it commits.
    trajectory : TRAJECTORY (n,)
        Also of its warm-up, the frames before `first`.
    events : EVENT (m,)
        Of the frames that it commits.
    gap
        Frames before `first` that no camera saw; 0 where it goes on from the part before.
    """

    first: int
    trajectory: Rows
    events: Rows
    gap: int = 0


@dataclass(frozen=True)
class StitchedTracks:
    """What all segments found, under names of the whole run.

    Attributes
    ----------
    committed : TRAJECTORY (n,)
    local : int64 (n,)
        The name that each row had in its segment.
    events : EVENT (m,)
    """

    committed: Rows
    local: Ints
    events: Rows


class Stitcher:
    """Joins segments in their order.

    Parameters
    ----------
    patience
        How long somebody may be unseen and still be the same, frames.
    """

    def __init__(self, patience: int = 0) -> None:
        self.issued, self.patience = 0, patience
        self._joined: list[StitchedTracks] = []

    def add(self, part: SegmentTracks) -> None:
        """The next segment."""
        lead = part.trajectory[part.trajectory["frame"] < part.first]
        rows = part.trajectory[part.trajectory["frame"] >= part.first]
        local = np.unique(np.concatenate([rows["id"], part.events["id"], part.events["other"]]))
        local = local[local > 0]
        before = self._tail(lead)
        named = matches(before, lead)
        births = [(int(rows["frame"][rows["id"] == i].min()), int(i)) for i in np.unique(lead["id"])
                  if i not in named and (rows["id"] == i).any()]  # fmt: skip
        for i in local.tolist():
            if i not in named:
                self.issued += 1
                named[i] = self.issued
        names = np.zeros(int(local.max(initial=0)) + 1, np.int64)
        names[local] = [named[i] for i in local.tolist()]
        committed, events = rows.copy(), part.events.copy()
        committed["id"] = names[rows["id"]]
        events["id"], events["other"] = names[events["id"]], names[events["other"]]
        told = [(frame, b"birth", names[i], 0, b"nobody known was near, where a segment begins") for frame, i in births]
        told += self._deaths(before, set(committed["id"].tolist()))
        if part.gap:
            told += self._ended(part)
        events = np.concatenate([events, np.array(told, EVENT)])
        self._joined.append(
            StitchedTracks(committed, rows["id"].copy(), events[np.argsort(events["frame"], kind="stable")])
        )

    def joined(self) -> StitchedTracks:
        """All segments so far."""
        parts = self._joined or [StitchedTracks(np.zeros(0, TRAJECTORY), np.zeros(0, np.int64), np.zeros(0, EVENT))]
        return StitchedTracks(
            *(np.concatenate([getattr(p, name) for p in parts]) for name in ("committed", "local", "events"))
        )

    def _tail(self, lead: Rows) -> Rows:
        """Rows of the earlier segments in the frames of a warm-up."""
        if not self._joined or not len(lead):
            return np.zeros(0, TRAJECTORY)
        rows = self._joined[-1].committed
        return np.asarray(rows[rows["frame"] >= lead["frame"].min()])

    def _ended(self, part: SegmentTracks) -> list[_Told]:
        """Tracks that were still followed when the gap before a part began."""
        rows = np.concatenate([one.committed for one in self._joined[-2:]] or [part.trajectory[:0]])
        followed = rows[rows["frame"] >= part.first - part.gap - self.patience - 1]
        said = np.concatenate([one.events for one in self._joined[-2:]] or [part.events[:0]])
        reason = f"gap: no camera has any of the {part.gap} frames before frame {part.first}"
        return _deaths(followed, _dead(said), reason)

    def _deaths(self, before: Rows, living: set[int]) -> list[_Told]:
        """Tracks of the seam that do not go on and have not been said to end."""
        if not len(before):
            return []
        over = living | _dead(self._joined[-1].events)
        return _deaths(before, over, "not found again where a segment ends")


def _dead(events: Rows) -> set[int]:
    return set(events["id"][events["kind"] == b"death"].tolist())


def _deaths(rows: Rows, others: set[int], reason: str) -> list[_Told]:
    """An event at the end of each track of these rows but for others."""
    gone = sorted(set(rows["id"].tolist()) - others)
    return [(int(rows["frame"][rows["id"] == i].max()), b"death", i, 0, reason.encode()) for i in gone]


def rename_labels(label: Labels, frames: Ints, rows: Rows, identity: Ints) -> None:
    """Give the tracks of a part of the volume their names in the run, in place; what has none becomes background.

    Parameters
    ----------
    label : int32 (time, plane, y, x)
        Names in the segment, 0 for background.
    frames : int64 (time,)
        Rising.
    rows : TRAJECTORY (n,)
        Under the names in the segment.
    identity : int64 (n,)
        What each of them is called in the run, 0 for nobody.
    """
    most = max(int(label.max(initial=0)), int(rows["id"].max(initial=0)))
    order = np.argsort(rows["frame"], kind="stable")
    bounds = rows["frame"][order].searchsorted([frames, frames + 1])
    for cells, first, stop in zip(label, *bounds, strict=True):
        own = order[first:stop]
        names = np.zeros(most + 1, np.int32)
        names[rows["id"][own]] = identity[own]
        cells[...] = names[cells]


def matches(before: Rows, lead: Rows) -> dict[int, int]:
    """The earlier track that each track of a warm-up lies on."""
    known, fresh = np.unique(before["id"]), np.unique(lead["id"])
    shared = np.zeros((len(known), len(fresh)))
    for frame in np.intersect1d(before["frame"], lead["frame"]).tolist():
        a, b = before[before["frame"] == frame], lead[lead["frame"] == frame]
        near = distances(_ground(a), _ground(b)) < _SAME
        rows, columns = np.nonzero(near)
        shared[known.searchsorted(a["id"][rows]), fresh.searchsorted(b["id"][columns])] += 1
    a, b = assign(np.where(shared > 0, -shared, np.inf), 0.0)
    return dict(zip(fresh[b].tolist(), known[a].tolist(), strict=True))


def _ground(rows: Rows) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.column_stack([rows["x"], rows["y"]])
