"""Truth and tracks side by side, frame by frame, without those who are not to be judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.errors import FormatError
from stseg.evaluation.matching import distances, match

Area = tuple[float, float, float, float]
"""Lower x, lower y, upper x, upper y of a ground rectangle, metres; its edges belong to it."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One judged frame.

    Attributes
    ----------
    person : int64 (n,)
        People of the truth, numbered from 0 over the sequence.
    track : int64 (m,)
        Tracks present, numbered likewise.
    distance : float64 (n, m)
        Metres between them.
    """

    person: Ints
    track: Ints
    distance: Floats


@dataclass(frozen=True, slots=True)
class Sequence:
    """All judged frames, in order; a frame may be empty.

    Attributes
    ----------
    frames
        One entry for each frame of the list, found or not.
    person_frames : int64 (people,)
        In how many frames each person is judged; never 0.
    track_frames : int64 (tracks,)
        The same for tracks.
    """

    frames: tuple[Frame, ...]
    person_frames: Ints
    track_frames: Ints

    @property
    def people(self) -> int:
        """Number of people."""
        return len(self.person_frames)

    @property
    def tracks(self) -> int:
        """Number of tracks."""
        return len(self.track_frames)

    @property
    def truths(self) -> int:
        """Number of rows of the truth, over all frames."""
        return int(self.person_frames.sum())

    @property
    def detections(self) -> int:
        """Number of rows of the tracks, over all frames."""
        return int(self.track_frames.sum())


def line_up(
    truth: Rows,
    trajectory: Rows,
    gate: float,
    area: Area | None = None,
    frames: Ints | None = None,
    ignore_flagged: bool = False,
) -> Sequence:
    """Bring truth and tracks together and leave out who is not to be judged.

    Nobody cares about people outside `area`, nor about flagged rows where `ignore_flagged` says so: they leave with the
    track matched to them. Tracks outside leave too, unless they match a person inside. The frames are those of the
    truth or of `frames`, never those of the tracks: a frame in which nothing was found counts.

    Parameters
    ----------
    truth, trajectory
        Tables with the columns frame, id, x, y; the truth may have a column flag.
    gate
        Metres within which a track matches a person.
    area, frames, ignore_flagged
        See `stseg.evaluation.evaluate`.

    Raises
    ------
    FormatError
        Where a position is not finite or an id occurs twice in a frame.
    """
    _check(truth, "truth")
    _check(trajectory, "tracks")
    numbers = np.unique(truth["frame"] if frames is None else frames)
    truth, trajectory = _rows_of(truth, numbers), _rows_of(trajectory, numbers)
    cared, judged = _inside(truth, area), _inside(trajectory, area)
    if ignore_flagged and "flag" in (truth.dtype.names or ()):
        cared &= truth["flag"] == 0
    person_ground, track_ground = _ground(truth), _ground(trajectory)
    apart = []
    for people, tracks in zip(_runs(truth, numbers), _runs(trajectory, numbers), strict=True):
        distance = distances(person_ground[people], track_ground[tracks])
        if not (cared[people].all() and judged[tracks].all()):
            rows, columns = match(distance, gate)
            judged[tracks][columns] = cared[people][rows]
            distance = distance[np.ix_(cared[people], judged[tracks])]
        apart.append(distance)
    return _number(apart, truth["id"][cared], trajectory["id"][judged])


def _number(apart: list[Floats], person_id: Ints, track_id: Ints) -> Sequence:
    """Number people and tracks from 0 and cut the columns of ids into frames."""
    _, person, person_frames = np.unique(person_id, return_inverse=True, return_counts=True)
    _, track, track_frames = np.unique(track_id, return_inverse=True, return_counts=True)
    sizes = np.array([distance.shape for distance in apart], np.int64).reshape(-1, 2)
    bounds = np.vstack([[0, 0], sizes.cumsum(axis=0)]).tolist()
    frames = tuple(
        Frame(person[p0:p1], track[t0:t1], distance)
        for distance, (p0, t0), (p1, t1) in zip(apart, bounds[:-1], bounds[1:], strict=True)
    )
    return Sequence(frames, person_frames, track_frames)


def _check(rows: Rows, name: str) -> None:
    lost = ~np.isfinite(_ground(rows)).all(axis=1)
    if lost.any():
        row = rows[lost][0]
        raise FormatError(name, f"frame {row['frame']}, id {row['id']}", "a position that is not finite", "metres")
    order = np.lexsort((rows["id"], rows["frame"]))
    frame, identity = rows["frame"][order], rows["id"][order]
    twice = np.flatnonzero((frame[1:] == frame[:-1]) & (identity[1:] == identity[:-1]))
    if len(twice):
        raise FormatError(name, f"frame {frame[twice[0]]}", f"id {identity[twice[0]]} twice", "an id once a frame")


def _rows_of(rows: Rows, numbers: Ints) -> Rows:
    """The rows of the listed frames by frame; within a frame they keep their order, which decides between ties."""
    rows = rows[np.isin(rows["frame"], numbers)]
    return rows[np.argsort(rows["frame"], kind="stable")]


def _runs(rows: Rows, numbers: Ints) -> list[slice]:
    """Where each listed frame lies in the sorted rows."""
    starts = np.searchsorted(rows["frame"], numbers, side="left").tolist()
    stops = np.searchsorted(rows["frame"], numbers, side="right").tolist()
    return [slice(start, stop) for start, stop in zip(starts, stops, strict=True)]


def _ground(rows: Rows) -> Floats:
    return np.stack([rows["x"], rows["y"]], axis=-1)


def _inside(rows: Rows, area: Area | None) -> Flags:
    if area is None:
        return np.ones(len(rows), bool)
    x, y = rows["x"], rows["y"]
    return np.asarray((x >= area[0]) & (y >= area[1]) & (x <= area[2]) & (y <= area[3]))
