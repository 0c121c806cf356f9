"""What footprints, clutter weights and calibration do to the volume: the tables of docs/occupancy.md.

    python tools/occupancy_figures.py [sampling] [clutter] [coverage] [exact] [--frames 100]

Simulated scenes with exact rigs and the people's true silhouettes, spoiled by known rates of misses and false
foreground in square patches of pixels. Places are the peaks of the mean log-odds over the planes, as many as there are
people; nobody is explained and nobody is followed. Gate 0.5 m.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
from baselines import rows

from stseg.arrays import AnyArray, Bytes, Flags, Floats, Rows, Singles
from stseg.config import Config, MixtureConfig
from stseg.engine.pipeline import Pipeline
from stseg.evaluation import evaluate
from stseg.foreground import Mixture
from stseg.foreground.view_foreground import ViewForeground, without_prior
from stseg.geometry import Grid, Rig
from stseg.geometry.sampling import SamplingKind
from stseg.io.track_csv import POSITION
from stseg.occupancy.fusion import Rates
from stseg.occupancy.localisation import Localiser
from stseg.simulation import Film, SceneSpec, SimulatedFrame

KINDS: tuple[SamplingKind, ...] = get_args(SamplingKind)
OCCUPIED = 0.02
LEAST = 0.05
RATES = Rates(0.2, 0.07, 0.07)
NOISY = Rates(0.4, 0.25, 0.25)
GOOD = Rates(0.05, 0.02, 0.02)
PATCH = 8
"""Pixels: side of the patches in which masks err."""
BODY = 0.15
"""Metres: cells this near a person's axis are the person's."""
AROUND = 0.40
"""Metres: cells farther than this from everybody are empty."""
DEPTH = 2.0
"""Nats below a peak down to which cells belong to it."""
SCENE = SceneSpec(
    name="one", people=1, area=(4.0, 4.0), seconds=1.0, frame_rate=2.0, camera_distance=5.0, stay=100.0, seed=31
)


def main() -> None:
    """Print the tables that are asked for."""
    tables: dict[str, Callable[[int], None]] = {
        "sampling": sampling_table,
        "clutter": clutter_table,
        "coverage": coverage_table,
        "exact": exact_table,
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", default=list(tables))
    parser.add_argument("--frames", type=int, default=100)
    asked = parser.parse_args()
    for name in asked.tables:
        tables[name](asked.frames)


def sampling_table(frames: int) -> None:
    """Location error with the mean over footprints and with points, near and far cameras."""
    print("\n| cameras at | foreground | sampling | location error m, mean (median) | MODA |")
    print("| --- | --- | --- | --- | --- |")
    for distance in (5.0, 25.0):
        spec = replace(SCENE, camera_distance=distance)
        for name, shown in (("true silhouettes", silhouettes), ("mixtures on video", mixtures)):
            film = filmed(spec, frames, shown)
            for kind in KINDS:
                print(f"| {distance:g} m | {name} | {kind} | {located(film, kind, weigh_equal)} |", flush=True)


def clutter_table(frames: int) -> None:
    """Location error with and without clutter weights, where the first view is noisy."""
    print("\n| views | weights | location error m, mean (median) | MODA |\n| --- | --- | --- | --- |")
    film = filmed(replace(SCENE, camera_distance=10.0), frames, silhouettes)
    for views in (2, 3, 4):
        shown = film.spoiled([NOISY, *[GOOD] * (views - 1)])
        for weights, weigh in (("clutter", Localiser.clutter_weights), ("equal", weigh_equal)):
            print(f"| {views} | {weights} | {located(shown, 'footprint', weigh)} |", flush=True)


def exact_table(frames: int) -> None:
    """Location error of four views at 10 m: of the volume alone, and of the whole way to tracks."""
    print("\n| people | places from | location error m, mean (median) | MODA |\n| --- | --- | --- | --- |")
    for people in (1, 2, 4):
        film = filmed(replace(SCENE, people=people, camera_distance=10.0, frame_rate=5.0), frames, silhouettes)
        print(f"| {people} | the volume alone | {located(film, 'footprint', weigh_equal)} |")
        print(f"| {people} | the pipeline's tracks | {judged(film.truth, tracked(film))} |", flush=True)


def coverage_table(frames: int) -> None:
    """How often cells are called occupied, by the number of views that see them."""
    spec = SceneSpec(
        name="overlap", people=6, area=(8.0, 8.0), seconds=1.0, frame_rate=2.0, cameras=8, camera_distance=7.0,
        field_of_view=44.0, stay=100.0, seed=32,
    )  # fmt: skip
    film = filmed(spec, frames, silhouettes)
    localiser = Localiser(film.rig, "footprint")
    views = localiser.views(film.maps[0])
    log_odds, means, bodies, empty = [], [], [], []
    for k, maps in enumerate(film.spoiled([RATES] * 8).maps):
        equal = weigh_equal(localiser, maps)
        log_odds.append(localiser.log_odds(maps, equal, [RATES] * 8, OCCUPIED))
        means.append(localiser.synergy(maps, equal, LEAST) / np.maximum(views, 1))
        body, nobody = occupied_cells(film.rig.grid, film.truth[film.truth["frame"] == k])
        bodies.append(body)
        empty.append(nobody)
    u, mean, body, nobody = map(np.array, (log_odds, means, bodies, empty))
    level = same_hits(mean, u, body & (views == 4))
    print(f"\nlevel of the mean: {level:.2f} nats, where its hit rate at 4 views is that of u > 0\n")
    print(
        "| views | cells | hit, u > 0 | hit, mean | false, u > 0 | false, mean |\n| --- | --- | --- | --- | --- | --- |"
    )
    for n in range(1, 9):
        there, not_there = body & (views == n), nobody & (views == n)
        shares = (u[there] > 0, mean[there] > level, u[not_there] > 0, mean[not_there] > level)
        told = " | ".join(f"{100 * share.mean():.2f} %" if share.size else "-" for share in shares)
        print(f"| {n} | {int((views == n).sum())} | {told} |")


@dataclass(frozen=True)
class Filmed:
    """A filmed scene: its rig, the maps float32 (v, u) of each frame and view, and who truly stands where."""

    rig: Rig
    maps: list[list[Singles]]
    truth: Rows

    def spoiled(self, rates: Sequence[Rates]) -> Filmed:
        """The scene as so many of its views see it, each with its rates of misses and false foreground."""
        maps = [
            [spoiled(seen, rate, (k, i)) for i, (seen, rate) in enumerate(zip(views, rates, strict=False))]
            for k, views in enumerate(self.maps)
        ]
        return replace(self, rig=replace(self.rig, cameras=self.rig.cameras[: len(rates)]), maps=maps)


Looks = Callable[[SimulatedFrame], list[Singles]]
"""From a moment to the map of each view."""


def filmed(spec: SceneSpec, frames: int, looks: Callable[[Film], Looks]) -> Filmed:
    """The first frames of a scene."""
    film = Film(replace(spec, seconds=frames / spec.frame_rate))
    maps, truth, look = [], [], looks(film)
    for moment in film.moments():
        maps.append(look(moment))
        truth.append(positions(moment))
    return Filmed(film.rig, maps, np.concatenate(truth))


def silhouettes(_: Film) -> Looks:
    """True silhouettes."""
    return lambda moment: [(view.instances > 0).astype(np.float32) for view in moment.views]


def mixtures(film: Film) -> Looks:
    """What Gaussian mixtures, learned from the empty room, make of the rendered video."""
    models = [Mixture(camera.size, film.spec.frame_rate, MixtureConfig()) for camera in film.rig.cameras]
    for images in film.empty():
        for model, image in zip(models, images, strict=True):
            model.learn(image)

    def look(moment: SimulatedFrame) -> list[Singles]:
        posteriors = [model.likelihood(view.image) for model, view in zip(models, moment.views, strict=True)]
        return [without_prior(posterior, MixtureConfig().foreground) for posterior in posteriors]

    return look


def positions(moment: SimulatedFrame) -> Rows:
    """Who truly stands where."""
    table = np.zeros(len(moment.truth), POSITION)
    table["frame"] = moment.frame
    for name in ("id", "x", "y"):
        table[name] = moment.truth[name]
    return table


def spoiled(mask: Singles, rates: Rates, seed: tuple[int, int]) -> Singles:
    """Masks that miss bodies and see false foreground, patch by patch."""
    height, width = mask.shape
    lots = np.random.default_rng(seed).random((-(-height // PATCH), -(-width // PATCH)))
    lots = lots.repeat(PATCH, 0).repeat(PATCH, 1)[:height, :width]
    flipped = lots < np.where(mask > 0, rates.miss, rates.clutter)
    return np.where(flipped, 1 - mask, mask)


def weigh_equal(_: Localiser, maps: Sequence[Singles | None]) -> Floats:
    """No clutter model."""
    return np.ones(len(maps))


def located(film: Filmed, kind: SamplingKind, weigh: Callable[[Localiser, Sequence[Singles | None]], Floats]) -> str:
    """Scores of the places that the volume shows."""
    localiser = Localiser(film.rig, kind)
    rates = [RATES] * len(film.rig.cameras)
    found = []
    for k, maps in enumerate(film.maps):
        volume = localiser.log_odds(maps, weigh(localiser, maps), rates, OCCUPIED)
        found.append(places(volume, film.rig.grid, int((film.truth["frame"] == k).sum())))
    return judged(film.truth, rows(found, 0))


def places(volume: Singles, grid: Grid, number: int) -> Floats:
    """The best places of the ground one after the other, centroids about peaks, metres, float64 (n, 2)."""
    mean = np.nan_to_num(volume, nan=-100.0).mean(0)
    found = []
    for _ in range(number):
        peak = grid.ground.reshape(-1, 2)[mean.argmax()]
        about = np.hypot(*np.moveaxis(grid.ground - peak, -1, 0)) <= AROUND
        mass = np.where(about, mean - (mean.max() - DEPTH), 0.0).clip(0)
        found.append((mass[..., None] * grid.ground).sum((0, 1)) / mass.sum())
        mean[about] = -100.0
    return np.array(found).reshape(-1, 2)


def judged(truth: Rows, found: Rows) -> str:
    """Location error and MODA, as cells of a table."""
    scores: dict[str, Any] = evaluate(truth, found).as_dict()
    error = scores["location_error_m"]
    return f"{error['mean']:.4f} ({error['median']:.4f}) | {scores['MODA']:.1f}"


def occupied_cells(grid: Grid, truth: Rows) -> tuple[Flags, Flags]:
    """Cells within a body of 1.5 m, and cells far from everybody, bool (plane, y, x)."""
    people = np.column_stack([truth["x"], truth["y"]])
    away = np.hypot(*np.moveaxis(grid.ground[:, :, None] - people, -1, 0)).min(-1)
    low = (grid.heights <= 1.5)[:, None, None]
    return low & (away < BODY), np.broadcast_to(away > AROUND, grid.shape)


def same_hits(mean: AnyArray, u: AnyArray, body: AnyArray) -> float:
    """The level that the mean must pass to hit as many of these cells as u > 0 does."""
    return float(np.quantile(mean[body], 1 - (u[body] > 0).mean()))


def tracked(film: Filmed) -> Rows:
    """Tracks by the whole pipeline."""
    views = len(film.rig.cameras)
    pipeline = Pipeline(film.rig, [ViewForeground()] * views, ["pixels"] * views, Config(), "cut")
    masks = [MaskMoment(k, [np.asarray(255 * m, np.uint8) for m in maps]) for k, maps in enumerate(film.maps)]
    commits = [step.commit for step in pipeline.steps(masks, 0, lambda _: None)]
    rows, events = (np.concatenate([getattr(c, name) for c in commits]) for name in ("trajectory", "events"))
    return pipeline.finished(rows, events)[0].trajectory


@dataclass(frozen=True)
class MaskMoment:
    """One frame of a recording of masks."""

    frame: int
    views: Sequence[Bytes]


if __name__ == "__main__":
    main()
