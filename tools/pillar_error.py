"""How well strips of an image stand for a pillar's true image: the first table of docs/localisation.md.

    python tools/pillar_error.py [--sets uu4,cmc1,easy] [--places 25] [--data ../shared/data] [--work build/results]

A pillar is drawn exactly: discs a thirtieth of its height apart, each projected point by point through lens and
tilt, the convex hull of each two filled at four times the resolution. Beside it the strips of
`stseg.detection.pillar_strips`, at full resolution and rounded to whole pixels as they are used, and the one rectangle
about the true image. Pillars are of sizes within two standard deviations of HW12's, at places in view at 1 m
height: some anywhere, for which the overlap (intersection over union) is measured, and as many within 0.5 m of
people of one frame, for which Omega is.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from ablation import frames_of, prepared
from result_sets import SETS, ResultSet
from results import ROOT, Bench

from stseg.arrays import AnyArray, Boxes, Flags, Floats
from stseg.config import Config
from stseg.detection.pillar_strips import Pillars
from stseg.engine.backgrounds import make_foregrounds
from stseg.foreground import box_likelihood
from stseg.geometry import Camera, Rig
from stseg.io.recording.frames import open_frames
from stseg.io.track_csv import read_tracks_csv

STRIPS = (1, 3, 6, 12)
HEIGHTS = np.linspace(1.4, 2.0, 10)
WIDTHS = np.linspace(0.2, 0.4, 10)
WIDTH, OUTSIDE = 0.30, 0.08
_FINE, _BITS, _DISCS, _POINTS = 4, 6, 30, 32
_MARGIN = 0.4
"""Of the image's longer side: what lies farther outside is not drawn."""


def drawn(camera: Camera, place: Floats, height: float, width: float, pad: int) -> Floats:
    """The image of a cylinder: how much of each pixel it covers, float64 (v, u) with a margin all around."""
    columns, rows = camera.size
    fine = np.zeros(((rows + 2 * pad) * _FINE, (columns + 2 * pad) * _FINE), np.uint8)
    angle = np.linspace(0, 2 * np.pi, _POINTS, endpoint=False)
    circle = place + 0.5 * width * np.column_stack([np.cos(angle), np.sin(angle)])
    discs = [camera.project(circle, float(z))[0] for z in np.linspace(0.0, height, _DISCS)]
    for lower, upper in pairwise(discs):
        corners = np.rint(((np.concatenate([lower, upper]) + pad + 0.5) * _FINE - 0.5) * 2**_BITS).astype(np.int32)
        cv2.fillConvexPoly(fine, cv2.convexHull(corners), (1,), shift=_BITS)
    sums = cv2.resize(fine.astype(np.float32), None, fx=1 / _FINE, fy=1 / _FINE, interpolation=cv2.INTER_AREA)
    return np.asarray(sums, float)


def cut(pillars: Pillars, place: int, heights: int, width: float, shape: tuple[int, ...], pad: int) -> Floats:
    """The strips of one pillar, 0 or 1, float64 (v, u) with that margin."""
    image = np.zeros(shape)
    for k in range(pillars.base + heights + 1):
        middle, half = pillars.middle[place, k], pillars.half[place, k] * width
        along = slice(*np.sort(np.floor(pillars.edge[place, k : k + 2] + 0.5).astype(int) + pad).clip(0))
        across = slice(*(np.floor([middle - half + 0.5, middle + half + 0.5]).astype(int) + pad).clip(0))
        image[(along, across) if pillars.upright[place] else (across, along)] = 1.0
    return image


def boxed(image: Floats) -> Floats:
    """The one rectangle about an image."""
    filled = np.zeros_like(image)
    rows, columns = np.nonzero(image > 0.5)
    filled[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = 1.0
    return filled


def overlap(one: Floats, other: Floats) -> float:
    """Intersection over union of two images."""
    return float(np.minimum(one, other).sum() / np.maximum(one, other).sum())


def in_view(camera: Camera, ground: Floats) -> Flags:
    """Whether the whole cylinder is before the camera, and its middle in the image."""
    middle, _ = camera.project(ground, 1.0)
    ahead = np.logical_and.reduce(
        [camera.project(ground + np.array([dx, dy]), z)[1] for z in (0, 2) for dx, dy in _CORNERS]
    )
    return np.asarray(ahead & camera.inside(middle))


_CORNERS = 0.3 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])


def errors(camera: Camera, ground: Floats, shown: AnyArray, lots: np.random.Generator) -> tuple[Floats, Floats]:
    """Overlaps with the true image, and Omega less the true one, of each of STRIPS and of the rectangle: (way, n)."""
    pad = int(_MARGIN * max(camera.size))
    likelihood = np.pad(shown.astype(float), pad, constant_values=OUTSIDE)
    ways = [Pillars.of(camera, ground, HEIGHTS, WIDTH, strips=strips) for strips in STRIPS]
    shares, omegas = [], []
    for i, place in enumerate(ground):
        tall, width = int(lots.integers(len(HEIGHTS))), float(lots.choice(WIDTHS))
        exact = drawn(camera, place, float(HEIGHTS[tall]), width, pad)
        images = [cut(way, i, tall, width, exact.shape, pad) for way in ways]
        images.append(boxed(exact))
        true = (exact * likelihood).sum() / exact.sum()
        shares.append([overlap(image, exact) for image in images])
        omegas.append([(image * likelihood).sum() / image.sum() - true for image in images])
    shape = (len(STRIPS) + 1, len(ground))
    return np.array(shares).T.reshape(shape), np.array(omegas).T.reshape(shape)


def measured(one: ResultSet, bench: Bench, places: int) -> list[str]:
    """Rows of the table for one set."""
    recording, (first, _), lots = prepared(one, bench), frames_of(one), np.random.default_rng(0)
    assert one.truth is not None
    truth = read_tracks_csv(bench.path(one.truth))
    rig, frame = recording.rig, first + 10
    people = truth[truth["frame"] == frame]
    standing = np.column_stack([people["x"], people["y"]])
    anywhere: list[tuple[Floats, Floats]] = []
    near: list[tuple[Floats, Floats]] = []
    with open_frames(recording, frame, frame + 1) as moments:
        views = next(iter(moments)).views
    for camera, sight, view in zip(
        rig.cameras, make_foregrounds(recording, Config(), frame, frame + 1), views, strict=True
    ):
        seen = sight.evidence(view)
        shown = box_likelihood(seen, camera.size) if isinstance(seen, Boxes) else seen
        assert shown is not None
        beside = standing[lots.integers(len(standing), size=places)] + lots.uniform(-0.35, 0.35, (places, 2))
        for ground, kept in ((_anywhere(rig, places, lots), anywhere), (beside, near)):
            kept.append(errors(camera, ground[in_view(camera, ground)], shown, lots))
    shares, omegas = np.concatenate([s for s, _ in anywhere], 1), np.concatenate([o for _, o in near], 1)
    rows = []
    for k, way in enumerate((*(f"{s} + {len(HEIGHTS) - 1} strips" for s in STRIPS), "one rectangle")):
        low, off = np.quantile(shares[k], 0.05), np.abs(omegas[k])
        error = f"{off.mean():.3f} | {np.quantile(off, 0.95):.3f} | {omegas[k].mean():+.3f}"
        rows.append(f"| {one.name} | {way} | {shares.shape[1]} | {shares[k].mean():.3f} | {low:.3f} | {error} |")
    return rows


def _anywhere(rig: Rig, number: int, lots: np.random.Generator) -> Floats:
    return np.column_stack([lots.uniform(*rig.grid.x, number), lots.uniform(*rig.grid.y, number)])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=lambda text: text.split(","), default=["uu4", "cmc1", "easy"])
    parser.add_argument("--places", type=int, default=25, help="of each kind and camera")
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    asked = parser.parse_args(arguments)
    bench = Bench(asked.data.resolve(), asked.work.resolve())
    print("| set | pillars as | pillars | overlap, mean | 5 % below | Omega off, mean | 95 % below | on average |")
    print("| --- | --- | --: | --: | --: | --: | --: | --: |")
    for name in asked.sets:
        print("\n".join(measured(SETS[name], bench, asked.places)), flush=True)


if __name__ == "__main__":
    main()
