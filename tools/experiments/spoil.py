"""How much spoiled masks and boxes cost: kinds of errors, three strengths each, few and many views, crowds; and uu4.

    python tools/experiment.py spoil [--kinds holes,jitter] [--strengths middle] [--views 2,4] [--crowds 3,8]
        [--seconds 4] [--uu4 RIG.toml --uu4-truth TRACKS.csv] [--uu4-frames 0:60]

Each cell of the table is MODA / IDF1, percent, of the default tracker on a simulated crowd of `easy`'s area (images of
320 x 240, 10 frames per second), by masks or, for errors of boxes, by boxes. Views of 2 and 4 are some of those of 8.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from workbench import command_line, write_table

from stseg import Tracker
from stseg.arrays import Observation, Rows
from stseg.evaluation import evaluate
from stseg.geometry import Rig
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.simulation import NAMED, SceneFilm, Spoil
from stseg.simulation.crowd.social_forces import TRUTH
from stseg.simulation.rendering.render import RenderedView
from stseg.simulation.spoiling.errors import BOX_KINDS, MASK_KINDS, Moment
from stseg.simulation.spoiling.spoil import STRENGTHS, body_width, spoiled_boxes, spoiled_mask

NAMES = ("weak", "middle", "strong")
EXACT = "none"
"""Kind of the rows without an error."""


@dataclass(frozen=True)
class Shown:
    """A filmed crowd: its rig, truth, and the views of each frame without their images."""

    rig: Rig
    truth: Rows
    frames: list[tuple[RenderedView, ...]]

    def seen_by(self, chosen: Sequence[int]) -> Shown:
        """The same by some cameras."""
        rig = replace(self.rig, cameras=tuple(self.rig.cameras[k] for k in chosen))
        return Shown(rig, self.truth, [tuple(views[k] for k in chosen) for views in self.frames])

    def spoiled(self, spoils: Sequence[Spoil], by_boxes: bool) -> Iterator[tuple[Observation, ...]]:
        """What the cameras deliver of each frame, with errors."""
        centre = np.array([[np.mean(self.rig.grid.x), np.mean(self.rig.grid.y)]])
        widths = [body_width(camera, centre) for camera in self.rig.cameras]
        for frame, views in enumerate(self.frames):
            moments = [Moment(1, k, frame, self.rig.frame_rate, width) for k, width in enumerate(widths)]
            yield tuple(
                spoiled_boxes(view.boxes, spoils, moment)
                if by_boxes
                else spoiled_mask(view.mask, view.instances, spoils, moment)
                for view, moment in zip(views, moments, strict=True)
            )


def crowd(people: int, views: int, seconds: float, seed: int = NAMED["easy"].seed) -> Shown:
    """A crowd filmed by so many cameras."""
    whole = 8 if 8 % views == 0 else views
    spec = replace(
        NAMED["easy"], people=people, cameras=whole, seconds=seconds, frame_rate=10.0, size=(320, 240), seed=seed
    )
    film, frames, truth = SceneFilm(spec), [], [np.zeros(0, TRUTH)]
    for frame_set in film.frame_sets():
        frames.append(tuple(replace(view, image=np.zeros((0, 0, 3), np.uint8)) for view in frame_set.views))
        truth.append(frame_set.truth)
    return Shown(film.rig, np.concatenate(truth), frames).seen_by(range(0, whole, whole // views))


def recorded(rig: Path, truth: Path, first: int, stop: int) -> Shown:
    """A recording of masks, in which connected pieces stand for people."""
    recording, frames = read_recording(rig), []
    nobody = crowd(0, 1, 0.1).frames[0][0].boxes
    with open_frames(recording, first, stop) as sets:
        for frame_set in sets:
            masks = [np.asarray(view, np.uint8) for view in frame_set.views]
            pieces = [cv2.connectedComponents((mask > 127).astype(np.uint8))[1].astype(np.uint16) for mask in masks]
            frames.append(tuple(RenderedView(np.zeros((0, 0, 3), np.uint8), own, nobody) for own in pieces))
    rows = read_tracks_csv(truth)
    rows = rows[(rows["frame"] >= first) & (rows["frame"] < stop)].copy()
    rows["frame"] -= first
    return Shown(recording.rig, rows, frames)


def scores(shown: Shown, kind: str, strength: float) -> str:
    """MODA / IDF1 of the default tracker."""
    tracker, results = Tracker(shown.rig), []
    spoils = [] if kind == EXACT else [Spoil(kind, strength)]
    for views in shown.spoiled(spoils, kind in BOX_KINDS):
        results += tracker.add(views)
    results += tracker.finish()
    rows = tracker.tracks(results).trajectory
    flagged = "flag" in (shown.truth.dtype.names or ())
    found = evaluate(shown.truth, rows, frames=np.arange(len(shown.frames)), ignore_flagged=flagged)
    return f"{found.moda:.1f} / {found.idf1:.1f}"


def columns(asked: argparse.Namespace) -> dict[str, Shown]:
    """The recordings of the table, by their headings."""
    found = {
        f"{people} people, {views} views": crowd(people, views, asked.seconds)
        for people in map(int, asked.crowds.split(","))
        for views in map(int, asked.views.split(","))
    }
    if asked.uu4 is not None:
        found["uu4"] = recorded(asked.uu4, asked.uu4_truth, *map(int, asked.uu4_frames.split(":")))
    return found


def main() -> None:
    """Write the table."""
    parser = command_line(__doc__)
    parser.add_argument("--kinds", default=",".join((EXACT, *MASK_KINDS, *BOX_KINDS)))
    parser.add_argument("--strengths", default=",".join(NAMES))
    parser.add_argument("--views", default="2,3,4,8")
    parser.add_argument("--crowds", default="3,8,14")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--uu4", type=Path)
    parser.add_argument("--uu4-truth", type=Path)
    parser.add_argument("--uu4-frames", default="0:60")
    asked = parser.parse_args()
    shown = columns(asked)
    lines = [["error", "strength", *shown]]
    for kind in asked.kinds.split(","):
        for name in (EXACT,) if kind == EXACT else asked.strengths.split(","):
            strength = 0.0 if kind == EXACT else STRENGTHS[kind][NAMES.index(name)]
            cells = [
                "-" if one == "uu4" and kind in BOX_KINDS else scores(own, kind, strength) for one, own in shown.items()
            ]
            lines.append([kind, f"{name} {strength:g}", *cells])
            print(*lines[-1], flush=True)
            write_table(asked.output / "spoil.csv", lines)
