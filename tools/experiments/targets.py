"""Scores on the recordings for which least scores are promised: wide, small and spoiled bodies, and few cameras.

    python tools/experiment.py targets -o build/targets.md [--data ../shared/data] [--work FOLDER]
        [--only REGEX] [--frames 250]

WORK holds uu4.toml, cmc2.csv and cmc2_fairmot.toml, as tools/results.py leaves them.
Recordings are cut to so many frames; a target is judged by the mean of its recordings.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from workbench import ROOT, commit

from experiments.target_trials import Recorded, Trial, trials
from stseg import Tracker
from stseg.arrays import Rows
from stseg.evaluation import evaluate

_PAGE = """# Targets for bodies as they come

MODA / IDF1, percent, of the default tracker on the first {frames} frames of the recordings that match `{only}`.
Made by `tools/experiment.py targets` at commit {commit}.

"""


@dataclass(frozen=True)
class Row:
    """One recording's scores, percent."""

    trial: Trial
    moda: float
    idf1: float

    def __str__(self) -> str:
        return f"| {self.trial.target} | {self.trial.name} | {self.moda:.1f} / {self.idf1:.1f} |"


def measured(trial: Trial, frames: int) -> Row:
    """Track and score one recording."""
    made = trial.make(frames)
    flagged = "flag" in (made.truth.dtype.names or ())
    shown = np.arange(len(made.frames))
    found = evaluate(made.truth, tracked(made), area=made.area, frames=shown, ignore_flagged=flagged)
    moda = np.nan if found.moda is None else found.moda
    return Row(trial, moda, found.idf1)


def tracked(made: Recorded) -> Rows:
    """Trajectory of the default tracker."""
    tracker, results = Tracker(made.rig, empty=made.empty), []
    for views in made.frames:
        results += tracker.add(views)
    return tracker.tracks(results + tracker.finish()).trajectory


def page(rows: Sequence[Row], frames: int, only: str) -> str:
    """The means of all targets, then each recording."""
    lines = ["| target | asked | mean | least |", "| --- | --- | --- | --- |"]
    for target in dict.fromkeys(row.trial.target for row in rows):
        own = np.array([(row.moda, row.idf1) for row in rows if row.trial.target == target])
        asked = next(row.trial.least for row in rows if row.trial.target == target)
        shown = [f"{moda:.1f} / {idf1:.1f}" for moda, idf1 in (own.mean(0), own.min(0))]
        wanted = " / ".join(f"{score:g}" if score else "-" for score in asked)
        lines.append(f"| {target} | {wanted} | {' | '.join(shown)} |")
    lines += ["", "| target | recording | MODA / IDF1 |", "| --- | --- | --- |", *map(str, rows)]
    return _PAGE.format(frames=frames, only=only, commit=commit()) + "\n".join(lines) + "\n"


def main() -> None:
    """Write the page, after each recording."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    parser.add_argument("--only", default=".", help="of the recordings' names")
    parser.add_argument("--frames", type=int, default=250)
    asked = parser.parse_args()
    rows: list[Row] = []
    for trial in trials(asked.data, asked.work):
        if re.search(asked.only, trial.name):
            rows.append(measured(trial, asked.frames))
            print(rows[-1], flush=True)
            asked.output.write_text(page(rows, asked.frames, asked.only), "utf-8")


if __name__ == "__main__":
    main()
