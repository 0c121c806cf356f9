"""Identities decided again, in seconds, from the rows of perturbed runs.

    python tools/experiment.py identities SET [--runs 8] [--data ../shared/data] [--work FOLDER]

The rows that the tracker commits in each run, on evidence of which 1 in 200 boxes (or frames of a view) is missing, are
made once and kept in WORK/identities; remove them after a change to detection or to the tracker. What comes after them
is done anew: global association, pruning, smoothing.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from measure import Committed, commit_rows, prepared, score
from result_sets import SETS, ResultSet
from workbench import ROOT, Bench

from stseg.config import Config
from stseg.io.recording.recording import Recording
from stseg.records.border import Border
from stseg.trajectories.final_tracks import final_tracks

_SHOWN = ("MODA", "IDF1", "IDSW")


def main() -> None:
    """Print the scores of each run, their mean and standard deviation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=list(SETS))
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    options = parser.parse_args()
    one, bench, config = SETS[options.set], Bench(options.data.resolve(), options.work.resolve()), Config()
    recording = prepared(one, bench)
    first, stop = map(int, one.frames.split(":"))
    scores = np.empty((options.runs, len(_SHOWN)))
    for seed in range(options.runs):
        rows = _kept(one, recording, bench, config, seed)
        rate, border = recording.rig.frame_rate, Border.of(recording.rig)
        tracks = final_tracks(rows.trajectory, rows.events, rows.appearance, rate, border, config)
        found = score(one, tracks.trajectory, bench, first, stop).as_dict()
        scores[seed] = np.array([found[name] for name in _SHOWN], float)
        shown = (f"{name} {value:.1f}" for name, value in zip(_SHOWN, scores[seed], strict=True))
        print(f"run {seed}:", ", ".join(shown), flush=True)
    spread = scores.std(0, ddof=1) if len(scores) > 1 else np.zeros(len(_SHOWN))
    pairs = zip(_SHOWN, scores.mean(0), spread, strict=True)
    print(", ".join(f"{name} {mean:.1f} ± {off:.1f}" for name, mean, off in pairs))


def _kept(one: ResultSet, recording: Recording, bench: Bench, config: Config, seed: int) -> Committed:
    """The rows of one run; made where they are not there yet."""
    path = bench.work / "identities" / f"{one.name}_{seed}.npz"
    if not path.exists():
        first, stop = map(int, one.frames.split(":"))
        rows = commit_rows(recording, first, stop, "cut", config, seed)
        path.parent.mkdir(exist_ok=True)
        np.savez(path, trajectory=rows.trajectory, events=rows.events, appearance=rows.appearance)
    with np.load(path) as kept:
        return Committed(kept["trajectory"], kept["events"], kept["appearance"])


if __name__ == "__main__":
    main()
