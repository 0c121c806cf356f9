"""Plain methods that the project is compared with: thresholded volume, components on the ground, nearest-track links.

The volume is that of Khan and Shah (TPAMI 31(3), 2009): the mean over the views that see a cell of log L, on all
planes. Nothing explains anything away, so both ghosts and merged people are to be expected in a crowd.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import label

from stseg.arrays import Boxes, Flags, Floats, Ints, Rows, Singles
from stseg.baselines.khan_shah_2009.synergy_map import Localiser
from stseg.config import Config, ParticleConfig, TrackingConfig
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.foreground import box_likelihood
from stseg.geometry import Grid, Rig
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.track_csv import POSITION
from stseg.tracking.filter.assignment import assign, distances

LEVELS = (-0.1, -0.2, -0.3, -0.4, -0.5, -0.7, -1.0, -1.4, -2.0)
"""Thresholds that are tried, nats a plane."""
LEAST = 0.05
"""Miss rate of the foreground."""
SMALLEST = 0.05
"""Least ground area of a component, square metres."""


def threshold(recording: Recording, first: int, stop: int) -> dict[float, Rows]:
    """Linked components at each of the levels."""
    volume: list[Singles] = list(volumes(recording, first, stop))
    rig, config = recording.rig, Config().tracking
    return {level: link(components(volume, level, rig.grid), first, rig, config) for level in LEVELS}


def volumes(recording: Recording, first: int, stop: int) -> Iterator[Singles]:
    """Mean log-likelihood of the views that see each cell, frame by frame, float32 (plane, y, x); nan where none."""
    foregrounds = make_foregrounds(recording, Config(), first, stop)
    localiser = Localiser(recording.rig, "footprint")
    with open_frames(recording, first, stop) as frames:
        for frame in frames:
            maps: list[Singles | None] = []
            for foreground, view, camera in zip(foregrounds, frame.views, recording.rig.cameras, strict=True):
                seen = foreground.evidence(view)
                maps.append(box_likelihood(seen, camera.size) if isinstance(seen, Boxes) else seen)
            yield _mean_log(maps, localiser)


def _mean_log(maps: Sequence[Singles | None], localiser: Localiser) -> Singles:
    synergy = localiser.synergy(maps, np.ones(len(maps)), LEAST)
    return np.asarray(synergy / np.maximum(localiser.views(maps), 1), np.float32)


def components(volume: list[Singles], level: float, grid: Grid) -> list[Floats]:
    """Centroids of the ground's components above a level in each frame, metres, float64 (n, 2)."""
    return [_centroids(np.nan_to_num(frame - level, nan=-1.0).mean(0) > 0, grid) for frame in volume]


def _centroids(occupied: Flags, grid: Grid) -> Floats:
    pieces, number = label(occupied, np.ones((3, 3)))
    inside = [pieces == k for k in range(1, number + 1)]
    return np.array([grid.ground[c].mean(0) for c in inside if c.sum() * grid.cell**2 > SMALLEST]).reshape(-1, 2)


def link(found: list[Floats], first: int, rig: Rig, config: TrackingConfig) -> Rows:
    """Rows of the places found in each frame, each assigned to the nearest track within walking distance."""
    names: list[Ints] = []
    last, seen = np.zeros((0, 2)), np.zeros(0, np.int64)
    for frame, places in enumerate(found):
        unseen = (frame - seen) / rig.frame_rate
        alive = unseen <= config.patience
        cost = distances(last, places) / (ParticleConfig().walking_speed * unseen + config.assignment_distance)[:, None]
        cost[~alive] = 2.0
        tracks, own = assign(cost, 1.0)
        name = np.arange(len(last), len(last) + len(places))
        name[own] = tracks
        births = np.setdiff1d(np.arange(len(places)), own)
        name[births] = np.arange(len(last), len(last) + len(births))
        last = np.concatenate([last, places[births]])
        seen = np.concatenate([seen, np.full(len(births), frame)])
        last[name], seen[name] = places, frame
        names.append(name + 1)
    return _table(found, names, first)


def _table(found: list[Floats], names: list[Ints], first: int) -> Rows:
    table = np.zeros(sum(map(len, found)), POSITION)
    table["frame"] = np.repeat(np.arange(first, first + len(found)), [len(places) for places in found])
    table["id"] = np.concatenate([*names, np.zeros(0, np.int64)])
    table["x"], table["y"] = np.concatenate([*found, np.zeros((0, 2))]).T
    return table
