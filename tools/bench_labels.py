"""How fast pixel labels are, and the solver beside PyMaxflow's aexpansion_grid: python tools/bench_labels.py

Scenes of 4 cameras of 320x240 are filmed in memory; times are processor times of one thread, medians over frames, from
what stands where and the foreground's map to the label images of all four views (HW12: 3 to 6 s a frame of the same
size, in which places and statuses are found, too). The peer solves the windows of the same energies without colours,
as it knows no weights that differ from edge to edge; both start from the most likely labels, and ours is timed with the
making of its energy, the peer without.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from time import process_time

import maxflow
import numpy as np
from bench_cut import Row, print_table
from labelled_scenes import TrueFrame, film_frames, labels_of

from stseg.arrays import Floats, Ints, Singles
from stseg.config import BodyConfig, LabelConfig
from stseg.graphcut.energy import QUANTUM
from stseg.graphcut.expansion import expand
from stseg.labels.adjacency import edge_costs
from stseg.labels.energy import admissible, most_likely_labels, pixel_energy
from stseg.labels.views import ViewLabels, view_labels
from stseg.simulation import NAMED

SIZE = (320, 240)
CROWDS = (5, 10, 14)
EVERY = 10
_NEVER = 1e6  # quanta


def speed(people: int) -> Row:
    """A scene with so many people."""
    spec = replace(NAMED["easy"], people=people, seconds=10.0, size=SIZE)
    rig, frames = film_frames(spec, EVERY)
    views = view_labels(rig, LabelConfig(), BodyConfig())
    labels_of(views, frames[0])  # compiles
    times = []
    for frame in frames:
        begin = process_time()
        labels_of(views, frame)
        times.append(process_time() - begin)
    ours, theirs = np.array([beside_peer(views, frame) for frame in frames[:4]]).sum(0)
    figures = {"frames/s": 1 / float(np.median(times)), "slowest ms": 1e3 * max(times)}
    figures |= {"stseg ms": 250 * ours, "aexpansion_grid ms": 250 * theirs, "ratio": theirs / ours}
    return Row(f"{people} people, 4 x {SIZE[0]}x{SIZE[1]}", figures)


def beside_peer(views: Sequence[ViewLabels], frame: TrueFrame) -> tuple[float, float]:
    """Seconds of both on the windows of a frame, from their costs to the labels."""
    ours = theirs = 0.0
    for view, seen in zip(views, frame.views, strict=True):
        shown = view.label_likelihood(frame.standing)
        shape, foreground = shown.background.shape, np.ascontiguousarray(seen.foreground[shown.window])
        start = most_likely_labels(shown)
        begin = process_time()
        problem = pixel_energy(shown, foreground, *edge_costs(None, shape, view.config), view.config)
        found = np.zeros(shape, np.int64)
        found.flat[problem.pixel] = expand(problem.energy, admissible(problem.energy, start.flat[problem.pixel]))
        ours += process_time() - begin
        costs, weight = (
            _dense(view, frame, np.asarray(foreground, float)),
            round(edge_costs(None, (2, 2), view.config)[0][0, 0]),
        )
        begin = process_time()
        peer = maxflow.aexpansion_grid(costs, weight * (1.0 - np.eye(costs.shape[-1])), labels=start.copy())
        theirs += process_time() - begin
        own, others = (_energy(costs, weight, label) for label in (found, peer))
        if own > 1.001 * others:
            sys.exit(f"bench_labels.py: energy {own:.0f}, aexpansion_grid's {others:.0f}")
    return ours, theirs


def _dense(view: ViewLabels, frame: TrueFrame, foreground: Singles) -> Floats:
    """Costs of all labels, float64 (v, u, n + 1), quanta."""
    shown, config = view.label_likelihood(frame.standing), view.config
    edges, least = shown.people.edges, config.outlier_rate / (len(frame.standing) + 1)
    costs = np.full((*shown.background.shape, len(edges) + 1), _NEVER)
    costs[..., 0] = config.foreground_weight * foreground - np.log(shown.background + least)
    for j, (left, top, right, bottom) in enumerate(edges.tolist()):
        here = np.s_[top - shown.top : bottom - shown.top, left - shown.left : right - shown.left]
        share = shown.people.share[shown.people.first[j] : shown.people.first[j + 1]].reshape(bottom - top, -1)
        costs[(*here, j + 1)] = config.foreground_weight * (1 - foreground[here]) - np.log(share + least)
    return np.where(costs < _NEVER, np.rint(costs / QUANTUM), _NEVER)


def _energy(costs: Floats, weight: int, label: Ints) -> float:
    differ = sum(np.count_nonzero(np.diff(label, axis=axis)) for axis in (0, 1))
    return float(np.take_along_axis(costs, label[..., None], -1).sum()) + weight * differ


def main() -> None:
    """Print the table."""
    print_table("4 views", (speed(people) for people in CROWDS))


if __name__ == "__main__":
    main()
