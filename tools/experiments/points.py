"""Calibration of the probability of track points: of points stated with 0.8, do 80 % stand on a person?

    python tools/experiment.py points RUN.h5 TRUTH.csv [--gate 0.5] [--area=x0,y0,x1,y1]

The score of a row of the trajectory is the log-odds that it is a person. A point is right if it is matched, one to one
in its frame, to a person of the truth within the gate. ECE is the expected calibration error over ten bins.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from experiments.certainty import Tally
from stseg.arrays import Flags, Rows
from stseg.io.runfile.runs import read_run
from stseg.io.track_csv import read_tracks_csv


def matched(found: Rows, truth: Rows, gate: float) -> Flags:
    """Rows that are matched to a person of their frame, bool (n,)."""
    right = np.zeros(len(found), bool)
    for frame in np.unique(found["frame"]):
        own, people = np.flatnonzero(found["frame"] == frame), truth[truth["frame"] == frame]
        away = np.hypot(people["x"][:, None] - found["x"][own], people["y"][:, None] - found["y"][own])
        i, j = linear_sum_assignment(np.where(away < gate, away, 1e3))
        right[own[j[away[i, j] < gate]]] = True
    return right


def main() -> None:
    """Print the error and the share of right points of each bin."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--gate", type=float, default=0.5)
    parser.add_argument("--area", type=lambda text: [float(n) for n in text.split(",")])
    asked = parser.parse_args()
    found, truth = read_run(asked.run).trajectory, read_tracks_csv(asked.truth)
    found = found[np.isin(found["frame"], truth["frame"])]
    if asked.area:
        x0, y0, x1, y1 = asked.area
        found = found[(found["x"] >= x0) & (found["x"] <= x1) & (found["y"] >= y0) & (found["y"] <= y1)]
    tally = Tally()
    tally.add(found["score"].astype(float), matched(found, truth, asked.gate))
    shares = " ".join("   -" if np.isnan(share) else f"{share:4.2f}" for share in tally.table()[1])
    print(f"{len(found)} points, ECE {tally.error():.4f}; right, by tenths of the stated probability: {shares}")
