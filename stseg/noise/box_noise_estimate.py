"""Noise of boxes, learned from the frames that are explained: one table for all views.

E step: the offsets of each person's own boxes, over the posterior of the person's place and height. M step: the
standard deviations that make them most likely, `weight` seconds of one person's box at the first guess among them, and
what was counted since forgotten (`stseg.records.forgetting`). The lower
edge has two, of one density that is steeper below the feet than above: with S_1, S_2 the sums of squares on either
side of n boxes,

    sigma_1 = S_1^(1/3) sqrt((S_1^(1/3) + S_2^(1/3)) / n),

the most likely ones of a split normal distribution of known mode. People count for a view where the rest of the
evidence supports them, and boxes at the border of the image, which are cut there, do not count.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.box_fit import (
    LOWER_EDGE_ABOVE,
    LOWER_EDGE_BELOW,
    PRIOR_NOISE,
    SCORE_KNOTS,
    TOLERANCE,
    WIDTH_OFFSET,
    BoxNoise,
    fill_offsets,
    knots_of,
)
from stseg.bodies.views import BoxView, View, ViewObservations
from stseg.config import ErrorRateConfig
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation, People

_POINTS = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
"""Places and heights that stand for a posterior: its means and variances are theirs (unscented transform)."""


class BoxNoiseEstimate:
    """Accumulated squared offsets of boxes.

    Parameters
    ----------
    frame_rate
        Frames per second.
    scale
        That of `BoxNoise`.
    """

    def __init__(self, frame_rate: float, config: ErrorRateConfig, scale: float = 1.0) -> None:
        self._config, self._scale = config, scale
        self.offsets = Forgetting((len(SCORE_KNOTS), 6), frame_rate, config.memory)
        """(knot, 6): boxes, and their squared offsets, of the lower edge on either side of the feet; both times
        seconds."""

    @property
    def noise(self) -> BoxNoise:
        """The noise by all frames so far."""
        first = PRIOR_NOISE.spread**2
        both = PRIOR_NOISE.spread[:, LOWER_EDGE_BELOW] + PRIOR_NOISE.spread[:, LOWER_EDGE_ABOVE]
        first[:, LOWER_EDGE_BELOW:] *= PRIOR_NOISE.spread[:, LOWER_EDGE_BELOW:] / both[:, None]
        prior = np.column_stack([np.ones(len(first)), first])
        count, squares = np.split(self.offsets.with_prior(self._config.prior_weight, prior), [1], axis=1)
        spread = np.sqrt(squares / count)
        root = np.cbrt(squares[:, LOWER_EDGE_BELOW:])
        spread[:, LOWER_EDGE_BELOW:] = root * np.sqrt(root.sum(1, keepdims=True) / count)
        spread[:, WIDTH_OFFSET] = PRIOR_NOISE.spread[:, WIDTH_OFFSET]
        return BoxNoise(np.minimum(spread, PRIOR_NOISE.spread), self._scale)

    def learn(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> None:
        """Count one frame."""
        self.offsets.forget()
        for k, person, edges, score in explained_boxes(explanation, views, observations, self._config):
            self._count(score, _squares(views[k], explanation.people, person, edges) / self._scale**2)

    def _count(self, score: Floats, squares: Floats) -> None:
        lower, share = knots_of(score)
        boxes = np.column_stack([np.ones(len(squares)), squares])
        for knot, part in ((lower, 1 - share), (lower + 1, share)):
            np.add.at(self.offsets.sums, knot, self.offsets.seconds(boxes * part[:, None]))


def explained_boxes(
    explanation: Explanation, views: Sequence[View], observations: ViewObservations, config: ErrorRateConfig
) -> Iterator[tuple[int, Ints, Floats, Floats]]:
    """Whole boxes of people that the other views support: for each view its number, people, edges and scores."""
    people = explanation.people
    for k, (view, observation, owner) in enumerate(zip(views, observations, explanation.box_assignment, strict=True)):
        if isinstance(view, BoxView) and observation is not None and len(people):
            supported = people.supported_without(k, config.minimum_evidence)
            box = np.flatnonzero((owner >= 0) & supported[owner] & whole_boxes(observation.edges, view.camera.size))
            yield k, owner[box], observation.edges[box], observation.score[box]


def whole_boxes(edges: Floats, size: tuple[int, int]) -> Flags:
    """Boxes float64 (n, 4) of edges that the border of an image (width, height) does not cut."""
    return np.asarray((edges[:, :2] > 0).all(1) & (edges[:, 2:] < np.array(size) - 1).all(1))


def _squares(view: View, people: People, person: Ints, edges: Floats) -> Floats:
    """Expected squared offsets of people's boxes, float64 (box, 5)."""
    count, offsets = len(_POINTS), np.empty((len(_POINTS) * len(person), 4))
    root = np.linalg.cholesky(people.covariance[person])
    tall = np.sqrt(people.sizes.height_variance[person])
    ground = people.ground[person] + (root @ _POINTS[:, None, :2, None])[..., 0]
    heights = people.sizes.height[person] + tall * _POINTS[:, 2:]
    bodies = view.table.boxes_of(ground.reshape(-1, 2), heights.ravel())
    width, height = map(float, view.camera.size)
    fill_offsets(bodies, np.tile(edges, (count, 1)), width, height, offsets)
    is_below, squares = offsets[:, LOWER_EDGE_BELOW:] <= 0, np.nan_to_num(offsets**2)
    lower = squares[:, LOWER_EDGE_BELOW:]
    split = np.column_stack([squares[:, :LOWER_EDGE_BELOW], np.where(is_below, lower, 0), np.where(is_below, 0, lower)])
    return np.asarray(split.reshape(count, len(person), len(TOLERANCE)).sum(0) / count)
