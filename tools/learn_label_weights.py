"""Learn the constants of the pixel labels from simulated scenes with true labels: python tools/learn_label_weights.py

Four steps, each with what the one before found. The scenes are none of the named ones.

1. `place_spread`: that under which the true labels are the likeliest (eqs 19, 20). It holds what the pillar of
   revolution lacks, arms and legs that swing.
2. `alike` and `slope`, k1 and k2 of the adjacency (eq. 18): logistic regression of whether two neighbouring pixels show
   the same, on the distance of their colours, both cases weighing the same. HW12, too, learns these from pairs alone.
   `colourless` is the mean of max(g, 0) where they do not: what a border costs on the average.
3. `detection` and `adjacency`, c1 and c2, by the linear programme of eq. 23. With A, B and P what a labelling pays for
   detection, adjacency and likelihood at c1 = c2 = 1, the true labels of view i must be better than a degraded k by

       c1 (A_k - A_i) + c2 (B_k - B_i) + P_k - P_i >= m D_k - s_i,    minimise sum_i s_i / F_i,

   D_k the number of wrong pixels, F_i that of pixels that show people. HW12 maximises the sum of the left sides, which
   has no maximum; the slack s_i is there because no constants make every true labelling the best. The degraded
   labellings are the true ones shifted, grown, shrunk, with two people exchanged, and those that the solver finds with
   the constants so far: the programme is solved again until they no longer change. The margin m, nats a wrong pixel, is
   the one of `MARGINS` by which most of the people's pixels come out right on a scene of its own.
4. `place_spread` again: the one by which most of the people's pixels come out right on that scene. The likelihood of
   step 1 counts every pixel of the windows, and most of them are background that no constant gets wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from labelled_scenes import TrueFrame, TrueView, accuracy, film_frames
from scipy.ndimage import grey_dilation, grey_erosion, shift
from scipy.optimize import linprog, minimize

from stseg.arrays import Floats, Ints, Labels
from stseg.config import LabelConfig
from stseg.geometry import Rig
from stseg.labels.adjacency import adjacency
from stseg.labels.views import ViewLabels, view_labels
from stseg.simulation import SceneSpec

SCENES = tuple(
    SceneSpec(f"learn{seed}", people, (6.0, 6.0), 6.0, camera_distance=6.8, noise=noise, seed=seed)
    for seed, people, noise in ((7101, 5, 2.5), (7102, 9, 3.0), (7103, 14, 3.5))
)
CHECK = SceneSpec("check", 9, (6.0, 6.0), 6.0, camera_distance=6.8, seed=7104)
EVERY = 15
PLACE_SPREADS = (0.04, 0.06, 0.08, 0.10, 0.12)
MARGINS = (1.0, 2.0, 4.0, 8.0, 16.0)
ROUNDS = 12
MOST = 50.0
"""Bound of c1 and c2, nats."""
_FARTHEST = 442  # of two colours, grey levels

Scene = tuple[Rig, list[TrueFrame]]


@dataclass(frozen=True)
class Example:
    """One view of one frame, cut to the window of its people.

    Attributes
    ----------
    view, frame, seen
        What the solver takes.
    window
        The window in the image.
    truth : int64 (v, u)
    penalty : float64 (n + 1, v, u)
        -log p(l | S), nats.
    cost : float64 (2, v, u)
        max(g, 0) to the next pixel of the row and to the one below; 0 where there is none.
    """

    view: ViewLabels
    frame: TrueFrame
    seen: TrueView
    window: tuple[slice, slice]
    truth: Ints
    penalty: Floats
    cost: Floats

    @classmethod
    def of(cls, view: ViewLabels, frame: TrueFrame, seen: TrueView) -> Example:
        """The example of a view; pixels of people outside the area are taken for background."""
        window = view.expected(frame.standing).window
        colours = seen.image[window].astype(float)
        cost, one = np.zeros((2, *colours.shape[:2])), replace(view.config, adjacency=1.0)
        cost[0, :, :-1] = adjacency(np.linalg.norm(np.diff(colours, axis=1), axis=-1), one)
        cost[1, :-1] = adjacency(np.linalg.norm(np.diff(colours, axis=0), axis=-1), one)
        truth = seen.truth[window].astype(np.int64).clip(0)
        return cls(view, frame, seen, window, truth, penalties(view, frame), cost)

    @property
    def people_pixels(self) -> int:
        """F."""
        return max(int((self.truth > 0).sum()), 1)

    def terms(self, label: Ints) -> Floats:
        """A, B and P of a labelling of the window, float64 (3,)."""
        q = self.seen.foreground[self.window]
        detection = float(np.where(label > 0, 1 - q, q).sum())
        across = float(self.cost[0, :, :-1][np.diff(label, axis=1) != 0].sum())
        down = float(self.cost[1, :-1][np.diff(label, axis=0) != 0].sum())
        likelihood = float(np.take_along_axis(self.penalty, label[None], 0).sum())
        return np.array([detection, across + down, likelihood])

    def solved(self, config: LabelConfig) -> Ints:
        """What the solver finds."""
        view = ViewLabels(self.view.camera, self.view.table, config)
        return view.label(self.frame.standing, self.seen.foreground, self.seen.image)[self.window].astype(np.int64)

    def degraded(self) -> Iterator[Ints]:
        """The true labels, made worse."""
        for way in ((0, 2), (2, 0), (0, -2), (-2, 0)):
            yield shift(self.truth, way, order=0)
        yield grey_dilation(self.truth, (3, 3))
        yield grey_erosion(self.truth, (3, 3))
        there = np.unique(self.truth[self.truth > 0])
        for one, other in pairwise(there.tolist()):
            exchanged = np.arange(len(self.penalty))
            exchanged[[one, other]] = other, one
            yield exchanged[self.truth]


def penalties(view: ViewLabels, frame: TrueFrame) -> Floats:
    """-log p(l | S) of all labels in the window, float64 (n + 1, v, u), nats."""
    shown = view.expected(frame.standing)
    share = np.zeros((len(frame.standing) + 1, *shown.nobody.shape))
    share[0] = shown.nobody
    for j, (left, top, right, bottom) in enumerate(shown.people.edges.tolist()):
        own = shown.people.share[shown.people.first[j] : shown.people.first[j + 1]]
        here = np.s_[top - shown.top : bottom - shown.top, left - shown.left : right - shown.left]
        share[j + 1][here] = own.reshape(bottom - top, right - left)
    share += view.config.outside / len(share)
    return np.asarray(-np.log(share / share.sum(0)))


def mean_penalty(scenes: Sequence[Scene], config: LabelConfig) -> float:
    """Mean of -log p(l | S) of the true labels, nats a pixel."""
    total = pixels = 0.0
    for rig, frames in scenes:
        views = view_labels(rig, config)
        for frame in frames:
            for view, seen in zip(views, frame.views, strict=True):
                truth = seen.truth[view.expected(frame.standing).window].astype(np.int64)
                paid = np.take_along_axis(penalties(view, frame), truth.clip(0)[None], 0)[0][truth >= 0]
                total, pixels = total + float(paid.sum()), pixels + paid.size
    return total / pixels


def likeliest(scenes: Sequence[Scene], config: LabelConfig) -> LabelConfig:
    """Step 1."""
    trials = [replace(config, place_spread=spread) for spread in PLACE_SPREADS]
    paid = [mean_penalty(scenes, trial) for trial in trials]
    best = trials[int(np.argmin(paid))]
    print(f"place_spread {best.place_spread} m: {min(paid):.4f} nats a pixel")
    return best


def contrast(scenes: Sequence[Scene], config: LabelConfig) -> LabelConfig:
    """Step 2."""
    count = np.zeros((2, _FARTHEST))  # pairs that differ, pairs that are the same
    for _, frames in scenes:
        for seen in (seen for frame in frames for seen in frame.views):
            for axis in (0, 1):
                differs = np.diff(seen.truth, axis=axis) != 0
                people = np.maximum(*(np.take(seen.truth, _all_but(seen.truth, axis, k), axis) for k in (0, 1))) > 0
                distance = np.linalg.norm(np.diff(seen.image.astype(float), axis=axis), axis=-1).astype(int)
                for same in (0, 1):
                    count[same] += np.bincount(distance[people & (differs != bool(same))], minlength=_FARTHEST)
    share = count / count.sum(1, keepdims=True)
    middle = np.arange(_FARTHEST) + 0.5

    def loss(curve: Floats) -> float:
        odds = (curve[0] - middle) / np.exp(curve[1])
        return float(share[0] @ np.logaddexp(0, odds) + share[1] @ np.logaddexp(0, -odds))

    alike, slope = minimize(loss, [30.0, 2.0], method="Nelder-Mead").x
    found = replace(config, alike=round(float(alike), 1), slope=round(float(np.exp(slope)), 1))
    at_borders = share[0] @ adjacency(np.asarray(middle, float), replace(found, adjacency=1.0))
    return replace(found, colourless=round(float(at_borders), 2))


def _all_but(image: Labels, axis: int, last: int) -> Ints:
    return np.arange(1 - last, image.shape[axis] - last)


def weights(scenes: Sequence[Scene], check: Scene, config: LabelConfig) -> LabelConfig:
    """Step 3."""
    examples = [
        Example.of(view, frame, seen)
        for rig, frames in scenes
        for views in [view_labels(rig, config)]
        for frame in frames
        for view, seen in zip(views, frame.views, strict=True)
    ]
    rows = [row for k, example in enumerate(examples) for bad in example.degraded() for row in _row(k, example, bad)]
    learned = []
    for margin in MARGINS:
        found = with_margin(margin, examples, list(rows), config)
        score = accuracy(*check, found)
        print(f"margin {margin:.0f}: c1 {found.detection}, c2 {found.adjacency}: {score}")
        learned.append((score.found, found))
    return max(learned, key=lambda one: one[0])[1]


def with_margin(
    margin: float, examples: Sequence[Example], rows: list[list[float]], config: LabelConfig
) -> LabelConfig:  # fmt: skip
    """The constants by which the true labels are better by a margin, nats a wrong pixel."""
    pixels = np.array([example.people_pixels for example in examples])
    for _ in range(ROUNDS):
        detection, smoothness = programme(np.array(rows), pixels, margin)
        config = replace(config, detection=round(detection, 2), adjacency=round(smoothness, 2))
        known = {tuple(row) for row in rows}
        fresh = [row for k, example in enumerate(examples) for row in _row(k, example, example.solved(config))]
        rows += [row for row in fresh if tuple(row) not in known]
        if len(rows) == len(known):
            break
    return config


def _row(k: int, example: Example, bad: Ints) -> Iterator[list[float]]:
    """The example, what a degraded labelling pays more than the truth (A, B, P), and its wrong pixels, if any."""
    wrong = int((bad != example.truth).sum())
    if wrong:
        yield [k, *(example.terms(bad) - example.terms(example.truth)), wrong]


def programme(rows: Floats, pixels: Ints, margin: float) -> tuple[float, float]:
    """c1 and c2 by the linear programme."""
    example, wrong = rows[:, 0].astype(int), rows[:, 4]
    size = pixels[example]
    left = np.zeros((len(rows), 2 + len(pixels)))
    left[:, :2] = -rows[:, 1:3] / size[:, None]
    left[np.arange(len(rows)), 2 + example] = -1.0
    right = (rows[:, 3] - margin * wrong) / size
    cost = np.concatenate([[0.0, 0.0], np.full(len(pixels), 1 / len(pixels))])
    bounds = [(0.0, MOST)] * 2 + [(0.0, None)] * len(pixels)
    found = linprog(cost, A_ub=left, b_ub=right, bounds=bounds, method="highs")
    if found.x is None:
        sys.exit(f"learn_label_weights.py: the linear programme: {found.message}")
    return float(found.x[0]), float(found.x[1])


def most_right(check: Scene, config: LabelConfig) -> LabelConfig:
    """Step 4."""
    trials = [replace(config, place_spread=spread) for spread in PLACE_SPREADS]
    scores = [accuracy(*check, trial) for trial in trials]
    for trial, score in zip(trials, scores, strict=True):
        print(f"place_spread {trial.place_spread} m: {score}")
    return trials[int(np.argmax([score.found for score in scores]))]


def main() -> None:
    """Learn, and say how good the labels are on the scenes that were learned from."""
    *scenes, check = (film_frames(spec, EVERY) for spec in (*SCENES, CHECK))
    config = most_right(check, weights(scenes, check, contrast(scenes, likeliest(scenes, LabelConfig()))))
    print(config)
    for spec, scene in zip(SCENES, scenes, strict=True):
        print(f"{spec.name}, {spec.people} people: {accuracy(*scene, config)}")


if __name__ == "__main__":
    main()
