"""Provisional identities of a live run: run-wide names for the tracks of segments, and what is decided again.

They follow the stitching of segments (`stseg.tracking.segment_stitching`) as far as it is known by now; the run file
decides encounters and gaps again with the whole run (`stseg.trajectories.final_tracks`). Every few seconds the
identities of the latest minutes are decided as those of a whole run are (`stseg.identities.association`), under the ids
that were published; where an id holds another person, its rows are corrected.
"""

from collections.abc import Callable, Container, Iterator
from itertools import pairwise

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config
from stseg.identities.association import IdentityProblem, associate_globally
from stseg.records.border import Border
from stseg.records.tables import APPEARANCE, CORRECTION, TRAJECTORY
from stseg.tracking.row_groups import rows_of_tracks
from stseg.tracking.segment_stitching import matches
from stseg.trajectories.final_tracks import bridged_rows


class LiveCorrections:
    """Corrections of the ids of a live run, in the order of time."""

    def __init__(self, frame_rate: float, border: Border, config: Config) -> None:
        self._rate, self._border, self._config = frame_rate, border, config
        self._rows, self._appearance = np.zeros(0, TRAJECTORY), np.zeros(0, APPEARANCE)
        self._due = 0

    def decide(self, rows: Rows, appearance: Rows, new_id: Callable[[], int]) -> Rows:
        """The CORRECTION rows (k,) that the next rows bring.

        TRAJECTORY rows (n,) are committed under live ids, APPEARANCE rows (l,) are what the detections look like;
        `new_id` gives a new live id.
        """
        live = self._config.live
        if not len(rows) or live.correction_interval == 0:
            return np.zeros(0, CORRECTION)
        decided = int(rows["frame"].max())
        since = decided - round(live.correction_memory * self._rate)
        self._rows = _after(since, np.concatenate([self._rows, rows]))
        self._appearance = _after(since, np.concatenate([self._appearance, appearance]))
        if decided < self._due:
            return np.zeros(0, CORRECTION)
        self._due = decided + round(live.correction_interval * self._rate)
        found = self._decided_again(decided, new_id)
        self._rows = corrected_ids(self._rows, found)
        return found

    def _decided_again(self, decided: int, new_id: Callable[[], int]) -> Rows:
        bridged = bridged_rows(self._rows, self._rate, self._config.tracking)
        problem = IdentityProblem.of(bridged, (self._appearance,), self._rate, self._border, self._config)
        linked = associate_globally(bridged, problem)
        identity = linked.identity[: len(self._rows)]
        last_id = int(bridged["id"].max())
        issued = {number: new_id() for number in np.unique(identity[identity > last_id]).tolist()}
        named = np.array([issued.get(number, number) for number in identity.tolist()], np.int64)
        found = [(decided, *one) for one in _differences(self._rows, named)]
        return np.array(found, CORRECTION)


def corrected_ids(rows: Rows, corrections: Rows) -> Rows:
    """TRAJECTORY rows under corrected ids: those of one decision hold at once, and one decision after another."""
    named = rows.copy()
    for decided in np.unique(corrections["decision_frame"]).tolist():
        before = named["id"].copy()
        for one in corrections[corrections["decision_frame"] == decided]:
            chosen = (before == one["id"]) & (rows["frame"] >= one["first"]) & (rows["frame"] <= one["last"])
            named["id"][chosen] = one["corrected_id"]
    return named


def renamed(names: dict[int, int], corrections: Rows, present: Container[int]) -> dict[int, int]:
    """Ids of tracks that go on after the CORRECTION rows (k,) of a decision, from the names before.

    A lost track, which is none of those present in the latest rows, is left out where its id is taken.
    """
    now = {int(one["id"]): int(one["corrected_id"]) for one in corrections if one["last"] == one["decision_frame"]}
    found = {track: now.get(name, name) for track, name in names.items()}
    present_names = {name for track, name in found.items() if track in present}
    return {track: name for track, name in found.items() if track in present or name not in present_names}


def _after(since: int, rows: Rows) -> Rows:
    return np.asarray(rows[rows["frame"] > since])


def _differences(rows: Rows, identity: Ints) -> Iterator[tuple[int, int, int, int]]:
    """First and last frame in which an id holds another person, the id, and the id of that person.

    A difference that lasts to the last row of an id lasts to the last frame of all: the id may go on.
    """
    end = int(rows["frame"].max())
    for index in rows_of_tracks(rows["id"]):
        ordered = index[np.argsort(rows["frame"][index], kind="stable")]
        frame, name, published = rows["frame"][ordered], identity[ordered], int(rows["id"][index[0]])
        edges = [0, *(np.flatnonzero(np.diff(name)) + 1).tolist(), len(index)]
        for first, stop in pairwise(edges):
            if name[first] != published:
                last = end if stop == len(index) else int(frame[stop]) - 1
                yield int(frame[first]), last, published, int(name[first])


Names = dict[int, int]
"""Track of a segment to track of the run."""


class LiveIds:
    """The names given so far, with the TRAJECTORY rows (n,) that have them, and what was corrected in these.

    Rows of the latest `kept` frames are kept for stitching.
    """

    def __init__(self, rows: Rows, corrections: Rows, kept: int) -> None:
        self._kept = kept
        self._issued = max(
            int(ids.max(initial=0)) for ids in (rows["id"], corrections["id"], corrections["corrected_id"])
        )
        self._recent = self._last(corrected_ids(rows, corrections))

    def begin(self, lead: Rows) -> Names:
        """Names for a new segment, from the TRAJECTORY rows of its warm-up."""
        if not len(lead):
            return {}
        recent = self._recent
        return matches(recent[recent["frame"] >= lead["frame"].min()], lead)

    def named(self, rows: Rows, names: Names) -> Rows:
        """Rows of a segment under names of the run; `names` gains one for each new track, and for one of two alike."""
        used = set[int]()
        for track in np.unique(rows["id"]).tolist():
            if track not in names or names[track] in used:
                names[track] = self.new_id()
            used.add(names[track])
        named = rows.copy()
        named["id"] = [names[track] for track in rows["id"].tolist()]
        self._recent = self._last(np.concatenate([self._recent, named]))
        return named

    def new_id(self) -> int:
        """A name that was never given."""
        self._issued += 1
        return self._issued

    def correct(self, corrections: Rows) -> None:
        """Take CORRECTION rows into account."""
        self._recent = corrected_ids(self._recent, corrections)

    def _last(self, rows: Rows) -> Rows:
        return np.asarray(rows[rows["frame"] > rows["frame"].max(initial=0) - self._kept])
