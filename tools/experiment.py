"""Run one experiment: python tools/experiment.py NAME [options], NAME --help for its options.

ablation    what each stage is worth: threshold, per-frame detection, cut without expansion, cut; on fewer views
answers     IDF1 over the number of answers that the truth gives to the questions of stseg review
certainty   calibration of stated probabilities: of cells stated as occupied with 0.8, are 80 % occupied?
day         identities of a whole day: processor time and memory of deciding them, over the number of rows
failing     what a view that fails for three seconds costs, beside its absence
few_views   two and three views of everything: scores, and how many of the points the run takes for wrong
identities  identities decided again, in seconds, from the rows of perturbed runs
labels      IoU of the cells of a track, and the right owner where bodies touch: cut, threshold, nearest track
live        what corrections of live ids bring, from run files and their truths
memory      resident memory of a long run, and the size of its run file
pixels      share of pixels of people that carry the right label, from film to label images
points      calibration of the probability of track points
returns     who comes back: returns that are recognised, and wrong ones, at each least probability
rig         error of a rig against the true one, on the ground and at head height
same        do two commits give the same bits?
scaling     CPU time of a frame over area, views, people and pixels, with exponents
sizes       error of heights and widths of tracks, and their spread along a track
spoil       what spoiled masks and boxes cost, by kinds, strengths, views and crowds
targets     scores on the recordings for which least scores are promised, and what a perfect observer would have
window      what a window decides better than its frames, and the candidates of people who are missed
"""

from __future__ import annotations

import importlib
import sys

EXPERIMENTS = (
    "ablation",
    "answers",
    "certainty",
    "day",
    "failing",
    "few_views",
    "identities",
    "labels",
    "live",
    "memory",
    "pixels",
    "points",
    "returns",
    "rig",
    "same",
    "scaling",
    "sizes",
    "spoil",
    "targets",
    "window",
)
"""Each is the module `experiments.NAME` with a function `main`, which reads the command line."""


def main() -> None:
    """Run the experiment that the command line names."""
    if len(sys.argv) < 2 or sys.argv[1] not in EXPERIMENTS:
        sys.exit(__doc__)
    name = sys.argv.pop(1)
    sys.argv[0] = f"experiment.py {name}"
    importlib.import_module(f"experiments.{name}").main()


if __name__ == "__main__":
    main()
