"""Mean error of the lower edges of a detector's boxes, learned from people who stand free.

A detector's boxes may end below the feet (amodal boxes, shadows) or above them. The offset d of a box's lower edge from
the feet, in shares of the body's height in the image, is known where other edges show where the person stands. The
place is not known without them: with the bias m and a place that is off by e, the offsets of lower edges and of the
boxes' middles from those of a body at the estimated place are

    d_k = m - J_k e + noise,    c_k = -K_k e + noise,

with derivatives J, K by the place and equal noise. Least squares without e leave an information i, boxes, and i m of
each person (Schur complement): 0 for one view, or for views that look the same way. Over all people and frames

    m = sum i m / (sum i + w_0),

in seconds of one person, forgotten as all that is learned (`stseg.records.forgetting`). Boxes are corrected before they
are observed, and offsets are those of boxes as they were delivered.

All views have one mean: what differs between them cannot be told from a ground that moved, and the mean errors of heads
cannot be told from taller people.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Floats, ViewEvidence
from stseg.bodies.box_fit import EDGE_GRAIN, LOWER_EDGE_BELOW, MIDDLE_OFFSET, fill_offsets
from stseg.bodies.views import View, ViewObservations
from stseg.config import ErrorRateConfig
from stseg.noise.box_noise_estimate import explained_boxes, whole_boxes
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation

_PRIOR_WEIGHT = 2.0
"""w_0, weight of no error, seconds of one box: the errors of one box last for a second, and are as large."""
_FREE_SHARE = 0.95
"""Least share of a whole body's detection rate where it stands free, 0..1."""
_LARGEST_OFFSET = 0.15
"""Largest offset that is an error and not the box of another body: 2.5 standard deviations, shares of the height."""
_DIFFERENCE = 0.05
_DIFFERENCES = _DIFFERENCE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""Differences of places by which offsets are differentiated, metres."""
_LEAST_INFORMATION = 1e-6
"""Information on a place without boxes, per square metre."""


class BoxBiasEstimate:
    """Accumulated offsets of lower edges.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        How fast is forgotten, and from which evidence on people count.
    """

    def __init__(self, frame_rate: float, config: ErrorRateConfig) -> None:
        self._config = config
        self.offsets = Forgetting((2,), frame_rate, config.memory)
        """(2,): information, boxes, and the bias times it, shares of the height; both times seconds."""
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

    def learn(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> None:
        """Count the frame whose boxes were corrected last."""
        self.offsets.forget()
        people = explanation.people
        information, sums = np.zeros((len(people), 3, 3)), np.zeros((len(people), 3))
        for k, person, observation, box in explained_boxes(explanation, views, observations, self._config):
            edges = observation.edges[box]
            middle, lower = _linear_offsets(views[k], people.ground[person], people.height[person], edges)
            lower[:, 0] += self._corrected
            free = people.found_share[k, person] >= _FREE_SHARE
            counted = free & (np.abs(lower[:, 0]) < _LARGEST_OFFSET)
            for offset, share in ((lower, 1.0), (middle, 0.0)):
                row = np.column_stack([np.full(len(person), share), -offset[:, 1:]])
                np.add.at(information, person[counted], (row[:, :, None] * row[:, None])[counted])
                np.add.at(sums, person[counted], (row * offset[:, :1])[counted])
        self.offsets.add(self.offsets.seconds(_without_places(information, sums)))


def _linear_offsets(view: View, ground: Floats, height: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Offsets of the middles and lower edges of boxes, edges (n, 4), and their change by metres in x and y: (n, 3)."""
    width, image_height = map(float, view.camera.size)
    found = np.empty((3, len(edges), 4))
    for offsets, difference in zip(found, _DIFFERENCES, strict=True):
        fill_offsets(view.table.boxes_of(ground + difference, height), edges, width, image_height, offsets)
    found[1:] = (found[1:] - found[0]) / _DIFFERENCE
    found = np.nan_to_num(found)
    return found[:, :, MIDDLE_OFFSET].T.copy(), found[:, :, -1].T.copy()


def _without_places(information: Floats, sums: Floats) -> Floats:
    """Information on the bias, boxes, and the bias times it, from all people: their places are not known, float64 (2,).

    `information` (n, 3, 3) and `sums` (n, 3) are of the bias and of the place of each person, by equally sharp edges.
    """
    of_places = information[:, 1:, 1:] + _LEAST_INFORMATION * np.eye(2)
    gain = np.linalg.solve(of_places, information[:, 1:, :1])[:, :, 0]
    share = information[:, 0, 0] - (information[:, 0, 1:] * gain).sum(1)
    return np.array([share.sum(), (sums[:, 0] - (sums[:, 1:] * gain).sum(1)).sum()])


def _corrected(boxes: Boxes, bias: float, size: tuple[int, int]) -> Boxes:
    """The boxes, the lower edges moved by a bias where no border of the image cuts the box."""
    edges, tall = boxes.pixel.copy(), boxes.pixel[:, 3]
    edges[:, 2:] += edges[:, :2]
    moved = np.maximum(tall + bias * (tall + EDGE_GRAIN[LOWER_EDGE_BELOW]), 1.0)
    height = np.where(whole_boxes(edges, size), moved, tall)
    return Boxes(np.column_stack([boxes.pixel[:, :3], height]), boxes.score, boxes.features)
