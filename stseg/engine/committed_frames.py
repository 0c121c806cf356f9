"""Results of frames on which the tracker has decided: labels, track rows, candidates, error rates, timings."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from threading import Lock
from time import perf_counter
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Ints, Labels, Rows, Singles, ground_of
from stseg.geometry import Rig
from stseg.occupancy.error_rate_estimate import ErrorRateEstimate
from stseg.records.people import Explanation, People
from stseg.records.sparse_volume import SparseVolume
from stseg.records.tables import CANDIDATE, RATES, TIMING
from stseg.trackers import Commit


@dataclass(frozen=True)
class CommittedFrames:
    """Committed frames of a tracker, with their candidates, error rates and processing times.

    Attributes
    ----------
    commit
        Volume, labels, trajectory, events, windows.
    candidates : CANDIDATE (n,), parts : float32 (n, view)
        Every candidate of the frames, true or ghost, and the evidence of each view for it, nats.
    rates : RATES (view,)
        Error rates by which the last of the frames was fused; `residual` is a mean over all of them.
    timings : TIMING (k,)
    appearance : APPEARANCE (l,)
        What detections look like.
    shifts : SHIFT (j,)
        Shifts of images from their backgrounds, where they are measured.
    excluded : EXCLUDED_VIEW (i,)
        Views that are excluded after each frame.
    """

    commit: Commit
    candidates: Rows
    parts: Singles
    rates: Rows
    timings: Rows
    appearance: Rows
    shifts: Rows
    excluded: Rows

    def __repr__(self) -> str:
        frames = f"frames {self.frames[0]} to {self.frames[-1]}" if len(self.frames) else "no frames"
        return f"CommittedFrames({frames}: {len(self.trajectory)} track rows, {len(self.candidates)} candidates)"

    @property
    def frames(self) -> Ints:
        """Numbers of the frames, int64 (time,)."""
        return np.array([fused.frame for fused in self.commit.frames], np.int64)

    @property
    def trajectory(self) -> Rows:
        """TRAJECTORY (n,): people's places; the ids are those of the tracks so far."""
        return self.commit.trajectory

    @property
    def events(self) -> Rows:
        """EVENT (k,)."""
        return self.commit.events

    @property
    def detections(self) -> Rows:
        """CANDIDATE (m,): the detections of each frame by itself."""
        rows: Rows = self.candidates[self.candidates["status"] == 1]
        return rows

    @property
    def log_odds(self) -> Singles:
        """The volume, float32 (time, plane, y, x), nats; nan where no view sees the cell."""
        return np.stack([fused.log_odds for fused in self.commit.frames])

    @property
    def label(self) -> Labels:
        """Track ids of the volume, int32 (time, plane, y, x), 0 for background."""
        return self.commit.label

    def within(self, first: int, stop: int) -> CommittedFrames:
        """The results of frames first .. stop - 1; timings are kept whole."""
        commit, candidates = self.commit, self.candidates
        begin, end = np.searchsorted(self.frames, [first, stop]).tolist()
        candidate = _inside(candidates["frame"], first, stop)
        return CommittedFrames(
            Commit(
                commit.frames[begin:end],
                commit.labels[begin:end],
                commit.trajectory[_inside(commit.trajectory["frame"], first, stop)],
                commit.events[_inside(commit.events["frame"], first, stop)],
                commit.windows[_inside(commit.windows["commit_stop"] - 1, first, stop)],
            ),
            candidates[candidate],
            self.parts[candidate],
            self.rates[_inside(self.rates["frame"], first, stop)],
            self.timings,
            self.appearance[_inside(self.appearance["frame"], first, stop)],
            self.shifts[_inside(self.shifts["frame"], first, stop)],
            self.excluded[_inside(self.excluded["frame"], first, stop)],
        )


class FusedEvidence(NamedTuple):
    """A frame's volume, and the RATES (view,) by which it was fused."""

    volume: SparseVolume
    rates: Rows


class FrameRecord(NamedTuple):
    """Results of a frame until its commit; the fusion may be at work."""

    explanation: Explanation
    fusion: Future[FusedEvidence]
    appearance: Rows
    events: Rows
    shifts: Rows
    """APPEARANCE, EVENT of views, and SHIFT rows."""
    used: Flags
    """bool (view,): views with evidence that is used."""
    excluded: Rows
    """EXCLUDED_VIEW (n,)."""


def committed_frames(commit: Commit, records: dict[int, FrameRecord], watch: Stopwatch) -> CommittedFrames:
    """The results of a tracker's commit; takes its frames out of `records` and their time out of `watch`."""
    rows, parts, residuals, appearance, shifts, excluded, events = [], [], [], [], [], [], [commit.events]
    for fused in commit.frames:
        explanation, fusion, rows_of_frame, of_views, measured, _, of_frame = records.pop(fused.frame)
        rates = fusion.result().rates
        appearance.append(rows_of_frame)
        shifts.append(measured)
        excluded.append(of_frame)
        events.append(of_views)
        residuals.append(explanation.residual)
        for status, candidates in ((1, explanation.people), (0, explanation.ghosts)):
            rows.append(_candidate_rows(fused.frame, status, candidates))
            parts.append(candidates.view_evidence.T)
    values, finite = np.array(residuals), np.isfinite(residuals)
    mean = np.where(finite, values, 0).sum(0) / np.maximum(finite.sum(0), 1)
    rates["residual"] = np.where(finite.any(0), mean, np.nan)
    window = int(commit.windows["index"][0]) if len(commit.windows) else commit.frames[0].frame
    commit = replace(commit, events=np.concatenate(events))
    return CommittedFrames(
        commit,
        np.concatenate(rows),
        np.concatenate(parts).astype(np.float32),
        rates,
        watch.take(window),
        np.concatenate(appearance),
        np.concatenate(shifts),
        np.concatenate(excluded),
    )


def rate_rows(frame: int, estimate: ErrorRateEstimate) -> Rows:
    """RATES (view,) of a frame, by the error rates known before it."""
    rows = np.zeros(len(estimate.rates), RATES)
    rows["frame"], rows["view"], rows["occupied_share"] = frame, np.arange(len(rows)), estimate.filled_share
    rows["residual"] = np.nan
    rows["miss"], rows["clutter"], rows["person_clutter"] = np.array(estimate.rates).T
    return rows


def _inside(frame: Ints, first: int, stop: int) -> Flags:
    return np.asarray((first <= frame) & (frame < stop))


def _candidate_rows(frame: int, status: int, people: People) -> Rows:
    rows = np.zeros(len(people), CANDIDATE)
    rows["frame"], rows["status"], rows["height"], rows["evidence"] = frame, status, people.height, people.evidence
    rows["x"], rows["y"] = people.ground[:, 0], people.ground[:, 1]
    rows["xx"], rows["xy"], rows["yy"] = people.covariance.reshape(-1, 4).T[[0, 1, 3]]
    return rows


def within_area(commit: Commit, rig: Rig) -> Commit:
    """A commit without the rows, and labels, of people outside the area; in closed rooms nobody is outside."""
    rows = commit.trajectory
    inside = rig.grid.contains(ground_of(rows))
    if rig.closed or inside.all():
        return commit
    outside, pairs = rows[~inside], zip(commit.frames, commit.labels, strict=True)
    labels = [cells.without(outside["id"][outside["frame"] == fused.frame]) for fused, cells in pairs]
    return replace(commit, labels=labels, trajectory=rows[inside])


@dataclass
class Stopwatch:
    """Seconds of each stage since the last call of `take`; stages may run in threads of their own."""

    seconds: dict[str, float] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add the duration of the body to a stage."""
        start = perf_counter()
        try:
            yield
        finally:
            with self._lock:
                self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - start

    def take(self, window: int) -> Rows:
        """TIMING rows of all stages under the number of a window; the sums start anew."""
        with self._lock:
            seconds, self.seconds = self.seconds, {}
        return np.array([(stage.encode(), window, s) for stage, s in seconds.items()], TIMING)
