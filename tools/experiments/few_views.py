"""Two and three views of everything: scores, and how many of its points the run itself takes for wrong.

    python tools/experiment.py few_views [--only REGEX] [--runs 4] [--frames 60] [--choices 6] [--jobs 2]

By choices of two and three of a recording's cameras, each perturbed some times (tools/measure.py): mean MODA / IDF1 and
the standard deviation of one choice's runs, percent; the choice with the least mean; the share of points that are
wrong, nobody within 0.5 m, percent; and the share that the run states itself, by the score and the views of each point.
Everybody counts, also people that the chosen cameras cannot see: in `wildtrack` most. Of a rig with many cameras some
choices are tried, evenly among all.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from measure import final_rows, prepare, scored, scored_area, tracked
from result_sets import SETS, ResultSet
from workbench import Bench, command_line, commit, in_processes, write_table

from stseg.arrays import Floats
from stseg.config import Config
from stseg.io.recording.rigs import read_recording
from stseg.records.point_probability import point_probability

_VIEWS = (2, 3)
_SCORES = "mean", "deviation", "least", "least by cameras", "wrong points", "stated"
_HEAD = "recording", "views", "choices", "runs", *_SCORES, "commit"
Cameras = tuple[int, ...]


def recordings(frames: int) -> dict[str, ResultSet]:
    """The recordings by name, their first frames."""
    found = {name: SETS[name] for name in ("uu4", "cmc2", "cmc2_fairmot", "wildtrack")}
    for name, kind in (("easy", "masks"), ("easy", "boxes"), ("dense4", "masks")):
        found[f"{name}, {kind}"] = replace(SETS[name], rig=f"$WORK/{name}/rig_{kind}.toml")
    return {name: replace(one, frames=f"0:{frames}") for name, one in found.items()}


def choices(cameras: int, number: int, most: int) -> list[Cameras]:
    """Choices of a number of cameras, `most` at most, evenly among all in their order."""
    every = list(combinations(range(cameras), number))
    return [every[k] for k in np.unique(np.linspace(0, len(every) - 1, min(most, len(every))).astype(int))]


def run(one: ResultSet, bench: Bench, cameras: Cameras, seed: int) -> list[float]:
    """MODA, IDF1, and the shares of points that are wrong, and that are stated to be, percent, of a perturbed run."""
    rows = final_rows(tracked(one, bench, Config(), seed, cameras))
    scores = scored(one, bench, rows)
    recording = read_recording(bench.path(one.rig))
    x0, y0, x1, y1 = scored_area(one, recording.rig)
    rows = rows[(rows["x"] >= x0) & (rows["x"] <= x1) & (rows["y"] >= y0) & (rows["y"] <= y1)]
    right = 100.0 if scores.precision is None else scores.precision
    probability = point_probability(rows, [source.source.kind for source in recording.sources])
    return [scores.moda or 0.0, scores.idf1, 100.0 - right, 100.0 * (1 - probability.mean())]


def line(name: str, chosen: Sequence[Cameras], found: Floats) -> list[object]:
    """One row of the table, of float64 (choice, run, 4)."""
    mean, spread = found.mean((0, 1)), np.sqrt(found.var(1, ddof=min(found.shape[1] - 1, 1)).mean(0))
    each = found.mean(1)
    least = int(each[:, 0].argmin())
    scores = [f"{moda:.1f} / {idf1:.1f}" for moda, idf1, *_ in (mean, spread, each[least])]
    named = "".join(str(k + 1) for k in chosen[least])
    return [name, len(chosen[0]), *found.shape[:2], *scores, named, f"{mean[2]:.1f}", f"{mean[3]:.1f}", commit()]


def main() -> None:
    """Write the table, after each line."""
    parser = command_line(__doc__, runs=4, frames=60, choices=6, jobs=2)
    parser.add_argument("--only", default=".", help="of the recordings' names")
    asked = parser.parse_args()
    bench, lines = Bench.of(asked), list[list[object]]()
    for name, one in recordings(asked.frames).items():
        if not re.search(asked.only, name):
            continue
        prepare(one, bench)
        for number in _VIEWS:
            chosen = choices(one.views, number, asked.choices)
            runs = [(one, bench, cameras, seed) for cameras in chosen for seed in range(1, asked.runs + 1)]
            found = np.array(list(in_processes(run, runs, asked.jobs)))
            lines.append(line(name, chosen, found.reshape(len(chosen), asked.runs, -1)))
            print(*lines[-1], flush=True)
            write_table(asked.output / "few_views.csv", [_HEAD, *lines])
