"""Mean and spread of the scores of perturbed runs: area, grid, cameras and boxes perturbed (tools/measure.py).

    python tools/experiment.py perturbed --sets laboratory,cmc2 [--runs 8] [--jobs 2] [--set stage.key=value]...

Crowds are chaotic: one run says little.
"""

from collections.abc import Sequence

import numpy as np
from measure import final_rows, prepare, scored, tracked
from result_sets import SETS
from workbench import Bench, command_line, commit, in_processes, write_table

from stseg.io.config_file import read_config

SCORES = ("moda", "idf1", "mota", "switches")


def run(name: str, bench: Bench, settings: Sequence[str], seed: int) -> list[float]:
    """SCORES of one perturbed run."""
    one = SETS[name]
    scores = scored(one, bench, final_rows(tracked(one, bench, read_config(None, list(settings)), seed)))
    return [float(getattr(scores, score) or 0.0) for score in SCORES]


def main() -> None:
    """Measure, a line for each set."""
    parser = command_line(__doc__, runs=8, jobs=2)
    parser.add_argument("--sets", default="laboratory,cmc1,cmc2,cmc2_fairmot_features,wildtrack,uu4,easy,dense4")
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="stage.key=value")
    asked = parser.parse_args()
    bench = Bench.of(asked)
    rows = []
    for name in asked.sets.split(","):
        prepare(SETS[name], bench)
        tasks = [(name, bench, asked.settings, seed) for seed in range(1, asked.runs + 1)]
        found = np.array(list(in_processes(run, tasks, asked.jobs)))
        mean, spread = found.mean(0), found.std(0, ddof=1) if asked.runs > 1 else np.zeros(len(SCORES))
        rows.append([name, asked.runs, *(f"{m:.1f} ± {s:.1f}" for m, s in zip(mean, spread, strict=True)), commit()])
        print(", ".join(map(str, rows[-1])), flush=True)
        write_table(asked.output / "perturbed.csv", [["set", "runs", *SCORES, "commit"], *rows])
