"""Who comes back: returns that are recognised, and wrong ones, at each least probability.

    stseg simulate film --scene return --seed 3803          # and others, with --alike or --people
    stseg run film/rig.toml -o film.h5 --volume none
    python tools/experiment.py returns film.h5=film/truth.csv ... [--heights]

A track is that of the person whom it is nearest to in most of its frames. *Newcomers* are all tracks once more, each as
that of somebody who was never there before: the person's other tracks are left out, so any return is a wrong one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.engine.offline.known import rows_with_ids
from stseg.engine.pipeline import identity_problem
from stseg.identities.evidence.returns import Visits, find_returns
from stseg.io.config_file import parse_config
from stseg.io.runfile.runs import read_run
from stseg.io.track_csv import read_tracks_csv

_LEVELS = (0.5, 0.8, 0.9, 0.95, 0.99, 0.999)
_GATE = 0.5
"""Greatest distance from the truth, metres."""


def main() -> None:
    """Print a table of each run, and of all together."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", metavar="RUN.h5=TRUTH.csv")
    parser.add_argument("--heights", action="store_true", help="without appearance")
    options = parser.parse_args()
    total = np.zeros((len(_LEVELS), 5), np.int64)
    for given in options.runs:
        path, _, truth = given.partition("=")
        visits, spread, owner = _visits(Path(path), read_tracks_csv(Path(truth)), options.heights)
        counts = np.array([_counts(visits, spread, owner, least) for least in _LEVELS])
        _show(path, counts)
        total += counts
    _show("all", total)


def _show(name: str, counts: Ints) -> None:
    print(name)
    for least, (returns, right, wrong, newcomers, taken) in zip(_LEVELS, counts.tolist(), strict=True):
        shares = f"{100 * right / max(returns, 1):.1f} % of {returns} returns recognised, {wrong} wrong"
        print(f"  {least:5}: {shares}; {taken} of {newcomers} newcomers taken for somebody")


def _visits(path: Path, truth: Rows, heights: bool) -> tuple[Visits, Floats, Ints]:
    """The visits of a run, the spread of what is known of them, and the true person of each, 0 for nobody."""
    run = read_run(path)
    config = parse_config(run.provenance.config, str(path))
    problem = identity_problem(
        run.recording.reduced(config.foreground.body_rows).read_rig, config, run.committed, run.appearance
    )
    rows = rows_with_ids(run)
    more = len(problem.seen.order) - len(rows)
    visits = problem.visits(np.pad(rows["id"], (0, more)), np.pad(rows["frame"], (0, more)))
    sizes = slice(0, 1) if heights else slice(None)
    kept = Visits(
        visits.identity, visits.first, visits.last, visits.precision[:, sizes], visits.information[:, sizes],
        visits.lasting[sizes],
    )  # fmt: skip
    owners = {one: _owner(run.trajectory[run.trajectory["id"] == one], truth) for one in visits.identity.tolist()}
    return kept, problem.model.spread[sizes], np.array([owners[one] for one in visits.identity.tolist()])


def _owner(track: Rows, truth: Rows) -> int:
    """The true person of a track, 0 for nobody."""
    near = Counter[int]()
    for row in track:
        there = truth[truth["frame"] == row["frame"]]
        away = np.hypot(there["x"] - row["x"], there["y"] - row["y"])
        near[int(there["id"][away.argmin()]) if len(away) and away.min() < _GATE else 0] += 1
    return near.most_common(1)[0][0]


def _counts(visits: Visits, spread: Floats, owner: Ints, least: float) -> tuple[int, int, int, int, int]:
    """Returns, those recognised, wrong ones, newcomers, and those taken for somebody who was there."""
    who = dict(zip(visits.identity.tolist(), owner.tolist(), strict=True))
    found = find_returns(visits, spread, least)
    right = sum(who[one.visit] == who[one.identity] != 0 for one in found)
    returns = sum(person != 0 and person in owner[:k] for k, person in enumerate(owner.tolist()))
    taken = sum(_is_taken(visits, spread, owner, k, least) for k in range(1, len(visits)))
    return returns, right, len(found) - right, len(visits) - 1, taken


def _is_taken(visits: Visits, spread: Floats, owner: Ints, newcomer: int, least: float) -> bool:
    """Whether a track without the others of its person is taken for a return."""
    kept: Flags = owner != owner[newcomer]
    kept[newcomer] = True
    alone = Visits(
        visits.identity[kept], visits.first[kept], visits.last[kept], visits.precision[kept], visits.information[kept],
        visits.lasting,
    )  # fmt: skip
    return any(one.visit == visits.identity[newcomer] for one in find_returns(alone, spread, least))


if __name__ == "__main__":
    main()
