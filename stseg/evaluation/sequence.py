"""Truth and tracks aligned by frame, without ignored rows; assignment of people to tracks in one frame."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from stseg.arrays import Flags, Floats, Ints, Rows, ground_of
from stseg.errors import FormatError

_PAIR = 1e3  # reward of a pair, metres: more than the distances of a whole frame
_CONTINUATION_REWARD = 1e6  # reward of a continued pair, metres: more than all pairs of a frame
_CROWD = 100_000  # people times tracks of a frame from which a crowd is divided


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
    return best_pairs(gain)


def best_pairs(gain: Floats) -> tuple[Ints, Ints]:
    """Rows and columns of the pairs with the greatest sum of gains, float64 (n, m) of 0 or more; rows ascending.

    Pairs without a gain are left out. Crowds are divided where nothing links them: else time goes with their cube.
    """
    if gain.size < _CROWD or not gain.any():
        return _best_pairs_of_all(gain)
    rows, columns = np.nonzero(gain)
    links = coo_array((np.ones(len(rows)), (rows, len(gain) + columns)), shape=(sum(gain.shape),) * 2)
    group = connected_components(links, directed=False)[1][rows]
    alone = np.bincount(group, minlength=sum(gain.shape))[group] == 1
    order = np.argsort(group, kind="stable")
    order = order[~alone[order]]
    pairs = [np.stack([rows[alone], columns[alone]])]
    for one in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        row, column = np.unique(rows[one]), np.unique(columns[one])
        chosen = _best_pairs_of_all(gain[np.ix_(row, column)])
        pairs.append(np.stack([row[chosen[0]], column[chosen[1]]]))
    found = np.concatenate(pairs, axis=1)
    first, second = found[:, np.argsort(found[0])]
    return first, second


def _best_pairs_of_all(gain: Floats) -> tuple[Ints, Ints]:
    rows, columns = linear_sum_assignment(-gain)
    paired = gain[rows, columns] > 0
    return np.asarray(rows[paired], np.int64), np.asarray(columns[paired], np.int64)


Area = tuple[float, float, float, float]
"""Lower x, lower y, upper x, upper y of a ground rectangle, metres; its edges belong to it."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One evaluated frame."""

    index: int
    """Its index in the list of frames."""
    person: Ints
    """int64 (n,): people of the truth, numbered from 0 over the sequence."""
    track: Ints
    """int64 (m,): tracks present, numbered likewise."""
    person_ground: Floats
    track_ground: Floats
    """float64 (n, 2), (m, 2): metres."""
    reach: float
    """Metres: distances beyond are infinite in a crowd."""
    predicted: Flags
    """bool (m,): tracks whose place is a prediction, in a filled gap."""

    @property
    def distance(self) -> Floats:
        """Metres between them, float64 (n, m); made anew each time, since those of all frames fill gigabytes."""
        return _distances(self.person_ground, self.track_ground, self.reach)


@dataclass(frozen=True, slots=True)
class Sequence:
    """All evaluated frames, in order."""

    length: int
    """Number of frames in the list."""
    frames: tuple[Frame, ...]
    """One entry for each frame of the list that has people or tracks."""
    person_frames: Ints
    """int64 (people,): number of evaluated frames of each person, above 0."""
    track_frames: Ints
    """int64 (tracks,): the same for tracks."""
    predictions: int
    """Number of rows of the tracks that are predicted."""

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
    frames: Ints | range | None = None,
    ignore_flagged: bool = False,
) -> Sequence:
    """Align truth and tracks by frame and remove ignored rows.

    People outside `area`, and flagged rows with `ignore_flagged`, are removed with the track matched to them. Tracks
    outside are removed too, unless they match a person inside. The frames are those of the truth or of `frames`, never
    those of the tracks: a frame without detections counts.

    Parameters
    ----------
    truth, trajectory
        Tables with the columns frame, id, x, y; the truth may have a column flag. Where tracks have a column raw_x,
        nan marks predictions.
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
    listed = frames if isinstance(frames, range) else np.unique(truth["frame"] if frames is None else frames)
    (truth, person_index), (trajectory, track_index) = _listed_rows(truth, listed), _listed_rows(trajectory, listed)
    relevant, evaluated = _inside(truth, area), _inside(trajectory, area)
    if ignore_flagged and "flag" in (truth.dtype.names or ()):
        relevant &= truth["flag"] == 0
    person_ground, track_ground = ground_of(truth), ground_of(trajectory)
    present = np.union1d(person_index, track_index)
    for people, tracks in zip(_runs(person_index, present), _runs(track_index, present), strict=True):
        if not (relevant[people].all() and evaluated[tracks].all()):
            rows, columns = match(_distances(person_ground[people], track_ground[tracks], gate), gate)
            evaluated[tracks][columns] = relevant[people][rows]
    _, person, person_frames = np.unique(truth["id"][relevant], return_inverse=True, return_counts=True)
    _, track, track_frames = np.unique(trajectory["id"][evaluated], return_inverse=True, return_counts=True)
    runs = _runs(person_index[relevant], present), _runs(track_index[evaluated], present)
    has_predictions = "raw_x" in (trajectory.dtype.names or ())
    predicted = np.isnan(trajectory["raw_x"]) if has_predictions else np.zeros(len(trajectory), bool)
    person_ground, track_ground, predicted = person_ground[relevant], track_ground[evaluated], predicted[evaluated]
    evaluated_frames = tuple(
        Frame(
            index,
            person[people],
            track[tracks],
            person_ground[people],
            track_ground[tracks],
            2 * gate,
            predicted[tracks],
        )
        for index, people, tracks in zip(present.tolist(), *runs, strict=True)
    )
    return Sequence(len(listed), evaluated_frames, person_frames, track_frames, int(predicted.sum()))


def require_tables(**tables: object) -> None:
    """Raise FormatError where one is no structured array of rows on the ground."""
    for name, table in tables.items():
        if not isinstance(table, np.ndarray) or not {"frame", "id", "x", "y"} <= set(table.dtype.names or ()):
            expected = "an array with the columns frame, id, x, y, as of run.trajectory or stseg.read_tracks_csv(path)"
            raise FormatError(name, "", f"a {type(table).__name__}", expected)


def require_rows(rows: Rows, name: str) -> None:
    """Raise FormatError where a position is not finite or an id occurs twice in a frame."""
    lost = ~np.isfinite(ground_of(rows)).all(axis=1)
    if lost.any():
        row = rows[lost][0]
        raise FormatError(name, f"frame {row['frame']}, id {row['id']}", "a position that is not finite", "metres")
    order = np.lexsort((rows["id"], rows["frame"]))
    frame, identity = rows["frame"][order], rows["id"][order]
    twice = np.flatnonzero((frame[1:] == frame[:-1]) & (identity[1:] == identity[:-1]))
    if len(twice):
        raise FormatError(name, f"frame {frame[twice[0]]}", f"id {identity[twice[0]]} twice", "an id once a frame")


def _listed_rows(rows: Rows, listed: Ints | range) -> tuple[Rows, Ints]:
    """Rows of the listed frames by frame, in their order within one, as it decides ties; index of each one's frame."""
    frame: Ints = rows["frame"]
    if isinstance(listed, range):
        index = np.where((frame >= listed.start) & (frame < listed.stop), frame - listed.start, -1)
    else:
        index = np.searchsorted(listed, frame)
        index[~np.isin(frame, listed)] = -1
    order = np.argsort(index, kind="stable")
    order = order[index[order] >= 0]
    return rows[order], index[order]


def _runs(index: Ints, present: Ints) -> list[slice]:
    """Slice of each frame that is present in the sorted indices of rows."""
    starts = np.searchsorted(index, present, side="left").tolist()
    stops = np.searchsorted(index, present, side="right").tolist()
    return [slice(start, stop) for start, stop in zip(starts, stops, strict=True)]


def _inside(rows: Rows, area: Area | None) -> Flags:
    if area is None:
        return np.ones(len(rows), bool)
    x, y = rows["x"], rows["y"]
    return np.asarray((x >= area[0]) & (y >= area[1]) & (x <= area[2]) & (y <= area[3]))


def _distances(person_ground: Floats, track_ground: Floats, reach: float) -> Floats:
    """Metres between every person (n, 2) and every track (m, 2), (n, m); a judge shares no code with what it judges."""
    if len(person_ground) * len(track_ground) < _CROWD:
        distance = person_ground[:, None] - track_ground[None]
        return np.hypot(distance[..., 0], distance[..., 1])
    partners = cKDTree(person_ground).query_ball_tree(cKDTree(track_ground), reach * (1 + 1e-9))
    rows = np.repeat(np.arange(len(partners)), [len(one) for one in partners])
    columns = np.concatenate(partners).astype(np.int64)
    distance = np.full((len(person_ground), len(track_ground)), np.inf)
    distance[rows, columns] = np.hypot(*(person_ground[rows] - track_ground[columns]).T)
    return distance
