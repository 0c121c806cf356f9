"""Answers about the tracks of a run as constraints on its rows.

In the frame of a swap two people stand together, and their rows are just what is in doubt. So an answer about two
tracks binds the rows nearest in time in which they stand apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints, Rows
from stseg.identities.review.corrections import Answer
from stseg.identities.search.constraints import Constraints
from stseg.records.tables import ANSWER
from stseg.tracking.row_groups import EXCHANGE_DISTANCE, near_rows, rows_of_tracks

_SEARCH_TIME = 5.0
"""Longest time before and after the frame of an answer in which rows are looked for, seconds."""
_SOLITARY_TIME = 1.0
"""Time from there on in which a row apart from all others is preferred, seconds: later, others may be exchanged."""


@dataclass(frozen=True)
class AnsweredRows:
    """Constraints and deletions of rows by answers."""

    constraints: Constraints
    """Pairs of rows that are one person, or two."""
    places: list[str]
    """Where the answer of each constraint stands, for errors."""
    deleted: Flags
    """bool (row,): rows that are no person."""

    @classmethod
    def of_table(cls, table: Rows, number: int) -> AnsweredRows:
        """Constraints and deletions of so many rows by ANSWER rows."""
        deleted = np.zeros(number, bool)
        deleted[table["row"][table["people"] == 0]] = True
        bound = table[table["people"] > 0]
        found = Constraints(bound["row"], bound["other"], bound["people"] == 1)
        return cls(found, ["an answer given before"] * len(found), deleted)

    def __add__(self, more: AnsweredRows) -> AnsweredRows:
        """Both of two; rows that one of them deletes are bound by none."""
        deleted, both = self.deleted | more.deleted, self.constraints + more.constraints
        bound = ~(deleted[both.earlier] | deleted[both.later])
        places = [place for place, one in zip([*self.places, *more.places], bound, strict=True) if one]
        return AnsweredRows(both.where(bound), places, deleted)

    @property
    def table(self) -> Rows:
        """ANSWER rows that say the same."""
        gone, bound = np.flatnonzero(self.deleted), self.constraints
        table = np.zeros(len(bound) + len(gone), ANSWER)
        table["row"], table["other"] = np.append(bound.earlier, gone), np.append(bound.later, gone)
        table["people"][: len(bound)] = np.where(bound.same, 1, 2)
        return table

    @property
    def kept(self) -> tuple[Ints, Constraints]:
        """Rows that are people, int64 (k,), and the constraints on them, numbered among these."""
        place = np.where(self.deleted, -1, np.cumsum(~self.deleted) - 1)
        return np.flatnonzero(~self.deleted), self.constraints.renumbered(place)


def answered_rows(rows: Rows, answers: Sequence[Answer], frame_rate: float) -> AnsweredRows:
    """Constraints and deletions that answers demand; answers were checked by `stseg.identities.review.corrections`.

    `rows` TRAJECTORY (n,) are under the ids that the answers name, 0 for rows of no track; `frame_rate` is in frames
    per second.
    """
    tracks = RowsOfTracks(rows, frame_rate)
    same, other = dict[tuple[int, int], str](), dict[tuple[int, int], str]()
    deleted = np.zeros(len(rows), bool)
    for answer in answers:
        if answer.action == "delete":
            deleted |= (rows["id"] == answer.track) & (rows["frame"] >= (answer.frame or 0))
        one, two = tracks.pairs(answer)
        same |= dict.fromkeys(one, answer.place)
        other |= dict.fromkeys(two, answer.place)
    for pairs in (same, other):
        for pair in [pair for pair in pairs if deleted[list(pair)].any()]:
            del pairs[pair]
    return AnsweredRows(Constraints.of(list(same), list(other)), [*same.values(), *other.values()], deleted)


class RowsOfTracks:
    """Rows of each track in the order of time: TRAJECTORY (n,) under ids, 0 for none, at frames per second."""

    def __init__(self, rows: Rows, frame_rate: float) -> None:
        self.rows, self.frame_rate, self.reach = rows, frame_rate, _SEARCH_TIME * frame_rate
        order = np.argsort(rows["frame"], kind="stable")
        self.of = {int(rows["id"][index[0]]): index for index in (order[k] for k in rows_of_tracks(rows["id"][order]))}
        self.frames = {track: rows["frame"][index] for track, index in self.of.items()}
        self.is_solitary = np.ones(len(rows), bool)
        self.is_solitary[near_rows(rows, EXCHANGE_DISTANCE)[0]] = False

    def pairs(self, answer: Answer) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        """Pairs of rows that are one person by an answer, and pairs that are two."""
        track, other, frame = answer.track, answer.other, answer.frame
        if track not in self.of or (other and other not in self.of):
            return [], []
        if answer.action == "split" and frame is not None:
            return [], _known([(self.before(track, 0, frame), self.after(track, 0, frame))])
        if answer.action in ("join", "keep") and other and self.follow(track, other):
            ends = [self.ends(track, other)]
            return (ends, []) if answer.action == "join" else ([], ends)
        if answer.action in ("swap", "keep") and other and frame is not None:
            early = self.before(track, other, frame), self.before(other, track, frame)
            late = self.after(track, other, frame), self.after(other, track, frame)
            return _known(list(zip(early, late[::-1] if answer.action == "swap" else late, strict=True))), []
        return [], []

    def follow(self, track: int, other: int) -> bool:
        """Whether one of two tracks ends before the other begins."""
        early, late = self.ends(track, other)
        return bool(self.rows["frame"][early] < self.rows["frame"][late])

    def ends(self, track: int, other: int) -> tuple[int, int]:
        """Last row of the track that ends first, and first row of the other."""
        early, late = sorted((self.of[track], self.of[other]), key=lambda rows: int(self.rows["frame"][rows[-1]]))
        return int(early[-1]), int(late[0])

    def before(self, track: int, other: int, frame: int) -> int | None:
        """The last row of a track before a frame in which it is apart; None where it has none before."""
        first, stop = np.searchsorted(self.frames[track], [frame - self.reach, frame]).tolist()
        return self._first_apart(self.of[track][min(first, max(stop - 1, 0)) : stop][::-1], other)

    def after(self, track: int, other: int, frame: int) -> int | None:
        """The first row of a track from a frame on in which it is apart; None where it has none."""
        first = int(np.searchsorted(self.frames[track], frame))
        stop = int(np.searchsorted(self.frames[track], frame + self.reach, "right"))
        return self._first_apart(self.of[track][first : max(stop, first + 1)], other)

    def _first_apart(self, rows: Ints, other: int) -> int | None:
        """The first of some rows, nearest first, in which a track is apart from another; or a solitary one soon after.

        Rows within some seconds of an answer are asked; beyond, the nearest alone.
        """
        if not len(rows):
            return None
        distant = rows[self._is_apart(rows, other)]
        first = distant[0] if len(distant) else rows[0]
        passed = np.abs(self.rows["frame"][rows] - self.rows["frame"][first])
        soon = rows[
            (passed <= _SOLITARY_TIME * self.frame_rate) & (np.arange(len(rows)) >= np.flatnonzero(rows == first)[0])
        ]
        alone = soon[self.is_solitary[soon]]
        return int(alone[0] if len(alone) else first)

    def _is_apart(self, rows: Ints, other: int) -> Flags:
        """Whether a track is apart from another in each of its rows (n,); from all others for 0."""
        if not other:
            return self.is_solitary[rows]
        of_other, frame = self.of[other], self.rows["frame"]
        at = of_other[np.searchsorted(self.frames[other], frame[rows]).clip(max=len(of_other) - 1)]
        x, y = (self.rows[name][at] - self.rows[name][rows] for name in ("x", "y"))
        return np.asarray((frame[at] != frame[rows]) | (np.hypot(x, y) >= EXCHANGE_DISTANCE))


def _known(pairs: list[tuple[int | None, int | None]]) -> list[tuple[int, int]]:
    """Pairs of which both rows exist."""
    return [(one, two) for one, two in pairs if one is not None and two is not None]
