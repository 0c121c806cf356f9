"""Prepare one set of tools/result_sets.py, perturb it, track it in this process, and score it.

A perturbation shifts the ground's area by 10 cm in a random direction and the grid by up to half a cell, moves the
image of each camera by one pixel, and drops one box, or one frame of a view, in 200. People outside the area that all
perturbed runs share are not scored.
"""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from result_sets import ResultSet
from workbench import Bench

from stseg.arrays import Boxes, Observation, Rows, ViewEvidence
from stseg.config import Config
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import run_session
from stseg.evaluation import evaluate
from stseg.evaluation.scores import Scores
from stseg.evaluation.sequence import Area
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Camera, Rig
from stseg.io.detections.source_detections import appearance_axes
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.trajectories.final_tracks import CommittedRows

DROPPED = 1 / 200
"""Share of boxes, and of frames of a view without boxes, that a perturbed run does not see."""
AREA_SHIFT = 0.1
"""Shift of the ground's area, metres."""
_MARGIN = 0.2
"""Width of the ground's border that is not scored where a set has no area of its own, metres."""


@dataclass(frozen=True)
class Perturbed:
    """A foreground of which a few random boxes or frames are missing."""

    whole: ViewForeground
    rng: np.random.Generator

    def __getattr__(self, name: str) -> object:
        return getattr(self.whole, name)

    def evidence(self, seen: Observation) -> ViewEvidence:
        """The evidence of the frame, less what is dropped."""
        evidence = self.whole.evidence(seen)
        if isinstance(evidence, Boxes):
            return evidence.of(self.rng.random(len(evidence)) >= DROPPED)
        return None if self.rng.random() < DROPPED else evidence


def perturbed_rig(rig: Rig, rng: np.random.Generator) -> Rig:
    """The rig with another area, another phase of the grid, and cameras that are one pixel off."""
    angle = rng.uniform(0, 2 * np.pi)
    shift = AREA_SHIFT * np.array([np.cos(angle), np.sin(angle)]) + rng.uniform(-0.5, 0.5, 2) * rig.grid.cell
    (x0, x1), (y0, y1) = rig.grid.x, rig.grid.y
    polygon = None if rig.grid.polygon is None else rig.grid.polygon + shift
    grid = replace(rig.grid, x=(x0 + shift[0], x1 + shift[0]), y=(y0 + shift[1], y1 + shift[1]), polygon=polygon)
    return replace(rig, grid=grid, cameras=tuple(_shifted(camera, rng.uniform(0, 2 * np.pi)) for camera in rig.cameras))


def _shifted(camera: Camera, angle: float) -> Camera:
    """The camera, its (undistorted) image moved by one pixel."""
    if camera.lens is not None:
        return camera
    shift = np.eye(3)
    shift[:2, 2] = np.cos(angle), np.sin(angle)
    return replace(camera, ground=shift @ camera.ground, vertical=shift @ camera.vertical)


class Tracked(NamedTuple):
    """A perturbed run before its final tracks, and the perturbed rig's pipeline that finds them."""

    pipeline: Pipeline
    rows: CommittedRows


def tracked(one: ResultSet, bench: Bench, config: Config, seed: int, cameras: Sequence[int] | None = None) -> Tracked:
    """Track a perturbed recording of a set whose inputs are made, by all cameras or by some."""
    recording = read_recording(bench.path(one.rig))
    streams = np.random.SeedSequence(seed).spawn(1 + len(recording.sources))
    recording = replace(recording, rig=perturbed_rig(recording.rig, np.random.default_rng(streams[0])))
    recording = recording if cameras is None else _seen_by(recording, cameras)
    first, stop = map(int, one.frames.split(":"))
    kinds = ["boxes" if source.source.kind in ("boxes", "instances") else "pixels" for source in recording.sources]
    pipeline = Pipeline(recording.rig, kinds, config, "cut", appearance_axes(recording))
    pairs = zip(make_foregrounds(recording, config, first, stop), streams[1:], strict=False)
    foregrounds = [Perturbed(whole, np.random.default_rng(stream)) for whole, stream in pairs]
    frames_done: list[int] = []
    with open_frames(recording, first, stop) as frames:
        steps = list(run_session(pipeline, foregrounds, frames, first, frames_done.append))  # type: ignore[arg-type]
    trajectory, events = (np.concatenate([getattr(s.commit, name) for s in steps]) for name in ("trajectory", "events"))
    return Tracked(pipeline, CommittedRows(trajectory, events, np.concatenate([step.appearance for step in steps])))


def _seen_by(recording: Recording, cameras: Sequence[int]) -> Recording:
    """The recording by some cameras."""
    rig = replace(recording.rig, cameras=tuple(recording.rig.cameras[k] for k in cameras))
    return replace(recording, rig=rig, sources=tuple(recording.sources[k] for k in cameras))


def final_rows(run: Tracked) -> Rows:
    """TRAJECTORY of the final tracks of a run."""
    return run.pipeline.finished(run.rows)[0].trajectory


def scored(one: ResultSet, bench: Bench, rows: Rows) -> Scores:
    """Scores of the final tracks of a perturbed run."""
    assert one.truth is not None
    area = scored_area(one, read_recording(bench.path(one.rig)).rig)
    frames = np.arange(*map(int, one.frames.split(":")))
    flagged = "--ignore-flagged" in shlex.split(one.scoring)
    return evaluate(read_tracks_csv(bench.path(one.truth)), rows, area=area, frames=frames, ignore_flagged=flagged)


def scored_area(one: ResultSet, rig: Rig) -> Area:
    """The rectangle that is scored: the set's own, or the ground without its border."""
    for option in shlex.split(one.scoring):
        if option.startswith("--area="):
            x0, y0, x1, y1 = map(float, option.partition("=")[2].split(","))
            return x0, y0, x1, y1
    (x0, x1), (y0, y1) = rig.grid.x, rig.grid.y
    return x0 + _MARGIN, y0 + _MARGIN, x1 - _MARGIN, y1 - _MARGIN


def prepare(one: ResultSet, bench: Bench) -> None:
    """Make the set's rig and truth."""
    bench.work.mkdir(parents=True, exist_ok=True)
    if one.film is not None and not bench.path(one.rig).exists():
        bench.do(f"{one.film} --overwrite")
    for command in one.prepare:
        bench.do(command)
