"""Noise of boxes and the rate of missing ones, learned from the frames that are explained: for all views together.

A box moves the place at which its person is found, so its offsets from that person are smaller than its errors. With
v the variance of an offset r over the posterior of place and height, and t the tolerance of the box, a share v / t^2 of
it was spent on the place: E r^2 = sigma^2 (1 - v / t^2). Over n = sum (1 - v / t^2) degrees of freedom and S = sum r^2,

    sigma^2 = S / n,

whatever the noise was taken for before; boxes of a person seen by one view alone say nothing. `prior_weight` seconds of
one person's box at the first guess are among them, and what was counted is forgotten (`stseg.records.forgetting`). A
lower edge counts by the probability that it is at the feet, with h / (1 - h) the odds of hidden feet by their share:

    p(hidden) / p(at the feet) = h / ((1 - h) N(r; 0, sigma^2)) = exp((r^2 - l^2) / t^2)

where it ends r above the feet, with l the limit of `stseg.bodies.box_fit` and t^2 = 2 sigma^2. The mean of p(hidden) is
h, one of boxes whose feet another box covers, and one of all others. People count for a view where the rest of the
evidence supports them, and boxes at the border of the image, which are cut there, do not count.

Detectors miss people who are small in the image, or look unlike those of their training. People who count, and whom a
view sees whole past the others, are missed where no box is theirs. The configured rate of misses is the first guess and
the least: whom a detector misses often is seldom found.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Ints
from stseg.bodies.box_fit import (
    FEET_LIMIT,
    LOWER_EDGE,
    PRIOR_NOISE,
    SCORE_KNOTS,
    WIDTH_OFFSET,
    BoxNoise,
    fill_offsets,
    knots_of,
)
from stseg.bodies.covered_feet import are_feet_covered
from stseg.bodies.views import BoxView, View, ViewObservation, ViewObservations
from stseg.config import ErrorRateConfig
from stseg.noise.box_bias import whole_boxes
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation, People

_POINTS = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
"""Places and heights that stand for a posterior: its means and variances are theirs (unscented transform)."""


class BoxNoiseEstimate:
    """Accumulated offsets and misses of boxes; `scale` is that of `BoxNoise`, others as of `stseg.noise.estimates`."""

    def __init__(self, frame_rate: float, config: ErrorRateConfig, scale: float = 1.0) -> None:
        self._config, self._scale = config, scale
        self.offsets = Forgetting((len(SCORE_KNOTS), 2, FEET_LIMIT), frame_rate, config.memory)
        """(knot, 2, 4): degrees of freedom, and squared offsets; both times seconds."""
        self.feet = Forgetting((2, 2), frame_rate, config.memory)
        """(covered, 2): boxes, and those whose feet are hidden; both times seconds."""
        self.misses = Forgetting((2,), frame_rate, config.memory)
        """(2,): people whom views see whole, and those of them without a box; both times seconds."""

    @property
    def noise(self) -> BoxNoise:
        """The noise by all frames so far."""
        first, weight = PRIOR_NOISE.spread**2, self._config.prior_weight
        counted = self.offsets.with_prior(weight, np.stack([np.ones_like(first), first], 1))
        spread = np.sqrt(counted[:, 1] / counted[:, 0])
        spread[:, WIDTH_OFFSET] = PRIOR_NOISE.spread[:, WIDTH_OFFSET]
        boxes, hidden = self.feet.with_prior(weight, np.column_stack([np.ones(2), PRIOR_NOISE.hidden_feet])).T
        return BoxNoise(spread, hidden / boxes, self._scale)

    def miss_rate(self, first: float) -> float:
        """The rate at which whole people are missed, by all frames so far, 0..1; `first` is the configured one."""
        people, missed = self.misses.with_prior(self._config.prior_weight, np.array([1.0, first]))
        return max(float(missed / people), first)

    def learn(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> None:
        """Count one frame."""
        self.offsets.forget()
        self.feet.forget()
        self.misses.forget()
        self.misses.add(self.misses.seconds(self._misses(explanation, views, observations)))
        for k, person, observation, box in explained_boxes(explanation, views, observations, self._config):
            edges, tolerance = observation.edges[box], observation.tolerance[box]
            counted, feet = _counted(views[k], explanation.people, person, edges, tolerance)
            counted[:, 1] /= self._scale**2
            covered = are_feet_covered(observation.edges)[box].astype(int)
            np.add.at(self.feet.sums, covered, self.feet.seconds(feet))
            lower, share = knots_of(observation.score[box])
            for knot, part in ((lower, 1 - share), (lower + 1, share)):
                np.add.at(self.offsets.sums, knot, self.offsets.seconds(counted * part[:, None, None]))

    def _misses(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> Floats:
        """Number of people whom the other views support and each view sees whole, and of those without a box, (2,)."""
        people, owners, number = explanation.people, explanation.box_assignment, np.zeros(2)
        for k, (view, observation, owner) in enumerate(zip(views, observations, owners, strict=True)):
            if isinstance(view, BoxView) and observation is not None:
                counted = np.flatnonzero(people.supported_without(k, self._config.minimum_evidence) & people.is_free[k])
                number += len(counted), len(np.setdiff1d(counted, owner))
        return number


def explained_boxes(
    explanation: Explanation, views: Sequence[View], observations: ViewObservations, config: ErrorRateConfig
) -> Iterator[tuple[int, Ints, ViewObservation, Ints]]:
    """Whole boxes of people that the other views support: each view's number, people, observation and their boxes."""
    people = explanation.people
    for k, (view, observation, owner) in enumerate(zip(views, observations, explanation.box_assignment, strict=True)):
        if isinstance(view, BoxView) and observation is not None and len(people):
            supported = people.supported_without(k, config.minimum_evidence)
            box = np.flatnonzero((owner >= 0) & supported[owner] & whole_boxes(observation.edges, view.camera.size))
            yield k, owner[box], observation, box


def _counted(view: View, people: People, person: Ints, edges: Floats, tolerance: Floats) -> tuple[Floats, Floats]:
    """Shares of people's boxes in the sums of offsets, float64 (box, 2, 4), and of feet, float64 (box, 2)."""
    offsets = _offsets(view, people, person, edges)
    mean, variance = offsets.mean(0), offsets.var(0)
    freedom = np.maximum(1.0 - variance / tolerance[:, :FEET_LIMIT] ** 2, 0.0)
    hidden = _hidden_feet(mean[:, LOWER_EDGE], tolerance)
    feet = freedom[:, LOWER_EDGE, None] * np.column_stack([np.ones_like(hidden), hidden])
    counted = np.stack([freedom, mean**2], 1)
    counted[..., LOWER_EDGE] *= (1.0 - hidden)[:, None]
    return np.nan_to_num(counted), np.nan_to_num(feet)


def _hidden_feet(offset: Floats, tolerance: Floats) -> Floats:
    """Probability that feet are hidden by how far boxes end above them, float64 (box,)."""
    log_odds = (offset**2 - tolerance[:, FEET_LIMIT] ** 2) / tolerance[:, LOWER_EDGE] ** 2
    return np.where(offset > 0, expit(log_odds), 0.0)


def _offsets(view: View, people: People, person: Ints, edges: Floats) -> Floats:
    """Offsets of people's boxes over the posterior of each, float64 (point, box, 4); nan out of the image."""
    root = np.linalg.cholesky(people.covariance[person])
    tall = np.sqrt(people.sizes.height_variance[person])
    ground = people.ground[person] + (root @ _POINTS[:, None, :2, None])[..., 0]
    heights = people.sizes.height[person] + tall * _POINTS[:, 2:]
    bodies, offsets = view.table.boxes_of(ground.reshape(-1, 2), heights.ravel()), np.empty((ground[..., 0].size, 4))
    width, height = map(float, view.camera.size)
    fill_offsets(bodies, np.tile(edges, (len(_POINTS), 1)), width, height, offsets)
    return offsets.reshape(len(_POINTS), len(person), 4)
