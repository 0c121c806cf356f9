"""Identities of a whole day: processor time and memory of deciding them, over the number of rows.

    python tools/experiment.py day [--rows 1000000] [--people 6] [--colours] [--returns 0.99]

Simulated people come, meet and go; a tracker's rows of them err, lose people for seconds and exchange them where two
are near. From an eighth of these rows, a quarter, a half and all of them `final_tracks` decides identities, each time
in a process of its own: what a row takes must not grow. Linux alone tells memory this way.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from stseg.arrays import Flags, Ints, Rows
from stseg.config import Config
from stseg.geometry import Grid
from stseg.records.border import Border
from stseg.records.tables import APPEARANCE, COLOURS, EVENT, TRAJECTORY
from stseg.simulation import SceneSpec
from stseg.simulation.crowd.social_forces import walk_freely
from stseg.trajectories.final_tracks import final_tracks

_RATE, _SIDE = 5.0, 7.0
"""Frames per second; side of the area, metres."""
_PART = 50_000
"""Rows of a part that is simulated; the day consists of such parts, of new people and with other errors each."""
_NOISE, _HEIGHT = 0.05, 0.035
"""Errors of a row's place and height, metres (standard deviation)."""
_LOST, _AWAY = 90.0, 3.0
"""Mean time until a person is lost, and longest time for which, seconds."""
_NEAR, _EXCHANGED = 0.5, 0.02
"""Distance below which tracks are exchanged, metres, and probability in a frame."""
_APART = (0, 1)
"""Views in which people are apart."""
_CLOTHES, _LIGHT = 0.5, 0.2
"""Spread of colours among people, and of one person's from frame to frame, logarithms."""


@dataclass(frozen=True)
class Day:
    """What a tracker has committed: TRAJECTORY rows sorted by frame, and the true person of each, int64 (n,)."""

    rows: Rows
    person: Ints

    def first(self, share: int) -> Day:
        """The frames with the first of so many equal parts of the rows."""
        frame = self.rows["frame"]
        stop = int(np.searchsorted(frame, frame[(len(frame) - 1) // share], "right"))
        return Day(self.rows[:stop], self.person[:stop])


def main() -> None:
    """Print time and memory for each number of rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--people", type=int, default=6)
    parser.add_argument("--colours", action="store_true")
    parser.add_argument("--returns", type=float, default=1.0)
    asked = parser.parse_args()
    day = simulated_day(asked.rows, asked.people)
    for share in (8, 4, 2, 1):
        with multiprocessing.get_context("fork").Pool(1) as alone:
            print(alone.apply(measured, (day.first(share), asked.colours, asked.returns)), flush=True)


def measured(day: Day, colours: bool, least: float) -> str:
    """What deciding the identities of some rows takes, in words."""
    config = Config()
    config = replace(config, tracking=replace(config.tracking, return_probability=least))
    number, looks = len(day.rows), appearance(day) if colours else np.zeros(0, APPEARANCE)
    warm_up = day.rows[:500]
    final_tracks(warm_up, births(warm_up), looks[:0], _RATE, border(), config)
    events, before, start = births(day.rows), resident(), time.process_time()
    found = final_tracks(day.rows, events, looks, _RATE, border(), config)
    spent = time.process_time() - start
    more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before
    tracks, people = (len(np.unique(rows["id"])) for rows in (day.rows, found.trajectory))
    return (
        f"{number} rows, {tracks} tracks, {people} people: {spent:.1f} s, {1000 * spent / number:.3f} ms a row; "
        f"{more:.0f} MiB more than before, {more * 2**20 / number:.0f} bytes a row"
    )


def resident() -> float:
    """Resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def border() -> Border:
    """People come and go at the edges of the area."""
    grid = Grid((-_SIDE / 2, _SIDE / 2), (-_SIDE / 2, _SIDE / 2))
    x, y = np.meshgrid(grid.ground_x, grid.ground_y)
    return Border(_SIDE / 2 - np.maximum(np.abs(x), np.abs(y)), grid)


def births(rows: Rows) -> Rows:
    """EVENT rows: the births and deaths of tracks."""
    ids, first = np.unique(rows["id"], return_index=True)
    last = len(rows) - 1 - np.unique(rows["id"][::-1], return_index=True)[1]
    events = np.zeros(2 * len(ids), EVENT)
    events["kind"] = np.repeat([b"birth", b"death"], len(ids))
    events["id"], events["frame"] = np.tile(ids, 2), rows["frame"][np.concatenate([first, last])]
    return np.asarray(events[np.argsort(events["frame"], kind="stable")])


def appearance(day: Day) -> Rows:
    """APPEARANCE rows: colours of each row in the views that see its person apart."""
    lots = np.random.default_rng(1)
    clothes = _CLOTHES * lots.normal(size=(int(day.person.max()) + 1, COLOURS))
    looks = np.zeros((len(_APART), len(day.rows)), APPEARANCE)
    for view, own in zip(_APART, looks, strict=True):
        own["frame"], own["x"], own["y"], own["view"] = *(day.rows[n] for n in ("frame", "raw_x", "raw_y")), view
        own["features"] = np.nan
        own["colours"] = clothes[day.person] + _LIGHT * lots.normal(size=(len(own), COLOURS))
    return np.sort(looks.reshape(-1), order="frame", kind="stable")


def simulated_day(rows: int, people: int) -> Day:
    """So many rows that are committed of a day."""
    spec = SceneSpec("day", people, (_SIDE, _SIDE), 1.2 * min(rows, _PART) / people / _RATE, _RATE, stay=60.0, seed=18)
    truth = np.concatenate([crowd.truth(spec.area) for crowd in walk_freely(spec)])
    parts, tracks, number = list[Rows](), 0, 0
    persons = list[Ints]()
    while number < rows:
        track = tracks_of(truth, np.random.default_rng(len(parts)))
        seen = track > 0
        own = erring(truth[seen], np.random.default_rng((len(parts), 1)))
        own["frame"] += len(parts) * (spec.frames + round(60 * _RATE))
        own["id"] = track[seen] + tracks
        persons.append(truth["id"][seen] + len(parts) * int(truth["id"].max()))
        parts.append(own)
        tracks, number = int(own["id"].max()), number + len(own)
    return Day(np.concatenate(parts)[:rows], np.concatenate(persons)[:rows])


def erring(truth: Rows, lots: np.random.Generator) -> Rows:
    """TRAJECTORY rows of true ones, with errors."""
    rows = np.zeros(len(truth), TRAJECTORY)
    rows["frame"], rows["height"] = truth["frame"], truth["height"] + lots.normal(0, _HEIGHT, len(truth))
    for own, raw in (("x", "raw_x"), ("y", "raw_y")):
        rows[own] = rows[raw] = truth[own] + lots.normal(0, _NOISE, len(truth))
    rows["xx"] = rows["yy"] = _NOISE**2
    rows["extent"], rows["width"], rows["score"], rows["views"] = 0.3, 0.45, 5.0, 4
    return rows


def tracks_of(truth: Rows, lots: np.random.Generator) -> Ints:
    """Track of each true row, int64 (n,), 0 while its person is lost."""
    tracks, held, until = np.zeros(len(truth), np.int64), dict[int, int](), dict[int, int]()
    bounds = np.flatnonzero(np.diff(truth["frame"], prepend=-1, append=-1)).tolist()
    issued = 0
    for start, stop in pairwise(bounds):
        there, frame = truth[start:stop], int(truth["frame"][start])
        for person in there["id"].tolist():
            if person in held and lots.random() < 1 / (_LOST * _RATE):
                until[person] = frame + int(lots.integers(1, round(_AWAY * _RATE)))
                del held[person]
            if person not in held and until.get(person, 0) <= frame:
                issued += 1
                held[person] = issued
        exchange(held, there, lots)
        tracks[start:stop] = [held.get(person, 0) for person in there["id"].tolist()]
    return tracks


def exchange(held: dict[int, int], there: Rows, lots: np.random.Generator) -> None:
    """Exchange the tracks of some who are near each other."""
    away = np.hypot(there["x"][:, None] - there["x"], there["y"][:, None] - there["y"])
    near: Flags = np.triu(away < _NEAR, 1)
    for pair in np.argwhere(near):
        one, other = there["id"][pair].tolist()
        if one in held and other in held and lots.random() < _EXCHANGED:
            held[one], held[other] = held[other], held[one]
