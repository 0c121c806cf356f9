"""How well cells carry the label of the person whose body fills them: cut, components of a threshold, nearest track.

    python tools/experiment.py labels [SCENE ...] [--seeds 1,2] [--rig rig_masks.toml] [--seconds 8]
        [--smoothness 0.2,0.4,0.8] [--work FOLDER] [--picture docs/figures/labels_compared.png]

Simulated scenes are filmed and run. The truth of a cell is the person whose pillar covers it. Tracks are matched to
people one to one for the whole recording, by the cells that they share.

IoU         cells of a track and its person: intersection over union, of all people and frames together
touching    share of occupied cells with the right owner where bodies are within 0.8 m of each other
cut         the labels of the run file
threshold   cells of u > 0; each connected component has the track nearest to its centroid
nearest     cells of u > 0; each has the nearest track within the reach of a body

The picture shows the plane at half a body's height in the frame of the last run with most cells of people who touch.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import label as connected
from scipy.optimize import linear_sum_assignment
from workbench import ROOT, Bench

from stseg.arrays import Flags, Floats, Ints, Labels, Rows, Singles
from stseg.bodies.filled_cells import inside_bodies
from stseg.config import Config
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.io.runfile.runs import read_run
from stseg.io.track_csv import read_tracks_csv

SCENES = ("crossing", "border", "meeting")
TOUCHING = 0.8
"""Distance of two people below which their bodies touch, metres."""
REACH = Config().occupancy.person_radius
Labelling = Callable[[Labels, Singles, Ints, Floats, Grid], Labels]
"""From labels of the run file, u, track ids and places of a frame to the label of each cell."""


def by_cut(label: Labels, log_odds: Singles, track: Ints, ground: Floats, grid: Grid) -> Labels:
    """The labels of the run."""
    del log_odds, track, ground, grid
    return label


def by_threshold(label: Labels, log_odds: Singles, track: Ints, ground: Floats, grid: Grid) -> Labels:
    """Connected components of u > 0, each labelled by the track nearest to its centroid."""
    del label
    piece, number = connected(np.nan_to_num(log_odds) > 0)
    places = np.broadcast_to(grid.ground, (*log_odds.shape, 2))
    centroids = np.array([places[piece == k].mean(0) for k in range(1, number + 1)]).reshape(-1, 2)
    near = nearest_person(centroids, ground, REACH)
    return np.append(0, np.append(track, 0)[near])[piece].astype(np.int32)


def by_nearest(label: Labels, log_odds: Singles, track: Ints, ground: Floats, grid: Grid) -> Labels:
    """Cells of u > 0, each labelled by the nearest track."""
    del label
    near = nearest_person(grid.ground, ground, REACH)
    return np.where(np.nan_to_num(log_odds) > 0, np.append(track, 0)[near], 0).astype(np.int32)


METHODS: dict[str, Labelling] = {"cut": by_cut, "threshold": by_threshold, "nearest": by_nearest}


@dataclass
class CellCounts:
    """Cells by true person and label, of all frames, and of those where bodies touch; keys are (person, track)."""

    shared: dict[tuple[int, int], int] = field(default_factory=dict)
    touching: dict[tuple[int, int], int] = field(default_factory=dict)

    def add(self, truth: Labels, label: Labels, touching: Flags) -> None:
        """Count one frame, (plane, y, x) each."""
        for counts, inside in ((self.shared, np.ones_like(touching)), (self.touching, touching)):
            pairs, number = np.unique(np.stack([truth[inside], label[inside]]), axis=1, return_counts=True)
            for (person, track), count in zip(pairs.T.tolist(), number.tolist(), strict=True):
                counts[person, track] = counts.get((person, track), 0) + count

    def scores(self) -> tuple[float, float]:
        """IoU, and the share of cells with the right owner where bodies touch."""
        people, tracks = (sorted({pair[k] for pair in self.shared} - {0}) for k in (0, 1))
        table = np.array([[self.shared.get((p, t), 0) for t in tracks] for p in people])
        own = {(people[i], tracks[j]) for i, j in zip(*linear_sum_assignment(-table), strict=True)}
        right = sum(self.shared.get(pair, 0) for pair in own)
        union = sum(count for (person, track), count in self.shared.items() if person or track) + sum(
            count for (person, track), count in self.shared.items() if person and track and (person, track) not in own
        )
        owned = {pair: count for pair, count in self.touching.items() if pair[0] and pair[1]}
        kept = sum(count for pair, count in owned.items() if pair in own)
        return right / union, kept / max(sum(owned.values()), 1)


def truth_of(grid: Grid, rows: Rows) -> tuple[Labels, Flags]:
    """The person whose pillar covers each cell, 0 for none, and cells of people who touch, (plane, y, x)."""
    ground = np.column_stack([rows["x"], rows["y"]])
    near = nearest_person(grid.ground, ground, 1.0)
    inside = inside_bodies(grid, near, ground, rows["height"])
    away = np.hypot(*np.moveaxis(ground[:, None] - ground, -1, 0)) + 9.0 * np.eye(len(rows))
    close = np.append(away.min(1, initial=9.0) < TOUCHING, False)
    person = np.append(rows["id"], 0).astype(np.int32)[near]
    return np.where(inside, person, 0), inside & close[near]


def measure(run_file: Path, truth_file: Path, methods: dict[str, Labelling]) -> dict[str, CellCounts]:
    """Counts of each method on one run."""
    run, counts = read_run(run_file), {name: CellCounts() for name in methods}
    truth = read_truth(truth_file)
    grid = run.recording.rig.grid
    for frame in run.frames.tolist():
        u, label = run.read_frame(frame)
        true, touching = truth_of(grid, truth[truth["frame"] == frame])
        rows = run.trajectory[run.trajectory["frame"] == frame]
        ground = np.column_stack([rows["x"], rows["y"]])
        for name, method in methods.items():
            counts[name].add(true, method(label, u, rows["id"], ground, grid), touching)
    return counts


def read_truth(path: Path) -> Rows:
    """frame, id, x, y, height of a simulated scene's truth."""
    read_tracks_csv(path)  # complains of what is not one
    return np.asarray(np.genfromtxt(path, delimiter=",", names=True))


def draw(run_file: Path, truth_file: Path, methods: dict[str, Labelling], path: Path) -> None:
    """One plane of the frame in which most cells are of people who touch: the truth, and the labels of each method."""
    run, truth = read_run(run_file), read_truth(truth_file)
    grid = run.recording.rig.grid
    plane = int(np.abs(grid.heights - 1.0).argmin())
    true = {frame: truth_of(grid, truth[truth["frame"] == frame]) for frame in run.frames.tolist()}
    frame = max(true, key=lambda number: int(true[number][1].sum()))
    u, label = run.read_frame(frame)
    rows = run.trajectory[run.trajectory["frame"] == frame]
    ground = np.column_stack([rows["x"], rows["y"]])
    found = {name: method(label, u, rows["id"], ground, grid)[plane] for name, method in methods.items()}
    person, near = true[frame][0][plane], np.argwhere(true[frame][1][plane])
    (v0, u0), (v1, u1) = near.min(0) - 6, near.max(0) + 7
    figure, axes = plt.subplots(1, 1 + len(found), figsize=(2.2 * (1 + len(found)), 2.6), layout="constrained")
    for axis, (name, cells) in zip(axes, {"truth": person, **found}.items(), strict=True):
        shown = np.where(cells > 0, cells % 10, np.nan)[max(v0, 0) : v1, max(u0, 0) : u1]
        axis.imshow(shown, origin="lower", cmap="tab10", vmin=0, vmax=9, interpolation="nearest")
        axis.contour(person[max(v0, 0) : v1, max(u0, 0) : u1] > 0, [0.5], colors="k", linewidths=0.6)
        axis.set(title=name, xticks=[], yticks=[])
    figure.savefig(path, dpi=110)


def films(options: argparse.Namespace, bench: Bench) -> Iterator[tuple[str, str]]:
    """Name and folder of each filmed scene."""
    for scene in options.scenes or SCENES:
        for seed in options.seeds or [None]:
            name = f"labels_{scene}" + (f"_{seed}" if seed is not None else "")
            if not bench.path(f"$WORK/{name}/rig.toml").exists():
                length = f" --seconds {options.seconds}" + (f" --seed {seed}" if seed is not None else "")
                bench.do(f"stseg simulate $WORK/{name} --scene {scene}{length} --overwrite")
            yield scene if seed is None else f"{scene}, seed {seed}", f"$WORK/{name}"


def main() -> None:
    """Print IoU and ownership of each scene, smoothness and method."""
    options = _options()
    bench = Bench(ROOT, options.work.resolve())
    bench.work.mkdir(parents=True, exist_ok=True)
    print("| scene | smoothness | method | IoU | right owner where bodies touch |\n| --- | --: | --- | --: | --: |")
    for name, folder in films(options, bench):
        for smoothness in options.smoothness:
            run = f"$WORK/labels_{smoothness:g}.h5"
            bench.do(
                f"stseg run {folder}/{options.rig} -o {run} --overwrite --set segmentation.smoothness={smoothness}"
            )
            found = measure(bench.path(run), bench.path(f"{folder}/truth.csv"), METHODS)
            for method, counts in found.items():
                iou, owner = counts.scores()
                print(f"| {name} | {smoothness:g} | {method} | {iou:.3f} | {owner:.3f} |", flush=True)
            if options.picture:
                draw(bench.path(run), bench.path(f"{folder}/truth.csv"), METHODS, options.picture)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help=f"of `stseg simulate`; default {', '.join(SCENES)}")
    parser.add_argument("--seeds", type=lambda text: [int(n) for n in text.split(",")])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--rig", default="rig_masks.toml")
    parser.add_argument("--smoothness", type=lambda text: [float(n) for n in text.split(",")], default=[0.4])
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    return parser.parse_args()
