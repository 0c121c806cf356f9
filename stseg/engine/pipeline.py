"""The whole way, top to bottom: moments of a recording become tracks and a volume.

    observation -> evidence -> explanation -> volume -> window -> cut -> pieces -> tracks
    (foreground)   (ghosts)    (occupancy)   (trackers: segmentation, identity)

Files, windows of progress bars and printing are the callers': they hand in moments and take what is committed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Observation, Rows
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.detection.proposals import Proposals
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable
from stseg.model.people import Explanation, People
from stseg.model.predicted_tracks import PredictedTracks
from stseg.model.tables import CANDIDATE, RATES, TIMING, Tracks
from stseg.occupancy.rate_calibration import RateCalibration
from stseg.occupancy.volume import Occupancy
from stseg.trackers import Commit, FrameObservations, FusedFrame, find_tracker
from stseg.tracking.final_tracks import committed_tracks, final_tracks
from stseg.tracking.track_boxes import box_rows


class FrameSet(Protocol):
    """What all cameras saw at one time: `stseg.io.recording.frames.Moment`."""

    @property
    def frame(self) -> int: ...
    @property
    def views(self) -> Sequence[Observation]: ...


@dataclass
class Stopwatch:
    """Seconds of each stage since the last time they were taken."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add what the body takes to a stage."""
        start = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - start

    def take(self, window: int) -> Rows:
        """TIMING rows of what was timed since, and start anew."""
        rows = np.array([(stage.encode(), window, s) for stage, s in self.seconds.items()], TIMING)
        self.seconds = {}
        return rows


@dataclass(frozen=True)
class CommittedFrames:
    """What is decided about some frames: the tracker's commit, the weighed candidates, the time it took.

    Attributes
    ----------
    commit
        Volume, labels, trajectory, events, windows.
    candidates : CANDIDATE (n,), parts : float32 (n, view)
        Every candidate of the frames, true or ghost, and what each view says of it, nats.
    rates : RATES (view,)
        By which the last of the frames was fused; `aside` of all of them.
    timings : TIMING (k,)
    """

    commit: Commit
    candidates: Rows
    parts: Floats
    rates: Rows
    timings: Rows

    def within(self, first: int, stop: int) -> CommittedFrames:
        """What is decided about frames first .. stop - 1, in all the time that it took."""
        commit, candidates = self.commit, self.candidates
        kept = np.array([first <= scene.frame < stop for scene in commit.scenes], bool)
        shown = np.flatnonzero(kept).tolist()
        weighed = _inside(candidates["frame"], first, stop)
        windows = commit.windows[_inside(commit.windows["commit_stop"] - 1, first, stop)]
        return CommittedFrames(
            Commit(
                [commit.scenes[k] for k in shown],
                commit.label[kept],
                commit.trajectory[_inside(commit.trajectory["frame"], first, stop)],
                commit.events[_inside(commit.events["frame"], first, stop)],
                windows,
            ),
            candidates[weighed],
            self.parts[weighed],
            self.rates[_inside(self.rates["frame"], first, stop)],
            self.timings,
        )


class Pipeline:
    """The stages of one rig.

    Parameters
    ----------
    rig
        The cameras and the grid.
    sights
        Each camera's way from observation to evidence.
    kinds
        What that evidence is: "boxes" or "pixels".
    config
        The constants of all stages.
    tracker
        Its name, one of `stseg.trackers.TRACKERS`.
    """

    def __init__(
        self, rig: Rig, sights: Sequence[ViewForeground], kinds: Sequence[str], config: Config, tracker: str
    ) -> None:
        self.rig, self.sights, self.config, self.tracker = rig, sights, config, find_tracker(tracker)
        self.frame_pass = Detector(rig, kinds, config.ghosts, config.level)
        self.occupancy = Occupancy(rig, kinds, config.occupancy, config.ghosts, config.level)
        self.candidates = Proposals(rig, self.occupancy.fuse, kinds, config)

    def seeing_by(self, sights: Sequence[ViewForeground]) -> Pipeline:
        """The same stages with other sights, for another part of the recording."""
        other = copy(self)
        other.sights = sights
        return other

    def steps(
        self, moments: Iterable[FrameSet], first: int, advance: Callable[[int], None]
    ) -> Iterator[CommittedFrames]:
        """Run over moments, from frame `first` on; yields what is decided as soon as it is.

        `advance` is told each frame that was fused. Nothing is known from moments that
        were run over before.
        """
        passage = Session(self, first)
        moments = iter(moments)
        while True:
            with passage.watch.time("read"):
                moment = next(moments, None)
            if moment is None:
                break
            yield from passage.add(moment)
            advance(moment.frame)
        yield from passage.finish()

    def finished(self, committed: Rows, events: Rows, shown: Rig | None = None) -> tuple[Tracks, Ints]:
        """The tracks of the whole run from all committed rows and events, and the identity of each committed row.

        Boxes are in the pixels of the rig `shown`, where it is not this one.
        """
        rate, config = self.rig.frame_rate, self.config
        if self.tracker.final:
            whole = committed_tracks(committed, events, rate, config.identity)
        else:
            whole = final_tracks(committed, events, rate, self.frame_pass.border, config.identity, config.ghosts)
        tables = [view.table for view in self.frame_pass.views]
        if shown is not None:
            tables = [BodyTable.of(camera, shown.grid) for camera in shown.cameras]
        return Tracks(whole.trajectory, box_rows(tables, whole.trajectory), whole.events), whole.identity


class Session:
    """A pipeline under way: takes moments as they come, and gives what is decided by each. One at a time of a pipeline.

    Parameters
    ----------
    pipeline
        The stages. Nothing is known from moments that they were run over before.
    first
        The first frame.
    """

    def __init__(self, pipeline: Pipeline, first: int) -> None:
        self.pipeline, self.watch = pipeline, Stopwatch()
        self._tracker = pipeline.tracker(pipeline.rig, pipeline.config, first)
        self._explained: dict[int, _Explained] = {}
        pipeline.frame_pass.reset()
        pipeline.occupancy.forget()

    def add(self, moment: FrameSet) -> list[CommittedFrames]:
        """The next moment; what is decided by it."""
        scene, shown, self._explained[moment.frame] = self._scene(moment, self._tracker.expected(moment.frame))
        with self.watch.time("track"):
            commits = self._tracker.add(scene, shown)
        return [_step(commit, self._explained, self.watch) for commit in commits]

    def finish(self) -> list[CommittedFrames]:
        """No more moments; what was still open."""
        with self.watch.time("track"):
            commits = self._tracker.finish()
        return [_step(commit, self._explained, self.watch) for commit in commits]

    def _scene(
        self, moment: FrameSet, expected: PredictedTracks | None
    ) -> tuple[FusedFrame, FrameObservations, _Explained]:
        stages, watch = self.pipeline, self.watch
        with watch.time("foreground"):
            seen = [sight.evidence(view) for sight, view in zip(stages.sights, moment.views, strict=True)]
        with watch.time("ghosts"):
            explanation = stages.frame_pass.explain_next(seen, expected, stages.candidates.of(seen))
        rates = _rate_rows(moment.frame, stages.occupancy.level)
        with watch.time("occupancy"):
            log_odds = stages.occupancy.follow(seen, explanation)
        scene = FusedFrame(moment.frame, explanation.people, explanation.ghosts, log_odds)
        return scene, FrameObservations(moment.views, seen), _Explained(explanation, rates)


class _Explained(NamedTuple):
    """A frame's explanation, and the RATES (view,) by which it was fused."""

    explanation: Explanation
    rates: Rows


def _inside(frame: Ints, first: int, stop: int) -> Flags:
    return np.asarray((first <= frame) & (frame < stop))


def _step(commit: Commit, explained: dict[int, _Explained], watch: Stopwatch) -> CommittedFrames:
    rows, parts, aside = [], [], []
    for scene in commit.scenes:
        explanation, rates = explained.pop(scene.frame)
        aside.append(explanation.residual)
        for status, weighed in ((1, explanation.people), (0, explanation.ghosts)):
            rows.append(_candidate_rows(scene.frame, status, weighed))
            parts.append(weighed.view_evidence.T)
    rates["aside"] = _mean_told(np.array(aside))
    window = int(commit.windows["index"][0]) if len(commit.windows) else commit.scenes[0].frame
    return CommittedFrames(
        commit, np.concatenate(rows), np.concatenate(parts).astype(np.float32), rates, watch.take(window)
    )


def _mean_told(values: Floats) -> Floats:
    """Mean over frames (frame, view) of what is not nan; nan where everything is."""
    told = np.isfinite(values)
    return np.where(told.any(0), np.where(told, values, 0).sum(0) / np.maximum(told.sum(0), 1), np.nan)


def _rate_rows(frame: int, level: RateCalibration) -> Rows:
    rows = np.zeros(len(level.rates), RATES)
    rows["frame"], rows["view"], rows["filled"] = frame, np.arange(len(rows)), level.filled_share
    rows["aside"] = np.nan
    rows["miss"], rows["clutter"], rows["beside"] = np.array(level.rates).T
    return rows


def _candidate_rows(frame: int, status: int, people: People) -> Rows:
    rows = np.zeros(len(people), CANDIDATE)
    rows["frame"], rows["status"], rows["height"], rows["evidence"] = frame, status, people.height, people.evidence
    rows["x"], rows["y"] = people.ground[:, 0], people.ground[:, 1]
    rows["xx"], rows["xy"], rows["yy"] = (
        people.covariance[:, 0, 0],
        people.covariance[:, 0, 1],
        people.covariance[:, 1, 1],
    )
    return rows
