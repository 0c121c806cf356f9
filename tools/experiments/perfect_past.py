"""What the detector makes of each frame when it knows where everybody stood a frame before, and why it errs then.

Where it errs although the past is right, either the model prefers what was found (the truth, each person fitted to the
pixels within reach, has the lower score), or the search was short.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.target_trials import Recorded
from stseg.arrays import Boxes, Floats, ViewEvidence
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.detection.prior import Prior
from stseg.detection.search.map_estimate import FrameEvidence, MapEstimate
from stseg.engine.tracker import Tracker
from stseg.evaluation.matching import distances, match
from stseg.geometry import Rig
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.pictures import reduced_view
from stseg.records.candidates import Candidates
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sizes import Sizes

_GATE = 0.5
"""Metres within which a detection is a person."""
_FREE = 0.4
"""How far a person of the truth may be fitted from where the truth has them, metres."""


@dataclass(frozen=True)
class PerfectPast:
    """MODA of frames whose past is right; how many of them err, and in how many of those the truth scores lower."""

    moda: float
    wrong: int
    less_likely: int

    def __str__(self) -> str:
        return f"{self.moda:.1f}; {self.less_likely} of {self.wrong}"


def perfect_past(made: Recorded, every: int) -> PerfectPast:
    """Over every so many frames of a recording."""
    config = Config()
    kinds = ["boxes" if view is None or isinstance(view, Boxes) else "pixels" for view in made.frames[0]]
    body, (rig, evidence_of) = config.body, _evidence(made)
    detector = Detector(rig, kinds, config.detection, body, config.error_rates)
    people = errors = wrong = less_likely = 0
    for frame in range(2, len(made.frames), every):
        here, before, earlier = (_standing(made, number) for number in (frame, frame - 1, frame - 2))
        predicted = _predicted(before, earlier, made.rig.frame_rate, config)
        seen = evidence_of[frame]
        found, true = detector.explain(seen, predicted).people, np.array(list(here.values())).reshape(-1, 2)
        hits = len(match(distances(true, found.ground), _GATE)[0])
        people, errors = people + len(true), errors + len(true) + len(found) - 2 * hits
        if hits < max(len(true), len(found)):
            prior = Prior.of(predicted, detector.config, body, detector.border)
            evidence = detector.evidence(detector.observe(seen), prior)
            chosen = Candidates(found.ground, found.height, found.width)
            wrong += 1
            less_likely += _best_score(evidence, true) < _best_score(evidence, chosen.ground)
    return PerfectPast(100 * (1 - errors / max(people, 1)), wrong, less_likely)


def _evidence(made: Recorded) -> tuple[Rig, list[list[ViewEvidence]]]:
    """The foreground of all views, frame by frame, and the rig at its size."""
    session = Tracker(made.rig, empty=made.empty)._begin(made.frames[0], 0)
    rig = session.pipeline.rig
    factors = [whole.size[0] // camera.size[0] for whole, camera in zip(made.rig.cameras, rig.cameras, strict=True)]
    return rig, [
        session.evidence(FrameSet(frame, tuple(map(reduced_view, views, factors))))
        for frame, views in enumerate(made.frames)
    ]


def _standing(made: Recorded, frame: int) -> dict[int, Floats]:
    rows = made.truth[made.truth["frame"] == frame]
    return dict(zip(rows["id"].tolist(), np.column_stack([rows["x"], rows["y"]]), strict=True))


def _predicted(before: dict[int, Floats], earlier: dict[int, Floats], rate: float, config: Config) -> PredictedTracks:
    """Everybody of the frame before, moving on as since the frame before that."""
    ground = np.array([place + (place - earlier.get(name, place)) for name, place in before.items()]).reshape(-1, 2)
    number, motion = len(ground), config.motion
    spread = motion.position_noise**2 + (motion.velocity_noise / rate) ** 2
    sizes = Sizes.of_population(number, config.body)
    return PredictedTracks(ground, np.tile(np.eye(2) * spread, (number, 1, 1)), sizes, np.ones(number))


def _best_score(evidence: FrameEvidence, ground: Floats) -> float:
    """Score of people at places (n, 2), each fitted to their own evidence within reach, nats."""
    body, number = evidence.prior.body, len(ground)
    pool = Candidates(ground, np.full(number, body.height_mean), np.full(number, body.width_mean))
    estimate = MapEstimate.of_search(evidence, pool, np.arange(number)).with_members(np.arange(number))
    best = estimate.members_score.total
    for _ in range(3):
        fitted = estimate.refined().pool
        off = fitted.ground - ground
        nearer = np.minimum(1.0, _FREE / np.maximum(np.hypot(*off.T), 1e-9))[:, None]
        first = len(estimate.pool)
        moved = Candidates(ground + off * nearer, fitted.height, fitted.width)
        estimate = estimate.with_more(moved)
        estimate = estimate.with_members(np.arange(first, first + number))
        best = max(best, estimate.members_score.total)
    return best
