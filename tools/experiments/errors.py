"""Whether sizes and appearance err as identities take them to: standardised differences of a person, and of two.

    python tools/experiment.py errors [--sets laboratory,cmc2] [--runs 2] [--jobs 2]

People are those of the truth. Of heights, and of all axes of appearance together, three mean squares of differences in
stated standard deviations: between the halves of a person's time and among a person's isolated tracklets, where 1 is as
stated and less is more exact than stated; and between two people, which identities are told by.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from measure import prepare, tracked
from result_sets import SETS
from workbench import Bench, command_line, commit, in_processes, write_table

from stseg.arrays import Floats, Ints, Rows, ground_of
from stseg.config import Config
from stseg.evaluation.sequence import match
from stseg.geometry.distances import distances
from stseg.identities.association import IdentityProblem
from stseg.io.track_csv import read_tracks_csv
from stseg.records.border import Border
from stseg.tracking.row_groups import isolated_tracklets

_LEAST_ROWS = 8
"""Least rows of half a person's time, and of a tracklet."""


def people_of(rows: Rows, truth: Rows) -> Ints:
    """The person of each row, int64 (n,), -1 for none within 0.5 m."""
    person = np.full(len(rows), -1)
    for frame in np.unique(rows["frame"]):
        own, true = np.flatnonzero(rows["frame"] == frame), np.flatnonzero(truth["frame"] == frame)
        row, column = match(distances(ground_of(rows[own]), ground_of(truth[true])), 0.5)
        person[own[row]] = truth["id"][true[column]]
    return person


def run(name: str, bench: Bench, seed: int) -> Floats:
    """Sums of squares and degrees of freedom, float64 (2, kind, 2), of heights and of all axes of appearance.

    Kinds are halves, tracklets and pairs of people.
    """
    pipeline, found = tracked(SETS[name], bench, Config(), seed)
    trajectory, rate = found.trajectory, pipeline.rig.frame_rate
    problem = IdentityProblem.of(trajectory, (found.appearance,), rate, Border.of(pipeline.rig), Config())
    observed = problem.observations.rows
    evidence = np.stack([observed.precision, observed.information])[:, problem.observations.number]

    def spread(groups: Sequence[Ints]) -> Floats:
        """Squares of the groups' means about the mean of all, in stated variances; degrees of freedom."""
        precision, information = np.stack([evidence[:, rows].sum(1) for rows in groups], 1)
        known = np.maximum(precision, 1e-12)
        off = information / known - (information.sum(0) / known.sum(0))
        return np.stack([(precision * off**2).sum(0), np.maximum((precision > 0).sum(0) - 1, 0)])

    person = people_of(trajectory, read_tracks_csv(bench.path(str(SETS[name].truth))))
    order = np.lexsort((trajectory["frame"], person))
    own = [order[person[order] == k] for k in np.unique(person[person >= 0])]
    tracklets = [rows for rows in isolated_tracklets(trajectory, rate) if len(rows) >= _LEAST_ROWS]
    of_one = [[rows for rows in tracklets if np.isin(rows, one).all()] for one in own]
    halves = [np.array_split(rows, 2) for rows in own if len(rows) >= 2 * _LEAST_ROWS]
    kinds = halves, [rows for rows in of_one if len(rows) > 1], list(combinations(own, 2))
    none = np.zeros((2, evidence.shape[2]))
    whole = np.stack([sum(map(spread, groups), none) for groups in kinds], 1)
    return np.stack([whole[..., 0], whole[..., 1:].sum(2)], 2)


def main() -> None:
    """Measure, a line for each set and kind of size."""
    parser = command_line(__doc__, runs=2, jobs=2)
    parser.add_argument("--sets", default="laboratory,cmc1,cmc2,cmc2_fairmot_features,wildtrack,uu4_colour,easy,dense4")
    asked = parser.parse_args()
    bench, kinds = Bench.of(asked), ("halves", "tracklets", "pairs")
    lines: list[Sequence[object]] = [["set", "size", *kinds, *(f"{kind}_freedom" for kind in kinds), "commit"]]
    for name in asked.sets.split(","):
        prepare(SETS[name], bench)
        tasks = [(name, bench, seed) for seed in range(1, asked.runs + 1)]
        whole = np.sum(list(in_processes(run, tasks, asked.jobs)), axis=0)
        for size, (squares, freedom) in zip(("height", "appearance"), np.moveaxis(whole, 2, 0), strict=True):
            if freedom.any():
                means = [f"{s / n:.2f}" if n else "" for s, n in zip(squares, freedom, strict=True)]
                lines.append([name, size, *means, *freedom.astype(int).tolist(), commit()])
                print(", ".join(map(str, lines[-1])), flush=True)
        write_table(asked.output / "errors.csv", lines)
