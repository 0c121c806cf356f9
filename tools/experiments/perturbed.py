"""Mean and spread of the scores of perturbed runs: area, grid, cameras and boxes perturbed (tools/measure.py).

    python tools/experiment.py perturbed --sets laboratory,cmc2 [--runs 8] [--jobs 2] [--set stage.key=value]...

Crowds are chaotic: one run says little.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from measure import final_rows, prepare, scored, tracked
from result_sets import SETS
from workbench import Bench, command_line, commit, write_table

from stseg.io.config_file import read_config

SCORES = ("moda", "idf1", "mota", "switches")


def run(name: str, bench: Bench, settings: Sequence[str], seed: int) -> list[float]:
    """SCORES of one perturbed run."""
    one = SETS[name]
    scores = scored(one, bench, final_rows(tracked(one, bench, read_config(None, list(settings)), seed)))
    return [float(getattr(scores, score) or 0.0) for score in SCORES]


def main() -> None:
    """Measure, a line for each set."""
    parser = command_line(__doc__)
    parser.add_argument("--sets", default="laboratory,cmc1,cmc2,cmc2_fairmot_features,wildtrack,uu4,easy,dense4")
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="stage.key=value")
    asked = parser.parse_args()
    bench = Bench(asked.data.resolve(), asked.work.resolve())
    rows = []
    for name in asked.sets.split(","):
        prepare(SETS[name], bench)
        seeds = range(1, asked.runs + 1)
        with ProcessPoolExecutor(asked.jobs, get_context("spawn")) as pool:
            found = np.array(list(pool.map(run, *zip(*[(name, bench, asked.settings, k) for k in seeds], strict=True))))
        mean, spread = found.mean(0), found.std(0, ddof=1) if asked.runs > 1 else np.zeros(len(SCORES))
        rows.append([name, asked.runs, *(f"{m:.1f} ± {s:.1f}" for m, s in zip(mean, spread, strict=True)), commit()])
        print(", ".join(map(str, rows[-1])), flush=True)
        write_table(asked.output / "perturbed.csv", [["set", "runs", *SCORES, "commit"], *rows])
