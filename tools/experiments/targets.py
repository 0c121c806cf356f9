"""Scores on the recordings for which least scores are promised: wide, small and spoiled bodies, and few cameras.

    python tools/experiment.py targets [--only REGEX] [--frames 250]

WORK holds uu4.toml, cmc2.csv and cmc2_fairmot.toml, as tools/results.py leaves them.
Recordings are cut to so many frames; a target is judged by the mean of its recordings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from workbench import command_line, write_table

from experiments.target_trials import Recorded, Trial, trials
from stseg import Tracker
from stseg.arrays import Rows
from stseg.evaluation import evaluate


@dataclass(frozen=True)
class Row:
    """One recording's scores, percent."""

    trial: Trial
    moda: float
    idf1: float

    @property
    def cells(self) -> list[str]:
        """Of the table."""
        return [self.trial.target, self.trial.name, f"{self.moda:.1f} / {self.idf1:.1f}"]


def measured(trial: Trial, frames: int) -> Row:
    """Track and score one recording."""
    made = trial.make(frames)
    flagged = "flag" in (made.truth.dtype.names or ())
    shown = np.arange(len(made.frames))
    found = evaluate(made.truth, tracked(made), area=made.area, frames=shown, ignore_flagged=flagged)
    return Row(trial, np.nan if found.moda is None else found.moda, found.idf1)


def tracked(made: Recorded) -> Rows:
    """Trajectory of the default tracker."""
    tracker, results = Tracker(made.rig, empty=made.empty), []
    for views in made.frames:
        results += tracker.add(views)
    return tracker.tracks(results + tracker.finish()).trajectory


def means(rows: Sequence[Row]) -> list[list[str]]:
    """What is asked of each target, its mean and its least."""
    table = [["target", "asked", "mean", "least"]]
    for target in dict.fromkeys(row.trial.target for row in rows):
        own = np.array([(row.moda, row.idf1) for row in rows if row.trial.target == target])
        asked = next(row.trial.least for row in rows if row.trial.target == target)
        wanted = " / ".join(f"{score:g}" if score else "-" for score in asked)
        table.append([target, wanted, *(f"{moda:.1f} / {idf1:.1f}" for moda, idf1 in (own.mean(0), own.min(0)))])
    return table


def main() -> None:
    """Write the tables, after each recording."""
    parser = command_line(__doc__)
    parser.add_argument("--only", default=".", help="of the recordings' names")
    parser.add_argument("--frames", type=int, default=250)
    asked = parser.parse_args()
    rows: list[Row] = []
    for trial in trials(asked.data, asked.work):
        if re.search(asked.only, trial.name):
            rows.append(measured(trial, asked.frames))
            print(*rows[-1].cells, flush=True)
            write_table(asked.output / "targets.csv", means(rows))
            recordings = [["target", "recording", "MODA / IDF1"], *(row.cells for row in rows)]
            write_table(asked.output / "target_recordings.csv", recordings)


if __name__ == "__main__":
    main()
