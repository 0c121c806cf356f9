"""What each stage is worth: the scores without it, on all views or the first few.

    python tools/experiment.py ablation [--data ../shared/data] [--sets uu4,cmc1,...] [--views 2,3,4]
        [--methods threshold,cut,...] [--frames A:B] [--work FOLDER] [--set KEY=VALUE]...

threshold       the plain volume thresholded at the best of nine levels, components linked to the nearest track
frames          per-frame detection, linked by motion: `--tracker frames`
two labels      the cut, its occupied cells given one by one to the nearest detection
cut             the cut, its occupied cells divided by an expansion: `--tracker cut`

Scores before and after the final association over the whole recording. Rendered scenes in WORK are used again.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from measure import first_views, prepared, score, track
from result_sets import SETS, ResultSet
from workbench import ROOT, Bench

from experiments.plain_methods import threshold
from stseg.arrays import Flags
from stseg.config import Config
from stseg.evaluation.scores import Scores
from stseg.geometry.nearest_person import nearest_person
from stseg.graphcut.grid_energy import GridEnergy
from stseg.io.config_file import read_config
from stseg.io.recording.recording import Recording
from stseg.records.blobs import UNASSIGNED
from stseg.segmentation.cell_labelling import WindowLabels
from stseg.segmentation.patches import Patches
from stseg.trackers import TRACKERS
from stseg.trackers.cut import CutTracker
from stseg.trackers.window_existence import TrackedFrame
from stseg.tracking.windows.windows import Window

METHODS = ("threshold", "frames", "two labels", "cut")
DEFAULT_SETS = ("uu4", "cmc1", "cmc2", "wildtrack", "crossing_boxes", "border_boxes")
_SCORES = ("MODA", "precision", "recall", "IDF1", "IDSW", "Frag", "false_tracks")


class TwoLabels(CutTracker):
    """The cut without the expansion."""

    def _divide(
        self, window: Window, held: list[TrackedFrame], patches: Patches, energy: GridEnergy, occupied: Flags
    ) -> WindowLabels:
        del window, energy
        label = np.zeros(occupied.shape, np.int32)
        for cells, own, tracked in zip(occupied, label, held, strict=True):
            near = nearest_person(patches.ground, tracked.fused.people.ground, self.config.occupancy.person_radius)
            own[cells] = np.broadcast_to(np.append(tracked.tracks, UNASSIGNED)[near], cells.shape)[cells]
        return WindowLabels(label, 0)


TRACKERS["two labels"] = f"{__name__}:TwoLabels"


def main() -> None:
    """Print a row for each set, number of views and method."""
    options = _options()
    bench, config = Bench(options.data.resolve(), options.work.resolve()), read_config(None, options.set)
    columns = ("set", "views", "method", *_SCORES, "MODA before", "IDF1 before")
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for one in (SETS[name] for name in options.sets):
        recording = prepared(one, bench)
        first, stop = map(int, (options.frames or one.frames).split(":"))
        for number in options.views or [len(recording.sources)]:
            part = first_views(recording, number)
            for method, before, after in _scored(one, part, first, stop, options.methods, bench, config):
                cells = [*(after[name] for name in _SCORES), before["MODA"], before["IDF1"]]
                shown = " | ".join(f"{cell:.1f}" if isinstance(cell, float) else str(cell) for cell in cells)
                print(f"| {one.name} | {number} | {method} | {shown} |", flush=True)


def _scored(
    one: ResultSet, part: Recording, first: int, stop: int, methods: list[str], bench: Bench, config: Config
) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    for method in methods:
        if method == "threshold":
            tried = {
                level: score(one, rows, bench, first, stop) for level, rows in threshold(part, first, stop).items()
            }
            level = max(tried, key=lambda level: _f1(tried[level]))
            yield f"threshold {level:g}", tried[level].as_dict(), tried[level].as_dict()
        else:
            found = track(part, first, stop, method, config)
            before, after = (score(one, rows, bench, first, stop) for rows in (found.committed, found.finished))
            yield method, before.as_dict(), after.as_dict()


def _f1(scores: Scores) -> float:
    """Harmonic mean of precision and recall; MODA would be best where nothing is found at all."""
    return 2 * scores.hits / max(scores.truths + scores.detections, 1)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    parser.add_argument("--sets", type=lambda text: text.split(","), default=list(DEFAULT_SETS))
    parser.add_argument("--views", type=lambda text: [int(n) for n in text.split(",")], help="first views; default all")
    parser.add_argument("--methods", type=lambda text: text.split(","), default=list(METHODS))
    parser.add_argument("--frames", metavar="A:B", help="half open; default all frames of the set")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of `stseg run`")
    return parser.parse_args()
