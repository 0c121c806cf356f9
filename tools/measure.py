"""Track and score one set of tools/result_sets.py in this process: on fewer views, spoiled, or perturbed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from stseg.io.recording.appearance_axes import appearance_axes
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.io.track_csv import read_tracks_csv

DROPPED = 1 / 200
"""Share of boxes, and of frames of a view without boxes, that a perturbed run does not see."""


class Perturbed(ViewForeground):
    """A foreground of which a few random boxes or frames are missing."""

    def __init__(self, whole: ViewForeground, rng: np.random.Generator) -> None:
        super().__init__(whole.background)
        self._rng = rng

    def evidence(self, seen: Observation) -> ViewEvidence:
        """The evidence of the frame, less what is dropped."""
        evidence = super().evidence(seen)
        if isinstance(evidence, Boxes):
            kept = self._rng.random(len(evidence)) >= DROPPED
            return evidence.of(kept)
        return None if self._rng.random() < DROPPED else evidence


@dataclass(frozen=True)
class Committed:
    """Rows of a whole recording as the tracker committed them, and what the identity search needs besides."""

    trajectory: Rows
    events: Rows
    appearance: Rows


@dataclass(frozen=True)
class Outcome:
    """Trajectories before and after the final association over the whole recording."""

    committed: Rows
    finished: Rows


def track(
    recording: Recording, first: int, stop: int, tracker: str, config: Config, seed: int | None = None
) -> Outcome:
    """Track a recording; with a seed, perturbed."""
    pipeline = _pipeline(recording, config, tracker)
    rows = committed(recording, pipeline, first, stop, seed)
    finished = pipeline.finished(rows.trajectory, rows.events, rows.appearance)[0]
    return Outcome(rows.trajectory, finished.trajectory)


def commit_rows(recording: Recording, first: int, stop: int, tracker: str, config: Config, seed: int) -> Committed:
    """What the tracker commits on perturbed evidence."""
    return committed(recording, _pipeline(recording, config, tracker), first, stop, seed)


def committed(recording: Recording, pipeline: Pipeline, first: int, stop: int, seed: int | None) -> Committed:
    """What the pipeline's tracker commits; with a seed, on perturbed evidence."""
    foregrounds: Sequence[ViewForeground] = make_foregrounds(recording, pipeline.config, first, stop)
    if seed is not None:
        streams = np.random.SeedSequence(seed).spawn(len(foregrounds))
        pairs = zip(foregrounds, streams, strict=True)
        foregrounds = [Perturbed(whole, np.random.default_rng(stream)) for whole, stream in pairs]
    done: list[int] = []
    with open_frames(recording, first, stop) as frames:
        steps = list(run_session(pipeline, foregrounds, frames, first, done.append))
    trajectory, events = (np.concatenate([getattr(s.commit, name) for s in steps]) for name in ("trajectory", "events"))
    return Committed(trajectory, events, np.concatenate([step.appearance for step in steps]))


def _pipeline(recording: Recording, config: Config, tracker: str) -> Pipeline:
    kinds = ["boxes" if source.source.kind in ("boxes", "instances") else "pixels" for source in recording.sources]
    return Pipeline(recording.rig, kinds, config, tracker, appearance_axes(recording))


def first_views(recording: Recording, number: int) -> Recording:
    """The first cameras of a recording."""
    rig = replace(recording.rig, cameras=recording.rig.cameras[:number])
    return replace(recording, rig=rig, sources=recording.sources[:number])


def score(one: ResultSet, rows: Rows, bench: Bench, first: int, stop: int) -> Scores:
    """Scores of tracks, with the set's own options."""
    assert one.truth is not None
    truth, frames = read_tracks_csv(bench.path(one.truth)), np.arange(first, stop)
    flagged = "--ignore-flagged" in shlex.split(one.scoring)
    return evaluate(truth, rows, area=area_of(one), frames=frames, ignore_flagged=flagged)


def area_of(one: ResultSet) -> Area | None:
    """The rectangle that is scored, None for all."""
    for option in shlex.split(one.scoring):
        if option.startswith("--area="):
            x0, y0, x1, y1 = map(float, option.partition("=")[2].split(","))
            return x0, y0, x1, y1
    return None


def prepared(one: ResultSet, bench: Bench) -> Recording:
    """The set's recording; its rig and truth are made."""
    prepare(one, bench)
    return read_rig(bench.path(one.rig))


def prepare(one: ResultSet, bench: Bench) -> None:
    """Make the set's rig and truth."""
    bench.work.mkdir(parents=True, exist_ok=True)
    if one.film is not None and not bench.path(one.rig).exists():
        bench.do(f"{one.film} --overwrite")
    for command in one.prepare:
        bench.do(command)
