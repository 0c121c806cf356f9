"""How the plain methods do on a recording: what a scene's difficulty is judged by (METHODS 12).

    python tools/baselines.py RIG TRUTH.csv [--frames 0:100] [--level -1.0] [--sampling point]

plain KS09: the mean over the views that see a cell of log L, on all planes, summed over planes, thresholded at `level`
nats a plane, components on the ground. plain 4-D cut: a minimum cut of windows of 15 frames of the same volume less the
level, components in space and time cut frame by frame. Neither knows who explains what, so both are expected to fail in
a crowd.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import label

from stseg.arrays import Boxes, Flags, Floats, Rows, Singles
from stseg.config import Config, SegmentationConfig
from stseg.engine.backgrounds import make_foregrounds
from stseg.evaluation import evaluate
from stseg.foreground import box_likelihood
from stseg.geometry import Grid, Rig
from stseg.geometry.sampling import SamplingKind
from stseg.graphcut.cut import minimum_cut
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.io.track_csv import POSITION, read_tracks_csv
from stseg.occupancy.localisation import Localiser
from stseg.segmentation.energy import build_energy

LEAST = 0.05
"""L_min: how often a detector misses."""
WINDOW = 15
SMALLEST = 0.05
"""Square metres of ground below which a component is nobody."""


def mean_log(maps: Sequence[Singles | None], localiser: Localiser) -> Singles:
    """Mean log-likelihood of the views that see each cell, float32 (plane, y, x); nan where none does."""
    synergy = localiser.synergy(maps, np.ones(len(maps)), LEAST)
    mean = synergy / np.maximum(localiser.views(maps), 1)
    return np.asarray(mean, np.float32)


def volumes(recording: Recording, first: int, stop: int, sampling: SamplingKind) -> Iterator[Singles]:
    """The plain volume of each frame."""
    sights = make_foregrounds(recording, Config(), first, stop)
    localiser = Localiser(recording.rig, sampling)
    with open_frames(recording, first, stop) as moments:
        for moment in moments:
            maps: list[Singles | None] = []
            for sight, view, camera in zip(sights, moment.views, recording.rig.cameras, strict=True):
                seen = sight.evidence(view)
                maps.append(box_likelihood(seen, camera.size) if isinstance(seen, Boxes) else seen)
            yield mean_log(maps, localiser)


def places(occupied: Flags, grid: Grid) -> Floats:
    """Centroids of the components on the ground (y, x), metres, float64 (n, 2)."""
    pieces, number = label(occupied, np.ones((3, 3)))
    centroids = [
        grid.ground[pieces == k].mean(0) for k in range(1, number + 1) if (pieces == k).sum() * grid.cell**2 > SMALLEST
    ]
    return np.array(centroids).reshape(-1, 2)


def rows(found: list[Floats], first: int) -> Rows:
    """Detections without identities: every one is a track of its own."""
    table = np.zeros(sum(map(len, found)), POSITION)
    table["frame"] = np.repeat(np.arange(first, first + len(found)), [len(f) for f in found])
    table["id"] = np.arange(len(table)) + 1
    ground = np.concatenate([*found, np.zeros((0, 2))])
    table["x"], table["y"] = ground.T
    return table


def plain_fusion(volume: list[Singles], level: float, grid: Grid) -> list[Floats]:
    """Plain KS09."""
    return [places(np.nan_to_num(frame - level, nan=-1.0).mean(0) > 0, grid) for frame in volume]


def plain_cut(volume: list[Singles], level: float, rig: Rig) -> list[Floats]:
    """The plain 4-D cut."""
    found = []
    for start in range(0, len(volume), WINDOW):
        window = np.nan_to_num(np.stack(volume[start : start + WINDOW]) - level, nan=-1.0).astype(np.float32)
        still = np.zeros((len(window) - 1, *rig.grid.shape[1:], 2), np.int64)
        energy = build_energy(window, still, rig.grid, SegmentationConfig())
        found += [places(cells.any(0), rig.grid) for cells in minimum_cut(energy).occupied]
    return found


def main() -> None:
    """Run both and print their scores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rig", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--frames", default="0:100")
    parser.add_argument("--level", type=float, default=-1.0)
    parser.add_argument("--sampling", choices=("footprint", "point"), default="footprint")
    asked = parser.parse_args()
    first, stop = map(int, asked.frames.split(":"))
    recording = read_rig(asked.rig)
    rig = recording.rig
    truth = read_tracks_csv(asked.truth)
    truth = truth[(truth["frame"] >= first) & (truth["frame"] < stop)]
    volume = list(volumes(recording, first, stop, asked.sampling))
    for name, found in (
        ("plain KS09", plain_fusion(volume, asked.level, rig.grid)),
        ("plain 4-D cut", plain_cut(volume, asked.level, rig)),
    ):
        scores = evaluate(truth, rows(found, first), ignore_flagged=True).as_dict()
        print(name, {key: scores[key] for key in ("MODA", "precision", "recall", "location_error_m")})


if __name__ == "__main__":
    main()
