"""Rates at which detectors find people of whom a part is hidden, learned from the frames that are explained.

A detector's rate r(v) of bodies of which a share v is visible differs from detector to detector: some find a head
behind a shoulder, others nobody who is half hidden. r is linear between knots, and its posterior at a knot has a beta
prior: `prior_weight` seconds of one person at a rate in proportion to v, and the trials since, which are forgotten
(`stseg.records.forgetting`). People count for a view where the rest of the evidence supports them, or a view would
confirm itself. Misses of whole bodies last (pose, furniture), so only r(v) / r(1) is learned, and the miss rate of
whole bodies stays that of the configuration.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats
from stseg.bodies.views import BoxView, View, ViewObservations
from stseg.config import DetectionConfig, ErrorRateConfig
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation

VISIBILITY_KNOTS = np.linspace(0.0, 1.0, 11)
"""Visible shares at which rates are learned."""


def first_found_share(config: DetectionConfig) -> Floats:
    """First guess of r(v) / r(1) at the knots, float64 (knot,)."""
    return (VISIBILITY_KNOTS / config.full_visibility).clip(config.hidden_detection_rate, 1.0)


class DetectionRateEstimate:
    """Detections of people by their visible share; state of one session."""

    def __init__(self, frame_rate: float, detection: DetectionConfig, config: ErrorRateConfig) -> None:
        self._config, rate = config, (1.0 - detection.box_miss_rate) * first_found_share(detection)
        self._first = np.stack([np.ones(len(rate)), rate])
        self.counts = Forgetting(self._first.shape, frame_rate, config.memory)
        """(2, knot): trials and detections, seconds of one person."""

    @property
    def found_share(self) -> Floats:
        """r(v) / r(1) at the knots by all frames so far, at most 1, float64 (knot,)."""
        trials, detections = self.counts.with_prior(self._config.prior_weight, self._first)
        rate = detections / trials
        return np.asarray(np.minimum(rate / rate[-1], 1.0))

    def learn(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> None:
        """Count one frame."""
        self.counts.forget()
        people = explanation.people
        for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
            if isinstance(view, BoxView) and observation is not None:
                is_found, owner = np.zeros(len(people)), explanation.box_assignment[k]
                is_found[owner[owner >= 0]] = 1.0
                trusted = people.evidence - people.view_evidence[k] >= self._config.minimum_evidence
                counted = trusted & (people.visibility[k] > 0)
                at = people.visibility[k, counted] * (len(VISIBILITY_KNOTS) - 1)
                weight = np.maximum(1.0 - np.abs(at - np.arange(len(VISIBILITY_KNOTS))[:, None]), 0.0)
                self.counts.add(self.counts.seconds(np.stack([weight.sum(1), weight @ is_found[counted]])))
