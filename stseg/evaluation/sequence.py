"""Truth and tracks aligned by frame, without ignored rows; assignment of people to tracks in one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.errors import FormatError

_PAIR = 1e3  # reward of a pair, metres: more than the distances of a whole frame
_CONTINUATION_REWARD = 1e6  # reward of a continued pair, metres: more than all pairs of a frame


def similarity(distance: Floats, radius: float) -> Floats:
    """1 for the same place, falling to 0 at `radius` metres and beyond; the shape of `distance`."""
    return np.maximum(0.0, 1.0 - distance / radius)


def match(distance: Floats, gate: float, kept: Flags | None = None) -> tuple[Ints, Ints]:
    """Assign people to tracks.

    Maximises the number of continued pairs, then the number of pairs, then minimises the sum of distances.

    Parameters
    ----------
    distance : float64 (n, m)
        Metres between person and track.
    gate
        Metres; no pair is farther apart.
    kept : bool (n, m), optional
        Pairs that continue while they are within the gate, at most one a row and column.

    Returns
    -------
    int64 (k,), int64 (k,)
        Rows and columns of the pairs, rows ascending.
    """
    within_gate = distance <= gate
    gain = np.where(within_gate, _PAIR + gate - distance, 0.0)
    if kept is not None:
        gain += np.where(within_gate & kept, _CONTINUATION_REWARD, 0.0)
    rows, columns = linear_sum_assignment(-gain)
    paired = within_gate[rows, columns]
    return np.asarray(rows[paired], np.int64), np.asarray(columns[paired], np.int64)


Area = tuple[float, float, float, float]
"""Lower x, lower y, upper x, upper y of a ground rectangle, metres; its edges belong to it."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One evaluated frame."""

    person: Ints
    """int64 (n,): people of the truth, numbered from 0 over the sequence."""
    track: Ints
    """int64 (m,): tracks present, numbered likewise."""
    distance: Floats
    """float64 (n, m): metres between them."""


@dataclass(frozen=True, slots=True)
class Sequence:
    """All evaluated frames, in order; a frame may be empty."""

    frames: tuple[Frame, ...]
    """One entry for each frame of the list, with or without tracks."""
    person_frames: Ints
    """int64 (people,): number of evaluated frames of each person, above 0."""
    track_frames: Ints
    """int64 (tracks,): the same for tracks."""

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


def align_frames(
    truth: Rows,
    trajectory: Rows,
    gate: float,
    area: Area | None = None,
    frames: Ints | None = None,
    ignore_flagged: bool = False,
) -> Sequence:
    """Align truth and tracks by frame and remove ignored rows.

    People outside `area`, and flagged rows with `ignore_flagged`, are removed with the track matched to them. Tracks
    outside are removed too, unless they match a person inside. The frames are those of the truth or of `frames`, never
    those of the tracks: a frame without detections counts.

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
    require_rows(truth, "truth")
    require_rows(trajectory, "tracks")
    numbers = np.unique(truth["frame"] if frames is None else frames)
    truth, trajectory = _rows_of(truth, numbers), _rows_of(trajectory, numbers)
    relevant, evaluated = _inside(truth, area), _inside(trajectory, area)
    if ignore_flagged and "flag" in (truth.dtype.names or ()):
        relevant &= truth["flag"] == 0
    person_ground, track_ground = _ground(truth), _ground(trajectory)
    distance_of_frames = []
    for people, tracks in zip(_runs(truth, numbers), _runs(trajectory, numbers), strict=True):
        distance = _distances(person_ground[people], track_ground[tracks])
        if not (relevant[people].all() and evaluated[tracks].all()):
            rows, columns = match(distance, gate)
            evaluated[tracks][columns] = relevant[people][rows]
            distance = distance[np.ix_(relevant[people], evaluated[tracks])]
        distance_of_frames.append(distance)
    return _number(distance_of_frames, truth["id"][relevant], trajectory["id"][evaluated])


def _number(distance_of_frames: list[Floats], person_id: Ints, track_id: Ints) -> Sequence:
    """Number people and tracks from 0 and cut the columns of ids into frames."""
    _, person, person_frames = np.unique(person_id, return_inverse=True, return_counts=True)
    _, track, track_frames = np.unique(track_id, return_inverse=True, return_counts=True)
    sizes = np.array([distance.shape for distance in distance_of_frames], np.int64).reshape(-1, 2)
    bounds = np.vstack([[0, 0], sizes.cumsum(axis=0)]).tolist()
    frames = tuple(
        Frame(person[p0:p1], track[t0:t1], distance)
        for distance, (p0, t0), (p1, t1) in zip(distance_of_frames, bounds[:-1], bounds[1:], strict=True)
    )
    return Sequence(frames, person_frames, track_frames)


def require_rows(rows: Rows, name: str) -> None:
    """Raise FormatError where a position is not finite or an id occurs twice in a frame."""
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
    """Rows of the listed frames, sorted by frame; the order within a frame is kept, as it decides ties."""
    rows = rows[np.isin(rows["frame"], numbers)]
    return rows[np.argsort(rows["frame"], kind="stable")]


def _runs(rows: Rows, numbers: Ints) -> list[slice]:
    """Slice of each listed frame in the sorted rows."""
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


def _distances(person_ground: Floats, track_ground: Floats) -> Floats:
    """Metres between every person (n, 2) and every track (m, 2), (n, m); a judge shares no code with what it judges."""
    distance = person_ground[:, None] - track_ground[None]
    return np.hypot(distance[..., 0], distance[..., 1])
