"""How fast an expansion is beside PyMaxflow's aexpansion_grid: python tools/bench_expansion.py [LABELS,SEED ...]

Windows of 15 frames of 10 x 100 x 100 cells in which people walk, seen by six cameras (studies/graph-cut.md, sections
1 and 4): log-likelihoods of soft cylinders averaged over the cameras, with holes, noise of rays and clutter. The labels
are the background and people, whose cost at a cell is -u plus what it is off the place that their first frames predict;
in the first frame the cells in their middle are theirs. Both start from each cell's cheapest label and go through the
labels in the same order; both times are from the table of costs to the labels.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter

import maxflow
import numpy as np
from bench_cut import Row, print_table

from stseg.arrays import Floats, Ints, Labels, Singles
from stseg.graphcut.cell_subset import subset
from stseg.graphcut.cut import minimum_cut
from stseg.graphcut.expansion import LabelEnergy, expand
from stseg.graphcut.grid_energy import GridEnergy
from stseg.kernels.accelerate import kernel
from stseg.segmentation.cell_motion import successor_cells
from stseg.segmentation.cut_energy import neighbourhood

SHAPE = (15, 10, 100, 100)
CELL, RISE, STEP = 0.10, 0.20, 1 / 15  # metres, metres, seconds
LEVEL = 1.0  # nats that a mean log-likelihood may be below 0 where a cell is occupied
WEIGHT = 375  # quanta: eight neighbours together 3 nats
NEVER = 100_000  # quanta
CASES = ((10, 3), (10, 11), (20, 5))


@dataclass(frozen=True)
class Crowd:
    """Who walks: ground float64 (time, k, 2), radius and height float64 (k,), metres."""

    ground: Floats
    radius: Floats
    height: Floats


def compare(labels: int, seed: int) -> Row:
    """Both on one window, in the same process; ours is the median of three, theirs one call."""
    unary, cost = problem(labels, seed)
    solve(cost)  # compiles
    times = []
    for _ in range(3):
        begin = perf_counter()
        ours = solve(cost)
        times.append(perf_counter() - begin)
    table, differ = cost.astype(float), WEIGHT * (1.0 - np.eye(labels))
    begin = perf_counter()
    theirs = maxflow.aexpansion_grid(table, differ)
    taken = perf_counter() - begin
    energy = energy_of(cost, ours)
    if energy != energy_of(cost, theirs):
        sys.exit(f"bench_expansion.py: seed {seed}: energy {energy}, aexpansion_grid's {energy_of(cost, theirs)}")
    figures = {"u > 0, %": 100 * float((unary > 0).mean()), "aexpansion_grid s": taken}
    figures |= {"stseg s": float(np.median(times)), "ratio": taken / float(np.median(times))}
    return Row(f"{labels} labels, seed {seed}", figures)


def expansion_rows(cases: Iterable[tuple[int, int]] = CASES) -> Iterable[Row]:
    """Windows of many labels."""
    for labels, seed in cases:
        yield compare(labels, seed)


def solve(cost: Labels) -> Ints:
    """Labels of a window, int64 (time, plane, y, x), from costs int32 (time, plane, y, x, label), in quanta.

    The two-label cut of each cell's best cost leaves the cells that a label can win. Of their labels, one that costs
    more than the background and all the cell's edges together cannot win either.
    """
    best = np.empty(SHAPE, np.int32)
    _fill_best(cost, best)
    still = successor_cells(np.zeros((SHAPE[0] - 1, *SHAPE[2:], 2), np.int64))
    window = GridEnergy(best, neighbourhood(8), np.full(4, WEIGHT, np.int32), still)
    part = subset(window, minimum_cut(window).occupied)
    own = cost.reshape(-1, cost.shape[-1])[part.cell].astype(np.int64)
    more = own[:, 1:] - own[:, :1]
    size = len(part.cell)
    around = np.bincount(part.start, part.weight, size) + np.bincount(part.end, part.weight, size) + part.border
    cell, column = np.nonzero(more <= around[:, None])
    first = np.append(0, np.cumsum(np.bincount(cell, minlength=size)))
    price = more[cell, column] + part.border[cell]
    energy = LabelEnergy(first, column + 1, price, part.start, part.end, part.weight)
    labels = np.zeros(SHAPE, np.int64)
    labels.flat[part.cell] = expand(energy, own.argmin(1))
    return labels


@kernel
def _fill_best(cost: Labels, best: Labels) -> None:
    """Fill what each cell's cheapest label gains over the background."""
    for t in range(cost.shape[0]):
        for z in range(cost.shape[1]):
            for y in range(cost.shape[2]):
                for x in range(cost.shape[3]):
                    least = cost[t, z, y, x, 1]
                    for label in range(2, cost.shape[4]):
                        least = min(least, cost[t, z, y, x, label])
                    best[t, z, y, x] = cost[t, z, y, x, 0] - least


def energy_of(cost: Labels, labels: Ints) -> int:
    """Energy of a labelling of the whole window, quanta."""
    total = int(np.take_along_axis(cost, labels[..., None].astype(np.int64), -1).sum(dtype=np.int64))
    for axis in range(labels.ndim):
        total += WEIGHT * int(np.count_nonzero(np.diff(labels.astype(np.int64), axis=axis)))
    return total


def problem(labels: int, seed: int) -> tuple[Ints, Labels]:
    """u of a window, and the costs of its labels, int32 (time, plane, y, x, label), in quanta."""
    rng = np.random.default_rng(seed)
    crowd = walk(labels - 1, rng)
    unary = np.rint((volume(crowd, rng) + LEVEL) * 1000).astype(np.int64)
    cost = np.zeros((*SHAPE, labels), np.int32)
    place = ((np.arange(100) + 0.5) * CELL)[None]
    away = [np.hypot(place - at[0], place.T - at[1]) for at in crowd.ground[0]]
    owner = np.argmin(away, 0)
    low = np.arange(SHAPE[1]) * RISE < 1.3
    velocity = (crowd.ground[2] - crowd.ground[0]) / 2
    for k in range(labels - 1):
        for t in range(SHAPE[0]):
            x, y = crowd.ground[0, k] + velocity[k] * t
            off = np.hypot(place - x, place.T - y) - (0.45 + 0.3 * t * STEP)
            gate = np.minimum(3.0 * off.clip(0), 6.0)
            cost[t, ..., k + 1] = np.rint(1000 * gate) - unary[t]
    for k in range(labels - 1):
        middle = low[:, None, None] & (away[k] < 0.15) & (owner == k)
        cost[0, middle] = NEVER
        cost[0, middle, k + 1] = 0
    return unary, cost


def walk(number: int, rng: np.random.Generator) -> Crowd:
    """People who walk at 0.5 to 1.5 m/s, two pairs of them close together."""
    side = SHAPE[3] * CELL
    place = rng.uniform(0.5, side - 0.5, (number, 2))
    way, speed = rng.uniform(0, 2 * np.pi, number), rng.uniform(0.5, 1.5, number)
    place[1], way[1], speed[1] = place[0] + rng.normal(0, 0.35, 2), way[0], speed[0]
    place[3], way[3], speed[3] = place[2] + rng.normal(0, 0.6, 2), way[2] + np.pi, speed[2]
    ground = np.zeros((SHAPE[0], number, 2))
    for t in range(SHAPE[0]):
        ground[t] = place
        way = way + rng.normal(0, 0.08, number)
        step = place + (speed * STEP)[:, None] * np.column_stack([np.cos(way), np.sin(way)])
        way = np.where(((step < 0.3) | (step > side - 0.3)).any(1), way + np.pi, way)
        place = step.clip(0.3, side - 0.3)
    return Crowd(ground, rng.uniform(0.21, 0.29, number), rng.uniform(1.55, 1.85, number))


def volume(crowd: Crowd, rng: np.random.Generator, cameras: int = 6) -> Singles:
    """Mean log-likelihood of each cell over the cameras, float32 (time, plane, y, x), nats."""
    angle = np.linspace(0, 2 * np.pi, cameras, endpoint=False) + rng.uniform(-0.3, 0.3, cameras)
    centre = 5 + rng.uniform(6.5, 9.5, cameras) * np.stack([np.cos(angle), np.sin(angle)])
    camera = np.column_stack([centre.T, rng.uniform(2.4, 4.0, cameras)])
    hole = np.full((cameras, *crowd.ground.shape[:2], 2), -1.0)
    holed = rng.random(hole.shape[:3]) < 0.12
    hole[holed] = np.column_stack([rng.uniform(0, 1.4, holed.sum()), rng.uniform(0.1, 0.5, holed.sum())])
    noise = rng.random((cameras, SHAPE[0], 512, 256), np.float32)
    clutter = np.zeros((cameras, 512, 256), np.float32)
    v, u = np.mgrid[:512, :256]
    for view in clutter:
        for row, column, size, strength in rng.uniform((0, 75, 1.5, 0.3), (512, 130, 5, 0.9), (6, 4)):
            np.maximum(view, strength * np.exp(-((v - row) ** 2 + (u - column) ** 2) / (2 * size**2)), out=view)
    mean = np.empty(SHAPE, np.float32)
    _fill_volume(camera, crowd.ground, crowd.radius, crowd.height, hole, noise, clutter, mean)
    return mean


@kernel
def _fill_volume(
    camera: Floats, ground: Floats, radius: Floats, height: Floats, hole: Floats, noise: Singles, clutter: Singles,
    mean: Singles,
) -> None:  # fmt: skip
    for t, z, y, x in np.ndindex(mean.shape):
        total = 0.0
        for c in range(len(camera)):
            dx, dy = (x + 0.5) * 0.1 - camera[c, 0], (y + 0.5) * 0.1 - camera[c, 1]
            dz, far = z * 0.2 - camera[c, 2], np.hypot(dx, dy)
            seen = 0.0
            for k in range(len(radius)):
                qx, qy = ground[t, k, 0] - camera[c, 0], ground[t, k, 1] - camera[c, 1]
                along, aside = (qx * dx + qy * dy) / far, abs(qx * dy - qy * dx) / far
                if along <= 0.1 or aside > 0.8:
                    continue
                at = camera[c, 2] + dz * along / far  # height of the ray where it passes the person
                wide = radius[k] if at <= height[k] - 0.35 else 0.55 * radius[k]
                shown = 1 / (1 + np.exp((aside - wide) / 0.03)) / (1 + np.exp((at - height[k]) / 0.03))
                shown /= 1 + np.exp((-0.05 - at) / 0.03)
                if 0 <= hole[c, t, k, 0] < at < hole[c, t, k, 0] + hole[c, t, k, 1]:
                    shown *= 0.15
                seen = max(seen, shown)
            row = int((np.arctan2(dy, dx) / (2 * np.pi) + 0.5) * 511.99)
            column = int((np.arctan2(dz, far) / np.pi + 0.5) * 255.99)
            grain = noise[c, t, row, column]
            seen = seen * (1 - 0.15 * grain) + clutter[c, row, column] * (1 - seen) + 0.1 * grain * grain
            total += np.log(0.0025 + 0.9975 * min(max(seen, 0.0), 1.0))
        mean[t, z, y, x] = max(total / len(camera), -6.0)


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    cases = [(int(case.partition(",")[0]), int(case.partition(",")[2])) for case in arguments]
    print_table("Expansion over many labels, synthetic", expansion_rows(cases or CASES))


if __name__ == "__main__":
    main(sys.argv[1:])
