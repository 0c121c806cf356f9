"""Whether sizes and appearance err as identities take them to: standardised differences of a person, and of two.

    python tools/experiment.py errors [--sets laboratory,cmc2] [--runs 2] [--jobs 2]

People are those of the truth. Of heights, and of all axes of appearance together, three mean squares of differences in
stated standard deviations: between the halves of a person's time and among a person's isolated tracklets, where 1 is as
stated and less is more exact than stated; and between two people, which identities are told by.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations
from multiprocessing import get_context

import numpy as np
from measure import prepare, tracked
from result_sets import SETS
from workbench import Bench, command_line, commit, write_table

from stseg.arrays import Floats, Ints, Rows, ground_of
from stseg.config import Config
from stseg.evaluation.sequence import match
from stseg.geometry.distances import distances
from stseg.identities.association import IdentityProblem
from stseg.io.track_csv import read_tracks_csv
from stseg.records.border import Border
from stseg.tracking.row_groups import isolated_tracklets

_GATE = 0.5
"""Greatest distance of a row from its person, metres."""
_LEAST_ROWS = 8
"""Least rows of half a person's time, and of a tracklet."""
_SETS = "laboratory,cmc1,cmc2,cmc2_fairmot_features,wildtrack,uu4_colour,easy,dense4"


def people_of(rows: Rows, truth: Rows) -> Ints:
    """The person of each row, int64 (n,), -1 for none within the gate."""
    person = np.full(len(rows), -1)
    for frame in np.unique(rows["frame"]):
        own, true = np.flatnonzero(rows["frame"] == frame), np.flatnonzero(truth["frame"] == frame)
        row, column = match(distances(ground_of(rows[own]), ground_of(truth[true])), _GATE)
        person[own[row]] = truth["id"][true[column]]
    return person


class Sums:
    """Precision, and precision times deviation, of each size of some rows, float64 (n, size) each."""

    def __init__(self, problem: IdentityProblem) -> None:
        number = problem.observations.number
        self.precision, self.information = (
            values[number] for values in (problem.observations.rows.precision, problem.observations.rows.information)
        )

    def spread(self, groups: Sequence[Ints]) -> tuple[Floats, Floats]:
        """Sum of squares of the groups' means about the mean of all, in stated variances, and degrees of freedom."""
        precision = np.array([self.precision[rows].sum(0) for rows in groups])
        mean = np.array([self.information[rows].sum(0) for rows in groups]) / np.maximum(precision, 1e-12)
        whole = (precision * mean).sum(0) / np.maximum(precision.sum(0), 1e-12)
        return (precision * (mean - whole) ** 2).sum(0), np.maximum((precision > 0).sum(0) - 1, 0)


def run(name: str, bench: Bench, seed: int) -> Floats:
    """Sums of squares and degrees of freedom, float64 (2, kind, size): halves, tracklets and pairs of people."""
    one, config = SETS[name], Config()
    pipeline, rows = tracked(one, bench, config, seed)
    rig, trajectory = pipeline.rig, rows.trajectory
    assert one.truth is not None
    person = people_of(trajectory, read_tracks_csv(bench.path(one.truth)))
    sums = Sums(IdentityProblem.of(trajectory, (rows.appearance,), rig.frame_rate, Border.of(rig), config))
    order = np.lexsort((trajectory["frame"], person))
    own = [order[person[order] == k] for k in np.unique(person[person >= 0])]
    tracklets = [rows for rows in isolated_tracklets(trajectory, rig.frame_rate) if len(rows) >= _LEAST_ROWS]
    of_one = [rows for rows in tracklets if len(set(person[rows].tolist())) == 1 and person[rows[0]] >= 0]
    halves = [np.array_split(rows, 2) for rows in own if len(rows) >= 2 * _LEAST_ROWS]
    parts = [[rows for rows in of_one if person[rows[0]] == k] for k in np.unique(person[person >= 0])]
    groups = halves, [part for part in parts if len(part) > 1], list(combinations(own, 2))
    none = np.zeros((2, sums.precision.shape[1]))
    return np.array([sum((np.array(sums.spread(group)) for group in kind), none) for kind in groups]).swapaxes(0, 1)


def main() -> None:
    """Measure, a line for each set and kind of size."""
    parser = command_line(__doc__)
    parser.add_argument("--sets", default=_SETS)
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    bench = Bench(asked.data.resolve(), asked.work.resolve())
    head = "set", "size", "halves", "number", "tracklets", "number", "two people", "number", "commit"
    lines: list[Sequence[object]] = [head]
    for name in asked.sets.split(","):
        prepare(SETS[name], bench)
        seeds = range(1, asked.runs + 1)
        with ProcessPoolExecutor(asked.jobs, get_context("spawn")) as pool:
            found = list(pool.map(run, *zip(*[(name, bench, seed) for seed in seeds], strict=True)))
        for size, chosen in (("height", slice(0, 1)), ("appearance", slice(1, None))):
            squares, freedom = sum(one[:, :, chosen].sum(2) for one in found)
            if freedom.any():
                pairs = [(f"{s / max(n, 1):.2f}", int(n)) for s, n in zip(squares, freedom, strict=True)]
                lines.append([name, size, *(value for pair in pairs for value in pair), commit()])
                print(", ".join(map(str, lines[-1])), flush=True)
        write_table(asked.output / "errors.csv", lines)
