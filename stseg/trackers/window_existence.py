"""Revision of the detections of a window's frames by a decision of existence over the whole window."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.config import Config
from stseg.geometry import Rig
from stseg.graphcut.solvers import Solver
from stseg.occupancy.revision import revised_volume
from stseg.records.border import Border
from stseg.records.people import People
from stseg.segmentation.candidate_links import LinkModel, WindowCandidates
from stseg.segmentation.existence import Existence, ExistenceModel
from stseg.trackers.protocol import FusedFrame
from stseg.tracking.filter.prediction import DetectionHistory

_LEAST_LOG_ODDS = 3.0
"""Log-odds above which a candidate is sure, nats: 20 to 1."""


@dataclass(frozen=True)
class TrackedFrame:
    """A frame and the filter track of each detection, int64 (n,)."""

    fused: FusedFrame
    tracks: Ints

    @cached_property
    def candidates(self) -> People:
        """Its people, then its ghosts: several windows ask for them."""
        return self.fused.people.joined_with(self.fused.ghosts)

    def detections(self) -> DetectionHistory:
        """Its detections."""
        people, frame = self.fused.people, np.full(len(self.tracks), self.fused.frame)
        return DetectionHistory(frame, self.tracks, people.ground, people.covariance, people.height)


class WindowExistence:
    """Revision of the frames of a window of one scene, with a solver of the minimum cuts."""

    def __init__(self, rig: Rig, config: Config, solver: Solver) -> None:
        self.grid, self.solver, self.config = rig.grid, solver, config
        longest_absence, prior = config.tracking.interpolation_gap, config.detection.prior_log_odds
        links = LinkModel(rig.frame_rate, longest_absence, prior, config.motion, config.body)
        radius = config.occupancy.person_radius
        self.model = ExistenceModel(links, radius, Border.of(rig), config.detection, config.body)

    def revised(self, frames: Sequence[TrackedFrame], first: int, stop: int) -> list[TrackedFrame]:
        """Frames first .. stop - 1 with the people that are real by all frames given, those before and after too."""
        found = _candidates(frames)
        decision = self.model.decide(found, self.solver.sparse)
        inside = self.model.border.inside(found.ground, self.model.detection.border_width) >= 1
        tracks = tracks_of(found, decision, inside)
        bounds = np.searchsorted(found.frame, np.arange(len(frames) + 1))
        return [
            self._frame(one, tracks[rows], decision.log_odds[rows])
            for one, rows in zip(frames, map(slice, bounds, bounds[1:]), strict=False)
            if first <= one.fused.frame < stop
        ]

    def _frame(self, one: TrackedFrame, tracks: Ints, log_odds: Floats) -> TrackedFrame:
        """One frame with the candidates that have a track as people, the others as ghosts; evidence of the window."""
        fused, number = one.fused, len(one.tracks)
        real = tracks > 0
        candidates = replace(one.candidates, evidence=log_odds)
        people, ghosts = candidates.at(np.flatnonzero(real)), candidates.at(np.flatnonzero(~real))
        if not real[:number].all() or real[number:].any():
            added = candidates.at(number + np.flatnonzero(real[number:]))
            before, volume = fused.people.ground, fused.volume
            made = revised_volume(volume, before, people.ground, added, self.grid, self.config)
            fused = replace(fused, made=made)
        return TrackedFrame(replace(fused, people=people, ghosts=ghosts), tracks[real])


def _candidates(frames: Sequence[TrackedFrame]) -> WindowCandidates:
    people = [one.candidates for one in frames]
    tracks = [np.append(one.tracks, np.zeros(len(one.fused.ghosts), np.int64)) for one in frames]
    frame = np.repeat(np.arange(len(frames)), [len(one) for one in people])

    def joined(name: str) -> Floats:
        return np.concatenate([getattr(one, name) for one in people])

    evidence = joined("evidence") - joined("prior")
    bodies = joined("ground"), joined("covariance"), joined("height")
    return WindowCandidates(len(frames), frame, *bodies, evidence, np.concatenate(tracks))


def tracks_of(found: WindowCandidates, decision: Existence, inside: Flags) -> Ints:
    """Track of each candidate that is real, 0 for the others: added ones take that of the next detection on their path.

    A candidate is added between two of the detector's people, and before the first of a path: away from the border,
    where no person appears, or if it is sure. One view may see a person enter before others do. Elsewhere candidates
    are the best of many places that were tried, and so are their sums: a path of them alone is nobody. What prolongs a
    track at the border of the area costs nothing.
    """
    detected = np.where(decision.real, found.track, 0)
    linked = np.flatnonzero((decision.successor >= 0) & decision.real)
    linked = linked[decision.real[decision.successor[linked]]]
    earlier, later = detected.copy(), detected.copy()
    for i in linked.tolist():
        _take_over(earlier, int(decision.successor[i]), i, found)
    for i in linked[::-1].tolist():
        _take_over(later, i, int(decision.successor[i]), found)
    return np.where((earlier > 0) | inside | (decision.log_odds > _LEAST_LOG_ODDS), later, 0)


def _take_over(tracks: Ints, to: int, source: int, found: WindowCandidates) -> None:
    """Give a candidate the track of its neighbour on the path, unless another has it in that frame."""
    if tracks[to] == 0 and tracks[source] > 0 and not (tracks[found.frame == found.frame[to]] == tracks[source]).any():
        tracks[to] = tracks[source]
