"""From what was committed window by window to the tracks of the whole run (METHODS 5).

committed rows -> who is who anew -> short tracks and ghosts dropped -> short gaps filled -> places smoothed
                  (relink)           (gaps)                             (gaps)              (smoothed)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config, TrackingConfig
from stseg.model.border import Border
from stseg.model.tables import EVENT
from stseg.tracking.encounters import encounters
from stseg.tracking.global_association import Link, associate_globally
from stseg.tracking.pruning import drop_ghosts, drop_short, fill_gaps
from stseg.tracking.smoother import smooth_places


@dataclass(frozen=True)
class FinalTracks:
    """The tracks of a run.

    Attributes
    ----------
    trajectory : TRAJECTORY (n,)
        Sorted by frame, then id.
    events : EVENT (m,)
        Sorted by frame.
    identity : int64 (k,)
        Identity of each committed row, 0 where its track was dropped.
    """

    trajectory: Rows
    events: Rows
    identity: Ints


def final_tracks(committed: Rows, events: Rows, frame_rate: float, border: Border, config: Config) -> FinalTracks:
    """The tracks of a run from its committed TRAJECTORY and EVENT rows."""
    relinked = associate_globally(committed, frame_rate, border, config)
    renamed = committed.copy()
    renamed["id"] = relinked.identity
    long, short = drop_short(renamed, frame_rate, config.tracking)
    kept, ghosts = drop_ghosts(long, frame_rate, config.tracking)
    identity = np.where(np.isin(relinked.identity, kept["id"]), relinked.identity, 0)
    names = _Names(committed, relinked.identity)
    met = _met(events, _Names(committed, identity), frame_rate, config.tracking)
    story = np.concatenate([_retold(events, names, relinked.links), met, short, ghosts])
    smoothed = smooth_places(fill_gaps(kept, frame_rate, config.tracking), frame_rate, config.motion)
    return FinalTracks(smoothed, story[np.argsort(story["frame"], kind="stable")], identity)


def committed_tracks(committed: Rows, events: Rows, frame_rate: float, config: TrackingConfig) -> FinalTracks:
    """The tracks of a tracker whose own word stands on who is who and where: short ones go, short gaps are filled."""
    kept, dropped = drop_short(committed, frame_rate, config)
    story = np.concatenate([events, dropped])
    identity = np.where(np.isin(committed["id"], kept["id"]), committed["id"], 0)
    return FinalTracks(fill_gaps(kept, frame_rate, config), story[np.argsort(story["frame"], kind="stable")], identity)


def _retold(events: Rows, name_at: _Names, links: Sequence[Link]) -> Rows:
    """Lives under the new identities: where a track goes on as another, nobody was born and nobody died."""
    events = events[~np.isin(events["kind"], (b"merge", b"split"))]
    told = events.copy()
    for role in ("id", "other"):
        told[role] = [name_at.name(track, frame) for track, frame in zip(events[role], events["frame"], strict=True)]
    begun = {(link.frame, link.track) for link in links}
    untrue = [
        (kind == b"birth" and (frame, track) in begun) or (kind == b"death" and name_at.last(name) > frame)
        for frame, kind, track, name in zip(
            events["frame"].tolist(), events["kind"].tolist(), events["id"].tolist(), told["id"].tolist(), strict=True
        )
    ]
    joined = [(link.frame, b"hand-over", link.identity, link.track, link.reason.encode()) for link in links]
    return np.concatenate([told[~np.array(untrue, bool)], np.array(joined, EVENT)])


def _met(events: Rows, name_at: _Names, frame_rate: float, config: TrackingConfig) -> Rows:
    """Who met whom of those who are somebody."""
    known = set(name_at.track.tolist())
    last = max(name_at.until.values(), default=-1)

    def name(track: int, frame: int) -> int:
        return name_at.name(track, frame) if track in known else 0

    return encounters(events, name, round(config.separation_time * frame_rate), frame_rate, last)


class _Names:
    """Which identity a track has when, and until when an identity is seen."""

    def __init__(self, committed: Rows, identity: Ints) -> None:
        order = np.lexsort((committed["frame"], committed["id"]))
        self.track, self.frame, self.identity = committed["id"][order], committed["frame"][order], identity[order]
        names, where = np.unique(identity, return_inverse=True)
        until = np.full(len(names), -1)
        np.maximum.at(until, where, committed["frame"])
        self.until: dict[int, int] = dict(zip(names.tolist(), until.tolist(), strict=True))

    def name(self, track: int, frame: int) -> int:
        """The identity of a track in a frame, or when it was last seen before; 0 for no track."""
        first, stop = self.track.searchsorted([track, track + 1])
        if first == stop:
            return int(track)
        row = int(self.frame[first:stop].searchsorted(frame, side="right")) - 1
        return int(self.identity[first + max(row, 0)])

    def last(self, identity: int) -> int:
        """The last frame in which an identity was seen; -1 for never."""
        return self.until.get(identity, -1)
