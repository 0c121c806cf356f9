"""Who meets whom: tracks whose cells share one piece of ground, as one merge and one split an encounter (METHODS 5).

A window tells of each stretch of its frames in which two tracks touch; so it does not matter which windows and segments
there were before. Cells of people who walk together come apart and touch again every few frames: stretches with less
than `tracking.separation_time` between them are one encounter of the whole run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.model.blobs import Blobs
from stseg.model.tables import EVENT

_KINDS = (b"merge", b"split")


def touches(first: int, blobs: Sequence[Blobs], identity: Sequence[Ints]) -> list[tuple[int, str, int, int, str]]:
    """The stretches of consecutive frames in which two tracks touch: a merge at the first, a split at the last.

    Parameters
    ----------
    first
        The frame that `blobs` and `identity` begin with.
    blobs, identity
        Of each frame; for each blob its track, 0 for none.
    """
    told: list[tuple[int, str, int, int, str]] = []
    before: set[tuple[int, int]] = set()
    for frame, (found, names) in enumerate(zip(blobs, identity, strict=True), first):
        now = _pairs(found, names)
        told += [(frame, "merge", a, b, "") for a, b in now - before]
        told += [(frame - 1, "split", a, b, "") for a, b in before - now]
        before = now
    return told + [(first + len(blobs) - 1, "split", a, b, "") for a, b in before]


def _pairs(found: Blobs, names: Ints) -> set[tuple[int, int]]:
    named = np.sort(names[found.touches], axis=1).reshape(-1, 2).tolist()
    return {(a, b) for a, b in named if 0 < a < b}


def encounters(told: Rows, name: Callable[[int, int], int], parting: int, frame_rate: float, last: int) -> Rows:
    """Encounters of the whole run, EVENT rows: a merge where two people meet and a split where they have parted.

    Parameters
    ----------
    told : EVENT (n,)
        What windows tell, `touches`, in the order of frames; rows of other kinds are passed over.
    name
        Who a track is in a frame; 0 for somebody who is nobody.
    parting
        Two who touch again after no more frames than this never parted.
    frame_rate
        Frames per second.
    last
        The run's last frame. Of those who still touch there, no split is told.
    """
    rows: list[tuple[int, bytes, int, int, str]] = []
    for (a, b), stretches in _by_pair(told, name).items():
        for begin, end in _joined(sorted(stretches), parting):
            rows.append((begin, b"merge", a, b, f"their cells touch, for {(end - begin + 1) / frame_rate:.1f} s"))
            if end < last:
                rows.append((end + 1, b"split", a, b, "their cells part"))
    return np.array(sorted(rows), EVENT)


def _by_pair(told: Rows, name: Callable[[int, int], int]) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """First and last frames of the stretches of each two people."""
    begun: dict[tuple[int, int], int] = {}
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    told = told[np.isin(told["kind"], _KINDS)]
    for frame, kind, one, other in told[["frame", "kind", "id", "other"]].tolist():
        if kind == b"merge":
            begun[one, other] = frame
        elif (one, other) in begun:
            begin = begun.pop((one, other))
            a, b = sorted((name(one, begin), name(other, begin)))
            if 0 < a < b:
                found.setdefault((a, b), []).append((begin, frame))
    return found


def _joined(stretches: Sequence[tuple[int, int]], parting: int) -> Iterator[tuple[int, int]]:
    """Stretches, with those between which nobody parted as one."""
    breaks = [k for k, (old, new) in enumerate(pairwise(stretches), 1) if new[0] - old[1] - 1 > parting]
    for start, stop in pairwise([0, *breaks, len(stretches)]):
        yield stretches[start][0], max(end for _, end in stretches[start:stop])
