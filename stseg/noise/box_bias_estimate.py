"""Mean error of the lower edges of a detector's boxes, learned from people who stand free.

A detector's boxes may end below the feet (amodal boxes, shadows) or above them. Several views show where a person
stands, so the offset d of a box's lower edge from the feet is known, in shares of the body's height in the image. Over
all views and frames its mean is

    m = sum w d / (sum w + w_0),

with weights w in seconds of one person, forgotten as all that is learned (`stseg.records.forgetting`). Boxes are
corrected before they are observed, and offsets are those of boxes as they were delivered.

All views have one mean: what differs between them cannot be told from a ground that moved, and the mean errors of heads
cannot be told from taller people.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, ViewEvidence
from stseg.bodies.box_fit import EDGE_GRAIN, LOWER_EDGE_BELOW, fill_offsets
from stseg.bodies.views import View, ViewObservation
from stseg.config import ErrorRateConfig
from stseg.noise.box_noise_estimate import explained_boxes, whole_boxes
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation

_PRIOR_WEIGHT = 2.0
"""w_0, weight of no error, seconds of one person: the errors of one box last for a second, and are as large."""
_FREE_VISIBILITY = 0.95
"""Least share of a body that is visible where it stands free, 0..1."""
_LARGEST_OFFSET = 0.3
"""Largest offset that is an error and not the box of another body, shares of the height."""


class BoxBiasEstimate:
    """Accumulated offsets of lower edges.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        How fast is forgotten, and from which evidence on people count.

    Attributes
    ----------
    offsets : (2,)
        Boxes, and offsets of their lower edges, shares of the height; both times seconds.
    """

    def __init__(self, frame_rate: float, config: ErrorRateConfig) -> None:
        self._config = config
        self.offsets = Forgetting((2,), frame_rate, config.memory)
        self._corrected = 0.0

    @property
    def bias(self) -> float:
        """Mean offset by all frames so far, shares of the height: below 0 where boxes end below the feet."""
        weight, offset = self.offsets.sums.tolist()
        return float(offset / (weight + _PRIOR_WEIGHT))

    def corrected(self, evidence: Sequence[ViewEvidence], sizes: Sequence[tuple[int, int]]) -> list[ViewEvidence]:
        """The evidence of the next frame, in images of sizes (width, height), with boxes that end at the feet."""
        bias = self._corrected = self.bias
        pairs = zip(evidence, sizes, strict=True)
        return [_corrected(view, bias, size) if isinstance(view, Boxes) else view for view, size in pairs]

    def learn(
        self, explanation: Explanation, views: Sequence[View], observations: Sequence[ViewObservation | None]
    ) -> None:
        """Count the frame whose boxes were corrected last."""
        self.offsets.forget()
        people = explanation.people
        for k, person, edges, _ in explained_boxes(explanation, views, observations, self._config):
            bodies = views[k].table.boxes_of(people.ground[person], people.height[person])
            offsets, (width, height) = np.empty((len(edges), 4)), map(float, views[k].camera.size)
            fill_offsets(bodies, edges, width, height, offsets)
            delivered = offsets[:, LOWER_EDGE_BELOW] + self._corrected
            counted = (people.visibility[k, person] >= _FREE_VISIBILITY) & (np.abs(delivered) < _LARGEST_OFFSET)
            counts = np.array([counted.sum(), delivered[counted].sum()])
            self.offsets.add(self.offsets.seconds(counts))


def _corrected(boxes: Boxes, bias: float, size: tuple[int, int]) -> Boxes:
    """The boxes, the lower edges moved by a bias where no border of the image cuts the box."""
    edges, tall = boxes.pixel.copy(), boxes.pixel[:, 3]
    edges[:, 2:] += edges[:, :2]
    moved = np.maximum(tall + bias * (tall + EDGE_GRAIN[LOWER_EDGE_BELOW]), 1.0)
    height = np.where(whole_boxes(edges, size), moved, tall)
    return Boxes(np.column_stack([boxes.pixel[:, :3], height]), boxes.score, boxes.features)
