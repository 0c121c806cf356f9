"""One pass of a recording, or of a part of it, through the stages: frame sets in, committed results out.

All that is learned from the frames belongs to the session: the foreground models, the noise of boxes, the error rates
of the views, and the tracker's tracks. Sessions of one pipeline know nothing of each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

from stseg.arrays import Observation, Singles, ViewEvidence
from stseg.engine.committed_frames import CommittedFrames, FrameRecord, committed_frames, rate_rows
from stseg.engine.pipeline import Pipeline
from stseg.engine.stopwatch import Stopwatch
from stseg.foreground.view_foreground import ViewForeground
from stseg.model.people import Explanation
from stseg.model.predicted_tracks import PredictedTracks
from stseg.trackers import FrameObservations, FusedFrame


class FrameSet(Protocol):
    """The observations of all cameras at one time (`stseg.io.recording.frames.FrameSet`)."""

    @property
    def frame(self) -> int: ...
    @property
    def views(self) -> Sequence[Observation]: ...


class Session:
    """A run of the stages over consecutive frame sets.

    Parameters
    ----------
    pipeline
        The stages.
    foregrounds
        Foreground model of each camera, in the rig's order; they learn from the frames.
    first
        Number of the first frame.
    """

    def __init__(self, pipeline: Pipeline, foregrounds: Sequence[ViewForeground], first: int) -> None:
        self.pipeline, self.foregrounds, self.watch = pipeline, foregrounds, Stopwatch()
        self._tracker = pipeline.tracker(pipeline.rig, pipeline.config, first)
        self._box_noise = pipeline.detector.new_calibration()
        self._error_rates = pipeline.occupancy.new_calibration()
        self._records: dict[int, FrameRecord] = {}

    def add(self, frame_set: FrameSet) -> list[CommittedFrames]:
        """The next frame set; the results that it decides."""
        fused, observed = self._fuse(frame_set, self._tracker.predict(frame_set.frame))
        with self.watch.time("track"):
            commits = self._tracker.add(fused, observed)
        return [committed_frames(commit, self._records, self.watch) for commit in commits]

    def finish(self) -> list[CommittedFrames]:
        """No more frame sets; the results of all frames that are still open."""
        with self.watch.time("track"):
            commits = self._tracker.finish()
        return [committed_frames(commit, self._records, self.watch) for commit in commits]

    def _fuse(self, frame_set: FrameSet, expected: PredictedTracks | None) -> tuple[FusedFrame, FrameObservations]:
        stages, watch = self.pipeline, self.watch
        with watch.time("foreground"):
            views = zip(self.foregrounds, frame_set.views, strict=True)
            evidence = [foreground.evidence(view) for foreground, view in views]
        with watch.time("ghosts"):
            proposed = stages.proposals.of(evidence, self._fuse_with_current_rates)
            explanation = stages.detector.explain_next(self._box_noise, evidence, expected, proposed)
        self._records[frame_set.frame] = FrameRecord(explanation, rate_rows(frame_set.frame, self._error_rates))
        with watch.time("occupancy"):
            log_odds = stages.occupancy.fuse_and_learn(self._error_rates, evidence, explanation)
        fused = FusedFrame(frame_set.frame, explanation.people, explanation.ghosts, log_odds)
        return fused, FrameObservations(frame_set.views, evidence)

    def _fuse_with_current_rates(self, evidence: Sequence[ViewEvidence], explanation: Explanation) -> Singles:
        return self.pipeline.occupancy.fuse(evidence, explanation, self._error_rates.rates)


def run_session(
    pipeline: Pipeline,
    foregrounds: Sequence[ViewForeground],
    frame_sets: Iterable[FrameSet],
    first: int,
    advance: Callable[[int], None],
) -> Iterator[CommittedFrames]:
    """The results of frame sets in a session of their own, each as soon as it is decided.

    Parameters
    ----------
    pipeline, foregrounds, first
        As of `Session`.
    frame_sets
        In the order of time.
    advance
        Called with the number of each frame that was fused.
    """
    session = Session(pipeline, foregrounds, first)
    coming = iter(frame_sets)
    while True:
        with session.watch.time("read"):
            frame_set = next(coming, None)
        if frame_set is None:
            break
        yield from session.add(frame_set)
        advance(frame_set.frame)
    yield from session.finish()
