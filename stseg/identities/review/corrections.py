"""Corrections of identities: answers as hard constraints on the links between pieces of tracks.

Every answer cuts the tracks that it names at its frame. Between two pieces of one track there is a link, unless an
answer removes it; a swap crosses the links of two tracks, a join adds one. Pieces that links connect are one identity.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.errors import InputError

ACTIONS = ("keep", "swap", "join", "split", "delete", "name")


@dataclass(frozen=True)
class Answer:
    """One answer about the tracks of a run; ids and frames are those of that run."""

    place: str
    """Where it stands, for errors."""
    action: str
    """keep: nothing changes. swap: from `frame` on, `track` and `other` exchange identities. join: `other` continues
    `track`. split: from `frame` on, `track` is another person. delete: `track` is no person (from `frame` on, where one
    is given). name: the person is called `name`."""
    track: int
    """Track id; 0 for none."""
    other: int = 0
    """Track id; 0 for none."""
    frame: int | None = None
    """None for the whole track."""
    name: str = ""


@dataclass(frozen=True)
class Corrections:
    """New identities of the pieces of all tracks, by track, then start."""

    track: Ints
    """int64 (n,): the run's id of each piece."""
    start: Ints
    """int64 (n,): first frame of each piece."""
    identity: Ints
    """int64 (n,): corrected id of each piece, 0 where deleted."""
    names: dict[int, str]
    """Names by corrected id."""

    def map(self, track: Ints, frame: Ints) -> Ints:
        """Corrected ids of rows, int64 (n,); ids of no track (0, for background) stay."""
        span = int(max(frame.max(initial=0), self.start.max(initial=0))) + 2
        key = self.track * span + np.clip(self.start, 0, None)
        index = np.searchsorted(key, track * span + frame, "right") - 1
        in_piece = (index >= 0) & (self.track[index] == track) if len(key) else np.zeros(len(track), bool)
        return np.where(in_piece, self.identity[index] if len(key) else 0, track)


def solve_corrections(tracks: Rows, answers: Sequence[Answer]) -> Corrections:
    """Identities under the answers, in any order, about TRACK (n,) of a run.

    InputError for an answer that names no such track or frame, or that contradicts another.
    """
    last = {int(row["id"]): int(row["last"]) for row in tracks}
    first = {int(row["id"]): int(row["first"]) for row in tracks}
    for answer in answers:
        _check(answer, first, last)
    cuts = {identity: {start} for identity, start in first.items()}
    for answer in answers:
        if answer.frame is not None and answer.action in ("swap", "split", "delete"):
            for identity in (answer.track, answer.other) if answer.action == "swap" else (answer.track,):
                cuts[identity].add(max(answer.frame, first[identity]))
    pieces = [(identity, start) for identity in sorted(cuts) for start in sorted(cuts[identity])]
    following = {a: b for a, b in pairwise(pieces) if a[0] == b[0]}
    deleted, wanted = _apply(answers, pieces, following, first, last)
    return _identities(pieces, following, deleted, wanted, answers, last)


Piece = tuple[int, int]
"""Track and first frame."""


def _check(answer: Answer, first: dict[int, int], last: dict[int, int]) -> None:
    tracks = {"id": answer.track} | ({"other": answer.other} if answer.action in ("swap", "join") else {})
    for column, identity in tracks.items():
        if identity not in first:
            raise InputError(answer.place, column, identity or "nothing", "a track of the run")
    if answer.action in ("swap", "split") and answer.frame is None:
        raise InputError(answer.place, "frame", "nothing", f"the frame of the {answer.action}")
    if answer.frame is not None and not any(first[k] <= answer.frame <= last[k] for k in tracks.values()):
        raise InputError(answer.place, "frame", answer.frame, f"a frame of track {answer.track}")
    if answer.action in ("swap", "join") and answer.track == answer.other:
        raise InputError(answer.place, "other", answer.other, "another track")


def _apply(
    answers: Sequence[Answer],
    pieces: Sequence[Piece],
    following: dict[Piece, Piece],
    first: dict[int, int],
    last: dict[int, int],
) -> tuple[set[Piece], dict[Piece, int]]:
    """Change the links by the answers; returns the deleted pieces, and ids that swaps hand to beginnings of chains."""
    deleted, wanted = set[Piece](), dict[Piece, int]()
    before = {b: a for a, b in following.items()}
    for answer in sorted(answers, key=lambda one: (one.frame is not None, one.frame or 0)):
        at = answer.frame if answer.frame is not None else -1
        if answer.action == "swap":
            ends = [(one, max(at, first[one])) for one in (answer.track, answer.other)]
            heads = [before.get(end) for end in ends]
            for head, end in zip(heads, reversed(ends), strict=True):
                if head is not None:
                    following[head] = end
                else:
                    wanted[end] = answer.other if end[0] == answer.track else answer.track
            for end, head in zip(ends, reversed(heads), strict=True):
                before.pop(end, None)
                before |= {} if head is None else {end: head}
        elif answer.action == "split":
            end = (answer.track, max(at, first[answer.track]))
            if (head := before.pop(end, None)) is not None:
                following.pop(head)
        elif answer.action == "join":
            early, late = sorted((answer.track, answer.other), key=lambda one: last[one])
            if first[late] <= last[early]:
                found = f"tracks {early} and {late}, both there in frame {first[late]}"
                raise InputError(answer.place, "join", found, "tracks one after the other")
            head, end = [one for one in pieces if one[0] == early][-1], (late, first[late])
            if head in following or end in before:
                raise InputError(answer.place, "join", "a track that is joined already", "each end joined once")
            following[head], before[end] = end, head
        elif answer.action == "delete":
            deleted |= {one for one in pieces if one[0] == answer.track and one[1] >= at}
    return deleted, wanted


def _identities(
    pieces: Sequence[Piece],
    following: dict[Piece, Piece],
    deleted: set[Piece],
    wanted: dict[Piece, int],
    answers: Sequence[Answer],
    last: dict[int, int],
) -> Corrections:
    """Ids of chains of pieces: that of the first piece, a new one where it is taken."""
    identity: dict[Piece, int] = {}
    free, used = max(last, default=0) + 1, set[int]()
    followers = set(following.values())
    for piece in sorted((one for one in pieces if one not in followers), key=lambda one: (one[1], one[0])):
        number = wanted.get(piece, piece[0])
        number = number if number not in used else free
        free += number == free
        used.add(number)
        step: Piece | None = piece
        while step is not None:
            identity[step] = 0 if step in deleted else number
            step = following.get(step)
    names = {
        identity[next(one for one in pieces if one[0] == answer.track)]: answer.name
        for answer in answers
        if answer.action == "name"
    }
    track, start = np.array(pieces, np.int64).reshape(-1, 2).T
    return Corrections(track, start, np.array([identity[one] for one in pieces], np.int64), names)
