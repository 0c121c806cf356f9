"""How far off the heights of tracks are, and how steady heights and widths are along a track.

    python tools/experiment.py sizes RUN.h5 TRUTH.csv [--frames A:B] [--gate 0.5]

Each person of the truth is matched, frame by frame, to the nearest track within the gate, one to one. Where the truth
has a column `height` (that of `stseg simulate` has), errors are found minus true, metres: of every frame by itself, and
of each person's median over the frames. The standard deviations are within a person's frames, of what each frame by
itself said.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.io.runfile.reading.run_reader import read_run
from stseg.tracking.filter.assignment import assign, distances

LEAST = 10
"""People seen in fewer frames are left out of the figures."""


def matched(trajectory: Rows, truth: Rows, gate: float) -> dict[int, tuple[Rows, Rows]]:
    """For each person of the truth the rows of the trajectory that were matched, and their own rows."""
    pairs: dict[int, tuple[list[int], list[int]]] = {}
    for frame in np.unique(truth["frame"]):
        here, there = np.flatnonzero(trajectory["frame"] == frame), np.flatnonzero(truth["frame"] == frame)
        away = distances(_ground(trajectory[here]), _ground(truth[there]))
        for a, b in zip(*assign(np.where(away < gate, away - gate, np.inf), 0.0), strict=True):
            rows, own = pairs.setdefault(int(truth["id"][there[b]]), ([], []))
            rows.append(int(here[a]))
            own.append(int(there[b]))
    return {k: (trajectory[rows], truth[own]) for k, (rows, own) in sorted(pairs.items()) if len(rows) >= LEAST}


def _ground(rows: Rows) -> Floats:
    return np.column_stack([rows["x"], rows["y"]]).astype(float)


def main() -> None:
    """Print a line for each person, then the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--frames", default="0:1000000")
    parser.add_argument("--gate", type=float, default=0.5)
    asked = parser.parse_args()
    first, stop = map(int, asked.frames.split(":"))
    truth = np.genfromtxt(asked.truth, delimiter=",", names=True)
    truth = truth[(truth["frame"] >= first) & (truth["frame"] < stop)]
    people = matched(read_run(asked.run).trajectory, truth, asked.gate)
    errors, medians, spreads = [np.zeros(0)], [], []
    for person, (rows, own) in people.items():
        height, width = rows["height"].astype(float), rows["width"].astype(float)
        spreads.append((height.std(), width.std()))
        told = ""
        if "height" in (own.dtype.names or ()):
            errors.append(height - own["height"])
            medians.append(float(np.median(height) - np.median(own["height"])))
            told = f", true {np.median(own['height']):.2f}, error {medians[-1]:+.3f}"
        print(
            f"person {person}: {len(rows)} frames, height {np.median(height):.3f} sd {height.std():.3f}{told}, "
            f"width {np.median(width):.3f} sd {width.std():.3f}"
        )
    tall, wide = np.median(np.array(spreads).reshape(-1, 2), 0)
    print(f"{len(people)} people; median sd within a person: height {tall:.3f}, width {wide:.3f}")
    if medians:
        every = np.concatenate(errors)
        print(
            f"height error of frames: mean {every.mean():+.3f}, median absolute {np.median(np.abs(every)):.3f}; "
            f"of people: median absolute {np.median(np.abs(medians)):.3f}"
        )
