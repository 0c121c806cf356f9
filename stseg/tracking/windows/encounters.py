"""Encounters: one merge and one split event while the blobs of two tracks share a connected piece of ground.

Each window reports its contacts, intervals of frames in which two tracks touch, so windows and segments do not matter.
Blobs of people who walk together separate and touch again every few frames: contacts with less than
`tracking.separation_time` between them are one encounter of the run (docs/how-it-works.md, Tracks).
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.records.blobs import Blobs
from stseg.records.tables import EVENT

_KINDS = (b"merge", b"split")


def touches(first: int, blobs: Sequence[Blobs], identity: Sequence[Ints]) -> list[tuple[int, str, int, int, str]]:
    """Contacts: intervals of frames in which two tracks touch, a merge at the first frame and a split at the last.

    `blobs` and `identity`, the track of each blob, 0 for none, have one element a frame; `first` is the first of these
    frames.
    """
    events: list[tuple[int, str, int, int, str]] = []
    before: set[tuple[int, int]] = set()
    for frame, (found, names) in enumerate(zip(blobs, identity, strict=True), first):
        pairs = np.sort(names[found.touches], axis=1).reshape(-1, 2).tolist()
        now = {(a, b) for a, b in pairs if 0 < a < b}
        events += [(frame, "merge", a, b, "") for a, b in now - before]
        events += [(frame - 1, "split", a, b, "") for a, b in before - now]
        before = now
    return events + [(first + len(blobs) - 1, "split", a, b, "") for a, b in before]


def encounters(contacts: Rows, name: Callable[[int, int], int], parting: int, frame_rate: float, last: int) -> Rows:
    """Encounters of the whole run, EVENT rows: a merge at the first contact and a split after the last.

    `contacts` EVENT (n,) are those of all windows, from `touches`, sorted by frame; rows of other kinds are ignored.
    `name` gives the identity of a track in a frame; 0 for a dropped track. Contacts of one pair with at most `parting`
    frames between them are one encounter. `frame_rate` is in frames per second; a contact that lasts to `last`, the
    run's last frame, has no split.
    """
    rows: list[tuple[int, bytes, int, int, str]] = []
    for (a, b), intervals in _by_pair(contacts, name).items():
        for begin, end in _joined(sorted(intervals), parting):
            rows.append((begin, b"merge", a, b, f"their cells touch, for {(end - begin + 1) / frame_rate:.1f} s"))
            if end < last:
                rows.append((end + 1, b"split", a, b, "their cells part"))
    return np.array(sorted(rows), EVENT)


def _by_pair(contacts: Rows, name: Callable[[int, int], int]) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """First and last frames of the contacts of each pair of identities."""
    begun: dict[tuple[int, int], int] = {}
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    contacts = contacts[np.isin(contacts["kind"], _KINDS)]
    for frame, kind, one, other in contacts[["frame", "kind", "id", "other"]].tolist():
        if kind == b"merge":
            begun[one, other] = frame
        elif (one, other) in begun:
            begin = begun.pop((one, other))
            a, b = sorted((name(one, begin), name(other, begin)))
            if 0 < a < b:
                found.setdefault((a, b), []).append((begin, frame))
    return found


def _joined(intervals: Sequence[tuple[int, int]], parting: int) -> Iterator[tuple[int, int]]:
    """Intervals, those with at most `parting` frames between them as one."""
    breaks = [k for k, (old, new) in enumerate(pairwise(intervals), 1) if new[0] - old[1] - 1 > parting]
    for start, stop in pairwise([0, *breaks, len(intervals)]):
        yield intervals[start][0], max(end for _, end in intervals[start:stop])
