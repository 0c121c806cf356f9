"""From committed rows to the tracks of the whole run (docs/how-it-works.md, Tracks).

committed rows -> short gaps filled -> global association -> short tracks dropped -> short gaps filled, smoothed
                  (smoother)           (identities)          (pruning)               (smoother)
-> people who come back, where that is wanted
   (returned_tracks)

Global association moves no place: it decides which rows belong to one person. Gaps are filled again under identities.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows, columns, ground_of, some_columns
from stseg.bodies.pillars import BodyTable
from stseg.config import Config, TrackingConfig
from stseg.identities.association import NO_KNOWN_PEOPLE, IdentityProblem, Link, associate_globally
from stseg.identities.evidence.returns import Return
from stseg.identities.review.weighed_doubts import doubt_events
from stseg.identities.search.constraints import NO_CONSTRAINTS, Constraints
from stseg.records.border import Border
from stseg.records.tables import BOX, EVENT
from stseg.records.track_heights import heights
from stseg.tracking.windows.encounters import encounters
from stseg.trajectories.pruning import drop_short
from stseg.trajectories.returned_tracks import renamed_events, renamed_ids, renamed_trajectory, returns_of
from stseg.trajectories.smoother import apart_from, filled_gaps, interpolated_rows, smooth_places

_PLACED = columns("frame:<i8 id:<i8 x:<f8 y:<f8")
"""Columns of the rows of the problem that are still asked for once there are tracks."""
_ROWS_AT_ONCE = 8192
"""Rows of a trajectory whose boxes are made at a time."""


class AnyCommittedRows(Protocol):
    """Rows of a whole run as its tracker committed them, see `CommittedRows`; the trajectory is asked for once."""

    @property
    def trajectory(self) -> Rows: ...
    @property
    def events(self) -> Rows: ...
    @property
    def appearance_parts(self) -> Iterable[Rows]: ...
    @property
    def known_people(self) -> Rows: ...


class CommittedRows(NamedTuple):
    """The same in memory."""

    trajectory: Rows
    """TRAJECTORY (n,)."""
    events: Rows
    """EVENT (k,)."""
    appearance: Rows
    """APPEARANCE (l,): what the detections look like."""
    known_people: Rows = NO_KNOWN_PEOPLE
    """KNOWN_PERSON (m,): people of earlier recordings."""

    @property
    def appearance_parts(self) -> tuple[Rows]:
        """The whole, as one part."""
        return (self.appearance,)


@dataclass(frozen=True)
class FinalTracks:
    """The tracks of a run."""

    trajectory: Rows
    """TRAJECTORY (n,): sorted by frame, then id."""
    events: Rows
    """EVENT (m,): sorted by frame."""
    identity: Ints
    """int64 (k,): identity of each committed row, 0 where its track was dropped."""


def final_tracks(
    rows: AnyCommittedRows, frame_rate: float, border: Border, config: Config, constraints: Constraints = NO_CONSTRAINTS
) -> FinalTracks:
    """The tracks of a run from its committed rows, under constraints on those of the trajectory.

    People of earlier recordings keep their ids; all others have greater ones.
    """
    committed = rows.trajectory
    bridged, track = bridged_rows(committed, frame_rate, config.tracking), committed["id"].copy()
    del committed
    problem = IdentityProblem.of(bridged, rows.appearance_parts, frame_rate, border, config, constraints)
    linked = associate_globally(bridged, problem, constraints)
    bridged["id"] = linked.identity
    committed, named = bridged[: len(track)], linked.identity[: len(track)]
    kept, dropped = drop_short(committed, frame_rate, config.tracking)
    identity = np.where(np.isin(named, kept), named, 0)
    met = _encounters(rows.events, _Names(track, committed["frame"], identity), frame_rate, config.tracking)
    names = _Names(track, committed["frame"], named)
    renamed = _renamed(rows.events, names, linked.links)
    tracks, bridged = bridged[np.isin(bridged["id"], kept) & names.are_present(bridged)], some_columns(bridged, _PLACED)
    del committed
    tracks = filled_gaps(tracks, apart_from(interpolated_rows(tracks, frame_rate, config.tracking), tracks))
    smooth_places(tracks, frame_rate, config.motion)
    doubts = doubt_events(tracks, bridged[: len(track)], problem, constraints)
    every_event = np.concatenate([renamed, met, dropped, doubts])
    whole = FinalTracks(tracks, every_event[np.argsort(every_event["frame"], kind="stable")], identity)
    least = config.tracking.return_probability
    if least == 1:
        return whole
    whole = _with_later_ids(whole, int(rows.known_people["id"].max(initial=0)))
    returns = returns_of(problem, whole.identity, bridged["frame"], least, constraints, rows.known_people)
    return _with_returns(whole, returns, frame_rate)


def _with_later_ids(whole: FinalTracks, last_id: int) -> FinalTracks:
    """The tracks under ids greater than `last_id`."""
    trajectory, events = whole.trajectory.copy(), whole.events.copy()
    trajectory["id"] += last_id
    for role in ("id", "other"):
        events[role] += last_id * (events[role] > 0)
    return FinalTracks(trajectory, events, whole.identity + last_id * (whole.identity > 0))


def _with_returns(whole: FinalTracks, returns: Sequence[Return], frame_rate: float) -> FinalTracks:
    """The tracks under the ids of people: visits of one person have one id."""
    if not returns:
        return whole
    trajectory = renamed_trajectory(whole.trajectory, returns)
    events = renamed_events(whole.events, trajectory, returns, frame_rate)
    return FinalTracks(trajectory, events, renamed_ids(whole.identity, returns))


def bridged_rows(committed: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """Committed rows and those that fill their short gaps after them."""
    return np.concatenate([committed, interpolated_rows(committed, frame_rate, config)])


def committed_tracks(committed: Rows, events: Rows, frame_rate: float, config: TrackingConfig) -> FinalTracks:
    """The tracks of a tracker with final identities and places: short ones dropped, short gaps filled."""
    kept, dropped = drop_short(committed, frame_rate, config)
    every_event = np.concatenate([events, dropped])
    stays, order = np.isin(committed["id"], kept), np.argsort(every_event["frame"], kind="stable")
    tracks = committed[stays]
    tracks = filled_gaps(tracks, interpolated_rows(tracks, frame_rate, config))
    return FinalTracks(tracks, every_event[order], np.where(stays, committed["id"], 0))


def _renamed(events: Rows, name_at: _Names, links: Sequence[Link]) -> Rows:
    """Births, deaths and hand-overs under the final identities: a linked track has neither birth nor death there.

    A birth or death beyond the area's border is at the first or last row.
    """
    events = events[~np.isin(events["kind"], (b"merge", b"split"))]
    named = events.copy()
    for role in ("id", "other"):
        named[role] = [name_at.name(track, frame) for track, frame in zip(events[role], events["frame"], strict=True)]
    born, dead = (np.isin(named["kind"], kind) & np.isin(events["id"], name_at.track) for kind in (b"birth", b"death"))
    first, last = name_at.ends(named["id"])
    named["frame"][born] = np.maximum(named["frame"], first)[born]
    named["frame"][dead] = np.minimum(named["frame"], last)[dead]
    refuted = (born & (first < named["frame"])) | (dead & (last > named["frame"]))
    nowhere = np.isin(named["kind"], (b"birth", b"death")) & ~born & ~dead
    joined = [
        (link.frame, b"hand-over", link.identity, 0, f"goes on as {link.track} of /committed: {link.reason}".encode())
        for link in links
    ]
    passed = np.array(joined, EVENT)
    return np.concatenate([named[~(refuted | nowhere)], passed[name_at.are_present(passed)]])


def _encounters(events: Rows, name_at: _Names, frame_rate: float, config: TrackingConfig) -> Rows:
    """Encounters between retained tracks."""
    tracks = set(name_at.track.tolist())
    last = int(name_at.frame.max(initial=-1))

    def name(track: int, frame: int) -> int:
        return name_at.name(track, frame) if track in tracks else 0

    return encounters(events, name, round(config.separation_time * frame_rate), frame_rate, last)


class _Names:
    """The identity of a track in each frame, and the first and last frame of each identity."""

    def __init__(self, track: Ints, frame: Ints, identity: Ints) -> None:
        order = np.lexsort((frame, track))
        self.track, self.frame, self.identity = track[order], frame[order], identity[order]
        names, where = np.unique(identity, return_inverse=True)
        since, until = np.full(len(names), np.iinfo(np.int64).max), np.full(len(names), -1)
        np.minimum.at(since, where, frame)
        np.maximum.at(until, where, frame)
        self._ends = [dict(zip(names.tolist(), frames.tolist(), strict=True)) for frames in (since, until)]

    def ends(self, identity: Ints) -> tuple[Ints, Ints]:
        """The first and the last frame of identities (n,), int64 (n,) each; -1 for those without a row."""
        since, until = (np.array([at.get(name, -1) for name in identity.tolist()], np.int64) for at in self._ends)
        return since, until

    def are_present(self, rows: Rows) -> Flags:
        """Whether the identities of rows or events (n,) have come and not left; a gap's row may be linked to others."""
        since, until = self.ends(rows["id"])
        return np.asarray((since <= rows["frame"]) & (rows["frame"] <= until))

    def name(self, track: int, frame: int) -> int:
        """The identity of a track in a frame, or at its last row before; an unknown track keeps its number."""
        first, stop = self.track.searchsorted([track, track + 1])
        if first == stop:
            return int(track)
        row = int(self.frame[first:stop].searchsorted(frame, side="right")) - 1
        return int(self.identity[first + max(row, 0)])


def box_rows(tables: Sequence[BodyTable], trajectory: Rows) -> Rows:
    """BOX rows of a TRAJECTORY, clipped to the images; none where a view does not see the body.

    A row without a height has its track's. The rows are in the order of the trajectory, then of the views.
    """
    return np.concatenate([np.zeros(0, BOX), *box_parts(tables, trajectory)])


def box_parts(tables: Sequence[BodyTable], trajectory: Rows) -> Iterator[Rows]:
    """The same in parts: those of a day take more memory than its trajectory."""
    tall = heights(trajectory)
    for start in range(0, len(trajectory), _ROWS_AT_ONCE):
        part = slice(start, start + _ROWS_AT_ONCE)
        yield _boxes_of(tables, trajectory[part], tall[part].astype(float))


def _boxes_of(tables: Sequence[BodyTable], trajectory: Rows, tall: Floats) -> Rows:
    every_box, ground = np.zeros((len(trajectory), len(tables)), BOX), ground_of(trajectory)
    visible = np.zeros(every_box.shape, bool)
    for view, table in enumerate(tables):
        boxes, edges = every_box[:, view], table.boxes_of(ground, tall).clip(0, [*table.size, *table.size])
        visible[:, view] = (edges[:, 2:] > edges[:, :2]).all(axis=1)
        boxes["frame"], boxes["id"], boxes["view"] = trajectory["frame"], trajectory["id"], view
        boxes["left"], boxes["top"] = edges[:, :2].T
        boxes["width"], boxes["height"] = (edges[:, 2:] - edges[:, :2]).T
    return every_box[visible]
