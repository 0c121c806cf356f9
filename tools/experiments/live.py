"""What corrections of live ids bring: ids as published, with all corrections, and as the run file has them.

    python tools/experiment.py live RUN.h5 TRUTH.csv [RUN.h5 TRUTH.csv ...]

The committed rows of each run are published again, two seconds at a time, as `stseg run --follow` does.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.evaluation import evaluate
from stseg.io.config_file import parse_config
from stseg.io.runfile.runs import Run, read_run
from stseg.io.track_csv import read_tracks_csv
from stseg.records.border import Border
from stseg.records.tables import CORRECTION, TRAJECTORY
from stseg.trajectories.live_corrections import LiveCorrections, corrected, renamed

_WINDOW = 2.0
"""Seconds."""


@dataclass(frozen=True)
class Published:
    """Rows TRAJECTORY (n,) as published, CORRECTION (k,), and CPU seconds that these took."""

    rows: Rows
    corrections: Rows
    seconds: float


def published(run: Run) -> Published:
    """A run's committed rows under live ids."""
    rate, config = run.frame_rate, parse_config(run.provenance.config, f"{run.path}: the configuration")
    live, fresh = LiveCorrections(rate, Border.of(run.recording.rig), config), count(1).__next__
    step, names, seconds = max(1, round(_WINDOW * rate)), dict[int, int](), 0.0
    rows, corrections = [np.zeros(0, TRAJECTORY)], [np.zeros(0, CORRECTION)]
    for first in range(0, int(run.committed["frame"].max()) + 1, step):
        own, looks = (part[part["frame"] // step == first // step] for part in (run.committed, run.appearance))
        tracks, own = np.unique(own["id"]).tolist(), own.copy()
        for track in tracks:
            if track not in names or names[track] in [names[one] for one in tracks if one < track]:
                names[track] = fresh()
        own["id"] = [names[track] for track in own["id"].tolist()]
        rows.append(own)
        start = time.process_time()
        corrections.append(live.decide(own, looks, fresh))
        seconds += time.process_time() - start
        names = renamed(names, corrections[-1], tracks)
    return Published(np.concatenate(rows), np.concatenate(corrections), seconds)


def main() -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", metavar="RUN TRUTH")
    asked = parser.parse_args()
    print(
        "| run | published | corrected | run file | corrections | CPU ms a row |\n| --- | --- | --- | --- | --: | --: |"
    )
    for path, truth in zip(asked.files[::2], asked.files[1::2], strict=True):
        run, true = read_run(path), read_tracks_csv(truth)
        true = true[true["frame"] <= run.frames[-1]]
        sent, flagged = published(run), "flag" in (true.dtype.names or ())
        shown = (sent.rows, corrected(sent.rows, sent.corrections), run.trajectory)
        found = [evaluate(true, rows, frames=np.unique(true["frame"]), ignore_flagged=flagged) for rows in shown]
        cells = " | ".join(f"{one.idf1:.1f}, {one.switches}" for one in found)
        print(f"| {path.stem} | {cells} | {len(sent.corrections)} | {1000 * sent.seconds / len(sent.rows):.2f} |")
