"""What a window decides better than its frames, and what is left for it to decide.

    python tools/experiment.py window gain [--views 2,3,4] [--people 3,8] [--seeds 1,2] [--seconds 6] [--kinds holes]
    python tools/experiment.py window fates RUN.h5 TRUTH.csv [--gate 0.5] [--area=x0,y0,x1,y1]

gain    MODA of `frames`, of `cut`, and their difference on simulated crowds with errors of middle strength
fates   rows of the truth that a run misses, by the place of the miss in the person's track, and by the best rejected
        candidate within the gate (/ghosts): none, or its evidence in nats; and as many candidates near nobody missed

A person who is missed where no candidate stands cannot be found by any decision over candidates. Where rejected
candidates of missed people have no more evidence than those near nobody, no threshold tells them apart.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from experiments.points import matched
from experiments.spoil import EXACT, Shown, crowd
from stseg import Tracker
from stseg.arrays import Flags, Floats, Rows
from stseg.evaluation import evaluate
from stseg.io.runfile.runs import read_run
from stseg.io.track_csv import read_tracks_csv
from stseg.simulation import Spoil
from stseg.simulation.spoiling.spoil import STRENGTHS
from stseg.simulation.spoiling.spoiled_boxes import BOX_KINDS
from stseg.simulation.spoiling.spoiled_masks import MASK_KINDS

EVIDENCE = (-10.0, -5.0, 0.0)
"""Bounds of the classes of a rejected candidate's evidence, nats."""
APART = 0.5
"""A candidate nearer than this to a track is the track's own body, metres."""


def moda(shown: Shown, kind: str, tracker: str) -> float:
    """MODA of a tracker on a crowd with errors of middle strength, percent."""
    tracking, results = Tracker(shown.rig, tracker=tracker), []
    spoils = [] if kind == EXACT else [Spoil(kind, STRENGTHS[kind][1])]
    for views in shown.spoiled(spoils, kind in BOX_KINDS):
        results += tracking.add(views)
    results += tracking.finish()
    rows = tracking.tracks(results).trajectory
    found = evaluate(shown.truth, rows, frames=np.arange(len(shown.frames))).moda
    assert found is not None
    return found


def gain(asked: argparse.Namespace) -> None:
    """Print a row for each error and number of views; means over seeds and crowds."""
    print("| error | views | frames | cut | gain |\n| --- | --: | --: | --: | --: |")
    gains = []
    for views in asked.views:
        shown = [crowd(people, views, asked.seconds, seed) for people in asked.people for seed in asked.seeds]
        for kind in asked.kinds:
            frames, cut = (np.mean([moda(one, kind, tracker) for one in shown]) for tracker in ("frames", "cut"))
            gains.append(cut - frames)
            print(f"| {kind} | {views} | {frames:.1f} | {cut:.1f} | {cut - frames:+.1f} |", flush=True)
    print(f"| mean | | | | {np.mean(gains):+.2f} |")


def place_in_track(frame: int, found: Floats) -> str:
    """Where a miss lies among the frames in which its person is found."""
    if not len(found):
        return "never found"
    return "before" if frame < found.min() else "after" if frame > found.max() else "between"


def rejected(ghosts: Rows, tracks: Rows) -> Rows:
    """Candidates of a frame that stand apart from its tracks."""
    away = np.hypot(ghosts["x"][:, None] - tracks["x"], ghosts["y"][:, None] - tracks["y"])
    return np.asarray(ghosts[away.min(1, initial=np.inf) >= APART])


def evidence_class(evidence: float) -> str:
    """Name of a class of evidence."""
    bounds = ["", *(f"{bound:g}" for bound in EVIDENCE), ""]
    k = int(np.searchsorted(EVIDENCE, evidence))
    return f"{bounds[k]} .. {bounds[k + 1]}".strip()


def fates(asked: argparse.Namespace) -> None:
    """Print counts of misses by their place in the track and by candidates, and of candidates near nobody missed."""
    run, truth = read_run(asked.run), read_tracks_csv(asked.truth)
    truth = truth[np.isin(truth["frame"], run.frames)]
    if asked.area:
        x0, y0, x1, y1 = asked.area
        truth = truth[(truth["x"] >= x0) & (truth["x"] <= x1) & (truth["y"] >= y0) & (truth["y"] <= y1)]
    rows, ghosts = run.trajectory, run.ghosts
    seen: Flags = matched(truth, rows, asked.gate)
    missed, idle = Counter[tuple[str, str]](), Counter[str]()
    for frame in np.unique(truth["frame"]).tolist():
        candidates = rejected(ghosts[ghosts["frame"] == frame], rows[rows["frame"] == frame])
        free = np.ones(len(candidates), bool)
        for k in np.flatnonzero(~seen & (truth["frame"] == frame)).tolist():
            near = np.hypot(candidates["x"] - truth["x"][k], candidates["y"] - truth["y"][k]) < asked.gate
            best = evidence_class(candidates["evidence"][near].max()) if near.any() else "no candidate"
            missed[place_in_track(frame, truth["frame"][seen & (truth["id"] == truth["id"][k])]), best] += 1
            free &= ~near
        idle.update(map(evidence_class, candidates["evidence"][free].tolist()))
    columns = ["no candidate", *(evidence_class(bound) for bound in (*EVIDENCE, np.inf))]
    places = ("between", "before", "after", "never found")
    print(f"{len(truth)} rows of the truth, {sum(missed.values())} missed; evidence of the best candidate near, nats\n")
    print(f"| | {' | '.join(columns)} |\n| --- |{' --: |' * len(columns)}")
    for place in places:
        print(f"| missed {place} | {' | '.join(str(missed[place, column]) for column in columns)} |")
    print(f"| near nobody missed | - | {' | '.join(str(idle[column]) for column in columns[1:])} |")


def main() -> None:
    """Do what the first word says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("gain")
    for name, default in (("--views", "2,3,4"), ("--people", "3,8"), ("--seeds", "1,2")):
        one.add_argument(name, type=lambda text: [int(n) for n in text.split(",")], default=default)
    one.add_argument("--seconds", type=float, default=6.0)
    one.add_argument("--kinds", type=lambda text: text.split(","), default=[EXACT, *MASK_KINDS, *BOX_KINDS])
    one.set_defaults(measure=gain)
    one = commands.add_parser("fates")
    one.add_argument("run", type=Path)
    one.add_argument("truth", type=Path)
    one.add_argument("--gate", type=float, default=0.5)
    one.add_argument("--area", type=lambda text: [float(n) for n in text.split(",")])
    one.set_defaults(measure=fates)
    asked = parser.parse_args()
    asked.measure(asked)
