"""Mean errors of boxes (`stseg.noise.box_bias`), learned from people who stand free.

Other edges of the same person show where an edge should be. The place is not known without them: with a place that is
off by e, the offsets of lower edges and of middles of boxes from a body of h pixels at the estimated place are

    d_k = m - J_k e + noise,    c_k = s_k / h - K_k e + noise,

with derivatives J, K by the place, and the noise of each box. Least squares without e leave normal equations of m and b
(Schur complement), which say nothing by one view, or by views that look the same way. The errors of one box last for a
second, so that the boxes of a second are one: equations of all people and frames add up in seconds, forgotten as all
that is learned (`stseg.records.forgetting`). Boxes are corrected before they are observed, and offsets are those of
boxes as they were delivered.

All views have one m: what differs between them cannot be told from a ground that moved. The mean errors of heads cannot
be told from taller people.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stseg.arrays import Boxes, Floats, Ints, ViewEvidence
from stseg.bodies.box_fit import EDGE_GRAIN, LEAST_PIXEL_HEIGHT, LOWER_EDGE, MIDDLE_OFFSET, fill_offsets
from stseg.bodies.views import View, ViewObservations
from stseg.config import ErrorRateConfig
from stseg.noise.box_bias import SHIFT_TERMS, BoxBias, shift_terms
from stseg.noise.box_noise_estimate import explained_boxes
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation

_LOWER_EDGE_ERROR, _SHIFT_ERROR = 0.02, 0.01
"""Standard deviations of errors before learning: of lower edges, shares of a body's height, and of the terms of a
shift, shares of the image's width: of views placed by hand, or with a lens that was taken for straight."""
_LARGEST_OFFSET = 0.15
"""Largest offset that is an error and not the box of another body: 2.5 standard deviations, shares of the height."""
_DIFFERENCE = 0.05
_DIFFERENCES = _DIFFERENCE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""Differences of places by which offsets are differentiated, metres."""
_LEAST_INFORMATION = 1e-3
"""Information on a place without boxes, per square metre."""


class _Offsets(NamedTuple):
    """Offsets of edges from the bodies of their people, in tolerances of the edges."""

    person: Ints
    """int64 (n,)."""
    by_error: Floats
    """float64 (n, error): their change by m and all b."""
    by_place: Floats
    """float64 (n, 2): by metres in x and y."""
    offset: Floats
    """float64 (n,): of boxes as they were delivered."""


class BoxBiasEstimate:
    """Accumulated normal equations; parameters as of `stseg.noise.estimates`."""

    def __init__(self, views: int, frame_rate: float, config: ErrorRateConfig) -> None:
        self._config, size = config, 1 + SHIFT_TERMS * views
        self.equations = Forgetting((size, size + 1), frame_rate, config.memory)
        """(error, error + 1): information on m and b, and what it says of them; both times seconds."""
        self._prior = np.full(size, _SHIFT_ERROR**-2)
        self._prior[0] = _LOWER_EDGE_ERROR**-2
        self._corrected = np.zeros(size)

    @property
    def bias(self) -> BoxBias:
        """Mean errors by all frames so far."""
        errors = self._errors
        return BoxBias(float(errors[0]), errors[1:].reshape(-1, SHIFT_TERMS))

    @property
    def _errors(self) -> Floats:
        sums = self.equations.sums
        return np.asarray(np.linalg.solve(sums[:, :-1] + np.diag(self._prior), sums[:, -1]))

    def corrected(self, evidence: Sequence[ViewEvidence], sizes: Sequence[tuple[int, int]]) -> list[ViewEvidence]:
        """The evidence of the next frame by the mean errors so far; see `BoxBias.corrected`."""
        if not any(isinstance(view, Boxes) for view in evidence):
            return list(evidence)
        self._corrected = self._errors
        return self.bias.corrected(evidence, sizes)

    def learn(self, explanation: Explanation, views: Sequence[View], observations: ViewObservations) -> None:
        """Count the frame whose boxes were corrected last."""
        self.equations.forget()
        offsets = [
            self._offsets(k, views[k], explanation, person, observation.edges[box], observation.tolerance[box])
            for k, person, observation, box in explained_boxes(explanation, views, observations, self._config)
        ]
        if offsets:
            every = _Offsets(*map(np.concatenate, zip(*offsets, strict=True)))
            self.equations.add(self.equations.seconds(_without_places(every, len(explanation.people))))

    def _offsets(
        self, k: int, view: View, explanation: Explanation, person: Ints, edges: Floats, tolerance: Floats
    ) -> _Offsets:
        """Lower edges and middles of view k, of people who stand free in it, edges (n, 4), tolerance (n, 5)."""
        people, size = explanation.people, len(self._prior)
        middle, lower, tall = _linear_offsets(view, people.ground[person], people.height[person], edges)
        by_error = np.zeros((2, len(person), size))
        by_error[0, :, 0] = 1.0
        by_error[1, :, 1 + SHIFT_TERMS * k :][:, :SHIFT_TERMS] = shift_terms(edges, view.camera.size) / tall[:, None]
        offset = np.stack([lower[:, 0], middle[:, 0]]) + by_error @ self._corrected
        free = people.is_free[k, person] & (np.abs(offset) < _LARGEST_OFFSET).all(0)
        by_place = -np.stack([lower[:, 1:], middle[:, 1:]])
        weight = 1.0 / tolerance[free][:, [LOWER_EDGE, MIDDLE_OFFSET]].T.ravel()
        equations = np.concatenate([by_error, by_place, offset[..., None]], -1)[:, free].reshape(-1, size + 3)
        by_error, by_place, offset = np.split(weight[:, None] * equations, [size, size + 2], 1)
        return _Offsets(np.tile(person[free], 2), by_error, by_place, offset.ravel())


def _linear_offsets(view: View, ground: Floats, height: Floats, edges: Floats) -> tuple[Floats, Floats, Floats]:
    """Offsets of middles and of lower edges (n, 4) and their change by metres in x and y, (n, 3); heights, pixels."""
    width, image_height = map(float, view.camera.size)
    found = np.empty((3, len(edges), 4))
    bodies = [view.table.boxes_of(ground + difference, height) for difference in _DIFFERENCES]
    for offsets, body in zip(found, bodies, strict=True):
        fill_offsets(body, edges, width, image_height, offsets)
    tall = np.fmax(bodies[0][:, 3] - bodies[0][:, 1], LEAST_PIXEL_HEIGHT) + EDGE_GRAIN[MIDDLE_OFFSET]
    found[1:] = (found[1:] - found[0]) / _DIFFERENCE
    found = np.nan_to_num(found)
    return found[:, :, MIDDLE_OFFSET].T, found[:, :, -1].T, tall


def _without_places(offsets: _Offsets, people: int) -> Floats:
    """Normal equations of the errors, float64 (error, error + 1), of people whose places are not known."""
    person, by_error, by_place, offset = offsets
    equations = np.column_stack([by_error, offset])
    of_places, both = np.zeros((people, 2, 2)), np.zeros((people, 2, equations.shape[1]))
    np.add.at(of_places, person, by_place[:, :, None] * by_place[:, None])
    np.add.at(both, person, by_place[:, :, None] * equations[:, None])
    known = np.linalg.solve(of_places + _LEAST_INFORMATION * np.eye(2), both)
    return np.asarray(by_error.T @ equations - np.einsum("npi,npj->ij", both[:, :, :-1], known))
