"""From committed rows to the tracks of the whole run (docs/how-it-works.md, Tracks).

committed rows -> short gaps filled -> global association -> short tracks dropped -> smoothed
                  (smoother)           (identities)          (pruning)               (smoother)
-> people who come back, where that is wanted
   (returned_tracks)

Global association moves no place: it decides which rows belong to one person, and fills gaps without other people.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.bodies.pillars import BodyTable
from stseg.config import Config, TrackingConfig
from stseg.identities.association import NO_KNOWN_PEOPLE, IdentityProblem, Link, associate_globally
from stseg.identities.evidence.returns import Return
from stseg.identities.evidence.size_model import MeasuredSizes
from stseg.identities.review.weighed_doubts import doubt_events
from stseg.identities.search.constraints import NO_CONSTRAINTS, Constraints
from stseg.records.border import Border
from stseg.records.tables import BOX, EVENT
from stseg.records.track_heights import with_heights
from stseg.tracking.windows.encounters import encounters
from stseg.trajectories.pruning import drop_short
from stseg.trajectories.returned_tracks import renamed_events, renamed_ids, renamed_trajectory, returns_of
from stseg.trajectories.smoother import fill_gaps, interpolated_rows, smooth_places


class CommittedRows(NamedTuple):
    """Rows of a whole run as its tracker committed them."""

    trajectory: Rows
    """TRAJECTORY (n,)."""
    events: Rows
    """EVENT (k,)."""
    appearance: Rows
    """APPEARANCE (l,): what the detections look like."""
    known_people: Rows = NO_KNOWN_PEOPLE
    """KNOWN_PERSON (m,): people of earlier recordings."""


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
    rows: CommittedRows, frame_rate: float, border: Border, config: Config, constraints: Constraints = NO_CONSTRAINTS
) -> FinalTracks:
    """The tracks of a run from its committed rows, under constraints on those of the trajectory.

    People of earlier recordings keep their ids; all others have greater ones.
    """
    committed = rows.trajectory
    bridged, sizes = bridged_rows(committed, frame_rate, config)
    problem = IdentityProblem.of(bridged, sizes, rows.appearance, frame_rate, border, config, constraints)
    linked = associate_globally(bridged, problem, constraints)
    bridged["id"] = linked.identity
    named = linked.identity[: len(committed)]
    kept, dropped = drop_short(bridged[: len(committed)], frame_rate, config.tracking)
    identity = np.where(np.isin(named, kept), named, 0)
    met = _encounters(rows.events, _Names(committed, identity), frame_rate, config.tracking)
    renamed = _renamed(rows.events, _Names(committed, named), linked.links)
    tracks = fill_gaps(bridged[np.isin(bridged["id"], kept)], frame_rate, config.tracking, True)
    smooth_places(tracks, frame_rate, config.motion)
    doubts = doubt_events(tracks, bridged[: len(committed)], problem, constraints)
    every_event = np.concatenate([renamed, met, dropped, doubts])
    whole = FinalTracks(tracks, every_event[np.argsort(every_event["frame"], kind="stable")], identity)
    least = config.tracking.return_probability
    if least == 1:
        return whole
    whole = _with_later_ids(whole, int(rows.known_people["id"].max(initial=0)))
    returns = returns_of(problem, whole.identity, bridged, least, constraints, rows.known_people)
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
    trajectory = renamed_trajectory(whole.trajectory, returns)
    events = renamed_events(whole.events, trajectory, returns, frame_rate)
    return FinalTracks(trajectory, events, renamed_ids(whole.identity, returns))


def bridged_rows(committed: Rows, frame_rate: float, config: Config) -> tuple[Rows, MeasuredSizes]:
    """Committed rows and those that fill their short gaps after them, with the sizes of all."""
    gaps = interpolated_rows(committed, frame_rate, config.tracking)
    sizes = MeasuredSizes.of_heights(committed["height"], config).with_unmeasured(len(gaps))
    return np.concatenate([committed, gaps]), sizes


def committed_tracks(committed: Rows, events: Rows, frame_rate: float, config: TrackingConfig) -> FinalTracks:
    """The tracks of a tracker with final identities and places: short ones dropped, short gaps filled."""
    kept, dropped = drop_short(committed, frame_rate, config)
    every_event = np.concatenate([events, dropped])
    stays, order = np.isin(committed["id"], kept), np.argsort(every_event["frame"], kind="stable")
    tracks = fill_gaps(committed[stays], frame_rate, config)
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
    first, last = (np.array([at.get(name, -1) for name in named["id"].tolist()]) for at in name_at.ends)
    named["frame"][born] = np.maximum(named["frame"], first)[born]
    named["frame"][dead] = np.minimum(named["frame"], last)[dead]
    refuted = (born & (first < named["frame"])) | (dead & (last > named["frame"]))
    nowhere = np.isin(named["kind"], (b"birth", b"death")) & ~born & ~dead
    joined = [
        (link.frame, b"hand-over", link.identity, 0, f"goes on as {link.track} of /committed: {link.reason}".encode())
        for link in links
    ]
    return np.concatenate([named[~(refuted | nowhere)], np.array(joined, EVENT)])


def _encounters(events: Rows, name_at: _Names, frame_rate: float, config: TrackingConfig) -> Rows:
    """Encounters between retained tracks."""
    tracks = set(name_at.track.tolist())
    last = int(name_at.frame.max(initial=-1))

    def name(track: int, frame: int) -> int:
        return name_at.name(track, frame) if track in tracks else 0

    return encounters(events, name, round(config.separation_time * frame_rate), frame_rate, last)


class _Names:
    """The identity of a track in each frame, and the first and last frame of each identity."""

    def __init__(self, committed: Rows, identity: Ints) -> None:
        order = np.lexsort((committed["frame"], committed["id"]))
        self.track, self.frame, self.identity = committed["id"][order], committed["frame"][order], identity[order]
        names, where = np.unique(identity, return_inverse=True)
        since, until = np.full(len(names), np.iinfo(np.int64).max), np.full(len(names), -1)
        np.minimum.at(since, where, committed["frame"])
        np.maximum.at(until, where, committed["frame"])
        self.ends = [dict(zip(names.tolist(), frames.tolist(), strict=True)) for frames in (since, until)]

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
    ground, tall = np.column_stack([trajectory["x"], trajectory["y"]]), with_heights(trajectory)["height"].astype(float)
    every_box = np.zeros((len(trajectory), len(tables)), BOX)
    visible = np.zeros(every_box.shape, bool)
    for view, table in enumerate(tables):
        edges, boxes = table.boxes_of(ground, tall).clip(0, [*table.size, *table.size]), every_box[:, view]
        visible[:, view] = (edges[:, 2:] > edges[:, :2]).all(axis=1)
        boxes["frame"], boxes["id"], boxes["view"] = trajectory["frame"], trajectory["id"], view
        boxes["left"], boxes["top"] = edges[:, :2].T
        boxes["width"], boxes["height"] = (edges[:, 2:] - edges[:, :2]).T
    return every_box[visible]
