"""Recordings of `few_views`: what cameras deliver, of real recordings and of simulated scenes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stseg.arrays import Observation, Rows
from stseg.evaluation.sequence import Area
from stseg.geometry import Rig
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.simulation import SceneFilm, SceneSpec


@dataclass(frozen=True)
class Recorded:
    """What cameras deliver, a tuple a frame, the truth, and the rectangle that is scored, None for all."""

    rig: Rig
    truth: Rows
    frames: Sequence[tuple[Observation, ...]]
    area: Area | None = None

    def seen_by(self, chosen: Sequence[int]) -> Recorded:
        """The same by some cameras."""
        rig = replace(self.rig, cameras=tuple(self.rig.cameras[k] for k in chosen))
        return replace(self, rig=rig, frames=[tuple(views[k] for k in chosen) for views in self.frames])


def delivered(rig: Path, truth: Path, stop: int, area: Area | None = None) -> Recorded:
    """A recording's first frames."""
    recording, rows = read_recording(rig), read_tracks_csv(truth)
    with open_frames(recording, 0, stop) as sets:
        frames = [frame_set.views for frame_set in sets]
    return Recorded(recording.rig, rows[rows["frame"] < stop], frames, area)


def filmed(spec: SceneSpec, kind: str) -> Callable[[int], Recorded]:
    """A simulated scene by its "mask" or "boxes"."""

    def make(most: int) -> Recorded:
        film = SceneFilm(replace(spec, seconds=min(spec.seconds, most / spec.frame_rate)))
        sets = [
            (frame_set.truth, tuple(getattr(view, kind) for view in frame_set.views)) for frame_set in film.frame_sets()
        ]
        return Recorded(film.rig, np.concatenate([truth for truth, _ in sets]), [views for _, views in sets])

    return make
