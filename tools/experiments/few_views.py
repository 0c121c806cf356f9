"""Two and three views of everything: scores, and how many of its points the run itself takes for wrong.

    python tools/experiment.py few_views [--only REGEX] [--frames 60] [--choices 6]

By choices of two and three of a recording's cameras: mean and least MODA / IDF1, percent; the share of points that are
wrong, percent; and the share that the run states itself, by the score and the views of each point. Everybody counts,
also people that the chosen cameras cannot see: in `wildtrack` most.
WORK holds uu4.toml, cmc2.csv, cmc2.toml, cmc2_fairmot.toml, wildtrack.csv and wildtrack.toml, as tools/results.py
leaves them. Of a rig with many cameras some choices are tried, evenly among all.
"""

import re
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from workbench import command_line, write_table

from experiments.recordings import Recorded, delivered, filmed
from stseg import Tracker
from stseg.arrays import Flags, Rows
from stseg.evaluation import evaluate
from stseg.records.point_probability import point_probability
from stseg.simulation import NAMED

_CMC_AREA = (1.9, -0.3, 6.2, 3.5)
_VIEWS = (2, 3)
_GATE = 0.5
"""Distance within which a point is right, metres."""


Row = tuple[str, float, float, float, float]
"""One choice of cameras: MODA, IDF1, and the shares of points that are wrong, and that are stated to be, percent."""


def recordings(data: Path, work: Path) -> dict[str, Callable[[int], Recorded]]:
    """The recordings by name; each is made with so many frames."""
    return {
        "uu4": lambda most: delivered(work / "uu4.toml", data / "uu4" / "reference_tracks.csv", most),
        "cmc2": lambda most: delivered(work / "cmc2.toml", work / "cmc2.csv", most, _CMC_AREA),
        "cmc2, fairmot": lambda most: delivered(work / "cmc2_fairmot.toml", work / "cmc2.csv", most, _CMC_AREA),
        "easy, masks": filmed(NAMED["easy"], "mask"),
        "easy, boxes": filmed(NAMED["easy"], "boxes"),
        "dense4, masks": filmed(NAMED["dense4"], "mask"),
        "wildtrack": lambda most: delivered(work / "wildtrack.toml", work / "wildtrack.csv", most),
    }


def matched(found: Rows, truth: Rows, gate: float) -> Flags:
    """Rows that are matched, one to one, to a person of their frame, bool (n,)."""
    right = np.zeros(len(found), bool)
    for frame in np.unique(found["frame"]):
        rows, people = np.flatnonzero(found["frame"] == frame), truth[truth["frame"] == frame]
        distance = np.hypot(people["x"][:, None] - found["x"][rows], people["y"][:, None] - found["y"][rows])
        i, j = linear_sum_assignment(np.where(distance < gate, distance, 1e3))
        right[rows[j[distance[i, j] < gate]]] = True
    return right


def tracked(made: Recorded) -> Rows:
    """Trajectory of the default tracker."""
    tracker, results = Tracker(made.rig), []
    for views in made.frames:
        results += tracker.add(views)
    return tracker.tracks(results + tracker.finish()).trajectory


def choices(cameras: int, number: int, most: int) -> Iterator[tuple[int, ...]]:
    """Choices of a number of cameras, `most` at most, evenly among all in their order."""
    every = list(combinations(range(cameras), number))
    for k in np.unique(np.linspace(0, len(every) - 1, min(most, len(every))).astype(int)):
        yield every[k]


def measured(made: Recorded, chosen: tuple[int, ...]) -> Row:
    """Track by some cameras, and score."""
    made = made.seen_by(chosen)
    found, truth = tracked(made), made.truth
    flagged = "flag" in (truth.dtype.names or ())
    scores = evaluate(truth, found, area=made.area, frames=np.arange(len(made.frames)), ignore_flagged=flagged)
    if made.area is not None:
        x0, y0, x1, y1 = made.area
        found = found[(found["x"] >= x0) & (found["x"] <= x1) & (found["y"] >= y0) & (found["y"] <= y1)]
    wrong, stated = 1 - matched(found, truth, _GATE).mean(), 1 - point_probability(found).mean()
    named = "".join(str(k + 1) for k in chosen)
    return named, scores.moda or 0.0, scores.idf1, 100 * wrong, 100 * stated


def line(name: str, number: int, rows: list[Row]) -> list[object]:
    """One row of the table."""
    values = np.array([row[1:] for row in rows])
    (moda, idf1, wrong, stated), least = values.mean(0), values.min(0)
    worst = min(rows, key=lambda row: row[1])[0]
    scores = f"{moda:.1f} / {idf1:.1f}", f"{least[0]:.1f} / {least[1]:.1f}"
    return [name, number, len(rows), *scores, worst, f"{wrong:.1f}", f"{stated:.1f}"]


def main() -> None:
    """Write the table, after each line."""
    parser = command_line(__doc__)
    parser.add_argument("--only", default=".", help="of the recordings' names")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--choices", type=int, default=6)
    asked = parser.parse_args()
    head = ["recording", "views", "choices", "mean", "least", "least by cameras", "wrong points", "stated"]
    lines: list[list[object]] = [[*head]]
    for name, make in recordings(asked.data, asked.work).items():
        if re.search(asked.only, name):
            made = make(asked.frames)
            for number in _VIEWS:
                rows = []
                for chosen in choices(len(made.rig.cameras), number, asked.choices):
                    rows.append(measured(made, chosen))
                    print(name, *rows[-1], flush=True)
                lines.append(line(name, number, rows))
                write_table(asked.output / "few_views.csv", lines)
