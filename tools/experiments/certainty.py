"""How far the cells of a run can be believed: of cells said to be filled with 0.8, do bodies fill 80 %?

    python tools/experiment.py certainty RUN.h5=TRUTH.csv... [--step 8]

Truth is that of `stseg simulate`, with heights. A cell is filled where the pillar of somebody of the truth covers it.
Cells count that are in doubt: within 1 m of a track, or of log-odds within 6 nats; every eighth frame, between those
that the run's own calibration is learned from.

    log-odds    as the volume has them: evidence, with a half beforehand beside people
    calibrated  `Run.read_cell_probability`: the same by the share that the run's own tracks fill

ECE is the expected calibration error: the mean over these cells of |stated - filled| of their bin of a tenth; the
logarithmic score is the mean of -log of the probability stated of what is true, nats.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.special import expit, logit

from stseg.arrays import Flags, Floats
from stseg.io.runfile.runs import Run, read_run
from stseg.records.cell_reliability import doubtful_cells, filled_cells

BINS = 10
_SUREST = 1e-6
"""Probabilities nearer to 0 or 1 than this are taken for this by the score."""


class Tally:
    """Stated and occupied cells by bins of the stated probability."""

    def __init__(self) -> None:
        self.cells, self.stated, self.occupied = np.zeros((3, BINS))
        self.score = 0.0

    def add(self, log_odds: Floats, truth: Flags) -> None:
        """Count cells (n,)."""
        stated = expit(log_odds)
        row = np.minimum((stated * BINS).astype(int), BINS - 1)
        self.cells += np.bincount(row, minlength=BINS)
        self.stated += np.bincount(row, stated, BINS)
        self.occupied += np.bincount(row, truth, BINS)
        self.score += float(np.logaddexp(0.0, np.where(truth, -log_odds, log_odds)).sum())

    def table(self) -> Floats:
        """Mean stated probability, and the share that is occupied, of each bin, float64 (2, bin); nan where empty."""
        count = np.where(self.cells > 0, self.cells, np.nan)
        return np.stack([self.stated, self.occupied]) / count

    def error(self) -> float:
        """Expected calibration error."""
        return float(np.abs(self.stated - self.occupied).sum() / self.cells.sum())


def measure(run: Run, truth_path: Path, step: int) -> dict[str, Tally]:
    """Both forms of one run."""
    truth = np.genfromtxt(truth_path, delimiter=",", names=True)
    grid, tallies = run.recording.rig.grid, {"log-odds": Tally(), "calibrated": Tally()}
    for frame in run.frames[step // 2 :: step].tolist():
        log_odds, _ = run.read_frame(frame)
        doubt = doubtful_cells(grid, log_odds, run.trajectory[run.trajectory["frame"] == frame])
        filled = filled_cells(grid, truth[truth["frame"] == frame])[doubt]
        probability = np.clip(run.read_cell_probability(frame)[doubt].astype(float), _SUREST, 1 - _SUREST)
        tallies["log-odds"].add(log_odds[doubt].astype(float), filled)
        tallies["calibrated"].add(logit(probability), filled)
    return tallies


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", metavar="RUN.h5=TRUTH.csv")
    parser.add_argument("--step", type=int, default=8, help="frames from one that is measured to the next")
    asked = parser.parse_args()
    print(f"{'share filled, by tenths of the stated probability':>94}")
    for run, _, truth in (pair.partition("=") for pair in asked.runs):
        for form, tally in measure(read_run(Path(run)), Path(truth), asked.step).items():
            shares = " ".join("   -" if np.isnan(share) else f"{share:4.2f}" for share in tally.table()[1])
            score = tally.score / tally.cells.sum()
            print(f"{Path(run).stem:12} {form:10} ECE {tally.error():5.3f}  score {score:5.3f}  {shares}", flush=True)
