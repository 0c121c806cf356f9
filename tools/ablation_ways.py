"""The ways of tracking that tools/ablation.py sets beside each other.

threshold     KS09's figure 10: the plain volume thresholded, components of ground, linked by a Hungarian assignment.
frames        The pass of each frame, linked by motion: `--tracker frames`.
two labels    The cut, its object given cell by cell to the nearest person of the frame's pass.
cut           The cut, its object divided by an expansion: `--tracker cut`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from baselines import plain_fusion, rows, volumes

from stseg.arrays import Flags, Floats, Ints, Rows, Singles
from stseg.config import Config, IdentityConfig
from stseg.engine.backgrounds import make_foregrounds
from stseg.engine.pipeline import Pipeline
from stseg.geometry import Rig
from stseg.geometry.near import near_person
from stseg.graphcut.energy import Energy
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.model.blobs import UNASSIGNED
from stseg.segmentation.labelling import WindowLabels
from stseg.trackers import TRACKERS
from stseg.trackers.cut import CutTracker, _Linked
from stseg.tracking.assignment import assign, distances
from stseg.tracking.windows import Window

WAYS = ("threshold", "frames", "two labels", "cut")
LEVELS = (-0.1, -0.2, -0.3, -0.4, -0.5, -0.7, -1.0, -1.4, -2.0)
"""Nats a plane that the threshold is tried at."""


class TwoLabels(CutTracker):
    """The cut without the expansion."""

    def _divide(self, window: Window, held: list[_Linked], energy: Energy, occupied: Flags) -> WindowLabels:
        del window, energy
        label = np.zeros(occupied.shape, np.int32)
        for cells, own, linked in zip(occupied, label, held, strict=True):
            near = near_person(self.rig.grid.ground, linked.scene.people.ground, self.config.occupancy.reach)
            own[cells] = np.broadcast_to(np.append(linked.chains, UNASSIGNED)[near], cells.shape)[cells]
        return WindowLabels(label, 0)


TRACKERS["two labels"] = TwoLabels


@dataclass(frozen=True)
class Outcome:
    """Tracks of a way.

    Attributes
    ----------
    committed
        As they were linked.
    finished
        After the last look at all of them: who is who anew, short ones dropped, gaps filled, places smoothed.
    """

    committed: Rows
    finished: Rows


def some_views(recording: Recording, number: int) -> Recording:
    """The first cameras of a recording."""
    rig = replace(recording.rig, cameras=recording.rig.cameras[:number])
    return replace(recording, rig=rig, sources=recording.sources[:number])


def follow(recording: Recording, first: int, stop: int, way: str, config: Config) -> Outcome:
    """Track the people of a recording by `frames`, `two labels` or `cut`."""
    sights = make_foregrounds(recording, config, first, stop)
    kinds = ["boxes" if source.source.kind == "boxes" else "pixels" for source in recording.sources]
    pipeline = Pipeline(recording.rig, sights, kinds, config, way)
    done: list[int] = []
    with open_frames(recording, first, stop) as moments:
        steps = list(pipeline.steps(moments, first, done.append))
    committed, events = (np.concatenate([getattr(s.commit, name) for s in steps]) for name in ("trajectory", "events"))
    return Outcome(committed, pipeline.finished(committed, events)[0].trajectory)


def threshold(recording: Recording, first: int, stop: int) -> dict[float, Rows]:
    """Linked components at each of the levels."""
    volume: list[Singles] = list(volumes(recording, first, stop, "footprint"))
    rig, config = recording.rig, Config().identity
    return {level: link(plain_fusion(volume, level, rig.grid), first, rig, config) for level in LEVELS}


def link(found: list[Floats], first: int, rig: Rig, config: IdentityConfig) -> Rows:
    """Rows of the places found in each frame, each given to the nearest track that can have walked there."""
    names: list[Ints] = []
    last, seen = np.zeros((0, 2)), np.zeros(0, np.int64)
    for frame, places in enumerate(found):
        unseen = (frame - seen) / rig.frame_rate
        alive = unseen <= config.patience
        cost = distances(last, places) / (config.walking_speed * unseen + config.slack)[:, None]
        cost[~alive] = 2.0
        tracks, own = assign(cost, 1.0)
        name = np.arange(len(last), len(last) + len(places))
        name[own] = tracks
        fresh = np.setdiff1d(np.arange(len(places)), own)
        name[fresh] = np.arange(len(last), len(last) + len(fresh))
        last = np.concatenate([last, places[fresh]])
        seen = np.concatenate([seen, np.full(len(fresh), frame)])
        last[name], seen[name] = places, frame
        names.append(name + 1)
    table = rows(found, first)
    table["id"] = np.concatenate([*names, np.zeros(0, np.int64)])
    return table
