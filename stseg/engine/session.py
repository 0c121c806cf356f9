"""One pass of a recording, or of a part of it, through the stages: frame sets in, committed results out.

All that is learned from the frames belongs to the session: the foreground models, the noise of boxes, the population of
body sizes, the error rates of the views, and the tracker's tracks. Sessions of one pipeline know nothing of each other.

Detection needs the tracks of the frame before, so it goes frame by frame. The foreground of the next frames needs
nothing of it; it waits neither for a frame's volume nor for the cut of a window: `run_session` gives them a thread for
each further core, from the frame on at which it has one. Every stage still takes the frames in their order, so the
results are the same, bit for bit.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np

from stseg.arrays import Rows, Singles, ViewEvidence
from stseg.bodies.box_fit import BoxNoise
from stseg.engine.committed_frames import (
    CommittedFrames,
    FrameRecord,
    FusedEvidence,
    Stopwatch,
    committed_frames,
    rate_rows,
    within_area,
)
from stseg.engine.pipeline import Pipeline
from stseg.engine.reporter import Advance
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.frames import FrameSet
from stseg.records.people import Explanation
from stseg.records.tables import EVENT, SHIFT
from stseg.trackers import Commit, FrameObservations, FusedFrame
from stseg.trackers.alternative_tracks import AlternativeTracks
from stseg.trackers.cut import CutTracker
from stseg.trackers.rows import fill_views
from stseg.view_health.blind_views import ExcludedViews, FrozenViews
from stseg.view_health.hand_over import NOTHING_BEFORE, SegmentStart, excluded_rows, take_over
from stseg.view_health.image_shifts import image_shifts, shift_is_due

_AHEAD = 2
"""Frames whose foreground is made before their detection."""
_BEHIND = 4
"""Frames whose fusion may be open while detection goes on."""


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
    factors
        Reduction factor of each camera's images, whose shifts are measured then; None to measure none.
    start
        Where it continues a segment before.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        foregrounds: Sequence[ViewForeground],
        first: int,
        factors: Sequence[int] | None = None,
        start: SegmentStart = NOTHING_BEFORE,
    ) -> None:
        self.pipeline, self.foregrounds, self.watch = pipeline, foregrounds, Stopwatch()
        self._tracker = pipeline.tracker(pipeline.rig, pipeline.config, first)
        cameras = [camera.name for camera in pipeline.rig.cameras]
        self._frozen = FrozenViews(len(cameras), pipeline.rig.frame_rate)
        self._excluded = ExcludedViews(cameras, start)
        self._estimates = pipeline.detector.new_estimates()
        take_over(self._estimates.failures, start.excluded)
        self.excluded = start.excluded
        """EXCLUDED_VIEW (n,): after the last frame."""
        self._error_rates = pipeline.occupancy.new_error_rates()
        self._records: dict[int, FrameRecord] = {}
        self._alternative = AlternativeTracks(pipeline.rig.frame_rate)
        self._factors, self._shifts = factors, dict[int, Rows]()
        self._fusion: Executor | None = None
        self._open: deque[Future[FusedEvidence]] = deque()

    def share(self, fusion: Executor, cuts: Executor) -> None:
        """From now on fuse evidence, and cut windows, in a thread each while detection goes on."""
        self._fusion = fusion
        if isinstance(self._tracker, CutTracker):
            watch = self.watch  # and not self: a session in a cycle would outlive its segment with all its volumes
            self._tracker.solve_by(lambda solution: cuts.submit(watch.time("tracking")(solution)))

    def follow(self, before: "Session") -> None:
        """Exclude from the next frame on what another session does, which has had the same last frame."""
        self._excluded.since = list(before._excluded.since)
        take_over(self._estimates.failures, before.excluded)

    def evidence(self, frame_set: FrameSet) -> list[ViewEvidence]:
        """The foreground of all views; to be called once for each frame set, in the order of time."""
        if self._factors is not None and shift_is_due(frame_set.frame, self.pipeline.rig.frame_rate):
            monitors = [foreground.background for foreground in self.foregrounds]
            images = [None if monitor is None else monitor.model.background_image() for monitor in monitors]
            self._shifts[frame_set.frame] = image_shifts(frame_set.frame, frame_set.views, images, self._factors)
        with self.watch.time("foreground"):
            views = zip(self.foregrounds, self._frozen.without(frame_set.views), strict=True)
            return [foreground.evidence(view) for foreground, view in views]

    def add(self, frame_set: FrameSet, evidence: list[ViewEvidence] | None = None) -> list[CommittedFrames]:
        """The results that the next frame set decides, with its evidence where `evidence` was called for it before."""
        evidence = self.evidence(frame_set) if evidence is None else evidence
        sizes = [camera.size for camera in self.pipeline.rig.cameras]
        evidence = self._estimates.box_bias.corrected(evidence, sizes)
        noise, failures = self._estimates.box_noise.noise, self._estimates.failures
        frame, predicted = frame_set.frame, self._tracker.predict(frame_set.frame)
        with self.watch.time("detection"):
            source = self.pipeline.proposals
            proposed = source.of(failures.kept(evidence), self._fuse_with_current_rates) if source else None
            detector, alternative = self.pipeline.detector, self._alternative.predict(frame)
            explanation = detector.explain_next(self._estimates, frame, evidence, predicted, proposed, alternative)
        explanation = self._decided(frame, explanation)
        events = self._excluded.events(frame, frame_set.views, evidence, failures)
        self.excluded = excluded_rows(frame, failures, self._excluded.since)
        if explanation.unfinished:
            reason = f"{explanation.unfinished} candidates interact: not searched to the end"
            events = np.append(events, np.array([(frame, b"crowd", 0, 0, reason.encode())], EVENT))
        used = failures.kept(evidence)
        is_used = np.array([view is not None for view in used], bool)
        fusion = self._submit(partial(self._fuse, frame, used, explanation, noise))
        with self.watch.time("appearance"):
            appearance = self.pipeline.appearance_rows(frame, explanation, frame_set.views, used, frame_set.images)
        shifts = self._shifts.pop(frame, np.zeros(0, SHIFT))
        self._records[frame] = FrameRecord(explanation, fusion, appearance, events, shifts, is_used, self.excluded)
        fused = FusedFrame(frame, explanation.people, explanation.ghosts, lambda: fusion.result().volume)
        with self.watch.time("tracking"):
            commits = self._tracker.add(fused, FrameObservations(frame_set.views, used))
        return [self._committed(commit) for commit in commits]

    def finish(self) -> list[CommittedFrames]:
        """No more frame sets; the results of all frames that are still open."""
        with self.watch.time("tracking"):
            commits = self._tracker.finish()
        return [self._committed(commit) for commit in commits]

    def _decided(self, frame: int, explanation: Explanation) -> Explanation:
        """A frame's explanation, or an alternative that replaces the tracks: then in earlier frames, too."""
        if not isinstance(self._tracker, CutTracker):
            return explanation
        decision = self._alternative.add(frame, explanation, self._tracker.filter)
        if decision is None:
            return explanation
        for earlier in self._tracker.take(decision):
            record, revised = self._records[earlier], decision.readings[earlier].explanation
            revised = replace(revised, residual=record.explanation.residual)
            self._records[earlier] = record._replace(explanation=revised)
        return replace(decision.explanation, residual=explanation.residual)

    def _committed(self, commit: Commit) -> CommittedFrames:
        within, used = within_area(commit, self.pipeline.rig), {k: one.used for k, one in self._records.items()}
        fill_views(within.trajectory, self.pipeline.rig, used)
        return committed_frames(within, self._records, self.watch)

    def _submit(self, fuse: Callable[[], FusedEvidence]) -> Future[FusedEvidence]:
        if self._fusion is None:
            done = Future[FusedEvidence]()
            done.set_result(fuse())
            return done
        if len(self._open) == _BEHIND:
            self._open.popleft().result()
        self._open.append(self._fusion.submit(fuse))
        return self._open[-1]

    def _fuse(
        self, frame: int, evidence: Sequence[ViewEvidence], explanation: Explanation, noise: BoxNoise
    ) -> FusedEvidence:
        rates = rate_rows(frame, self._error_rates)
        with self.watch.time("occupancy"):
            volume = self.pipeline.occupancy.fuse_and_learn(self._error_rates, evidence, explanation, noise)
        return FusedEvidence(volume, rates)

    def _fuse_with_current_rates(self, evidence: Sequence[ViewEvidence], explanation: Explanation) -> Singles:
        while self._open:
            self._open.popleft().result()
        rates, noise = self._error_rates.rates, self._estimates.box_noise.noise
        return self.pipeline.occupancy.fuse(evidence, explanation, rates, noise).dense()


_Prepared = tuple[FrameSet, list[ViewEvidence]]
"""A frame set and its evidence."""


def two_cores() -> int:
    """Default number of cores of a session."""
    return 2


def run_session(
    pipeline: Pipeline,
    foregrounds: Sequence[ViewForeground],
    frame_sets: Iterable[FrameSet],
    first: int,
    advance: Advance,
    cores: Callable[[], int] = two_cores,
    factors: Sequence[int] | None = None,
    start: SegmentStart = NOTHING_BEFORE,
) -> Iterator[CommittedFrames]:
    """The results of frame sets, in the order of time, in a `Session` of their own, each as soon as it is decided.

    `advance` receives the number of each frame that went through detection. `cores` says how many processor cores the
    session has from the next frame on; with one it has no threads but those that decode.
    """
    with ExitStack() as threads:
        session = Session(pipeline, foregrounds, first, factors, start)
        for frame_set, evidence in _prepared(session, iter(frame_sets), cores, threads):
            yield from session.add(frame_set, evidence)
            advance(frame_set.frame)
        yield from session.finish()


def _next_prepared(session: Session, coming: Iterator[FrameSet]) -> _Prepared | None:
    """The next frame set with its evidence; None after the last."""
    with session.watch.time("read"):
        frame_set = next(coming, None)
    return None if frame_set is None else (frame_set, session.evidence(frame_set))


def _prepared(
    session: Session, coming: Iterator[FrameSet], cores: Callable[[], int], threads: ExitStack
) -> Iterator[_Prepared]:
    """Frame sets with their evidence; with several cores some are made while the caller works on the last."""
    while (free := cores()) < 2:
        if (prepared := _next_prepared(session, coming)) is None:
            return
        yield prepared
    number = min(free - 1, 3)  # more threads than cores wait for the interpreter
    helpers = [threads.enter_context(ThreadPoolExecutor(1, "helper")) for _ in range(number)]
    ahead, fusion, cuts = (helpers[k % number] for k in range(3))
    session.share(fusion, cuts)
    waiting = deque(ahead.submit(_next_prepared, session, coming) for _ in range(_AHEAD))
    try:
        while (prepared := waiting.popleft().result()) is not None:
            waiting.append(ahead.submit(_next_prepared, session, coming))
            yield prepared
    finally:
        for future in waiting:
            future.cancel()
