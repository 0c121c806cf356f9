"""Score of the lattice's pillars by the boxes of one view that are assigned to no member.

A frame has several rounds, each with other boxes free; the pillars that fit a box are found once.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Floats, Labels
from stseg.bodies.pillar_index import fill_fits
from stseg.bodies.views import BoxView, ViewObservation
from stseg.kernels.accelerate import kernel

_EXPECTED_MISSING_COST = 0.3
"""Cost of a missing box while candidates are sought, nats: occluders are not known yet."""


class BoxLattice:
    """The pillars of a view's lattice and the boxes of a frame."""

    def __init__(self, view: BoxView, observation: ViewObservation) -> None:
        self._view, self._observation = view, observation
        self._pillars = view.bodies.reshape(-1, 4)
        self._fits: dict[int, tuple[Labels, Floats]] = {}

    def score(self, free: Flags) -> Floats:
        """Score of each pillar by the free boxes, bool (box,): nats, float64 (height, cell)."""
        best = np.full(self._view.bodies.shape[:2], -np.inf)
        flat, found = best.reshape(-1), self._view.found.reshape(-1)
        for box in np.flatnonzero(free).tolist():
            if box not in self._fits:
                self._fits[box] = self._fits_of(box)
            _raise_to(*self._fits[box], flat)
        _take_for_score(flat, found, self._view.config.box_log_ratio)
        return best

    def _fits_of(self, box: int) -> tuple[Labels, Floats]:
        """The pillars that gain by a box, int32 (k,), and its log-likelihood given each, nats, float64 (k,)."""
        index, observation = self._view.index, self._observation
        pillar, fit = np.empty(len(index.order), np.int32), np.empty(len(index.order))
        width, height = map(float, self._view.camera.size)
        number = fill_fits(
            index, self._pillars, observation.edges[box], observation.tolerance[box], float(observation.belief[box]),
            width, height, -self._view.config.box_log_ratio - _EXPECTED_MISSING_COST, pillar, fit,
        )  # fmt: skip
        return pillar[:number].copy(), fit[:number].copy()


@kernel
def _raise_to(pillar: Labels, fit: Floats, best: Floats) -> None:
    """Raise best of some pillars to the fit of each."""
    for k in range(len(pillar)):
        best[pillar[k]] = max(best[pillar[k]], fit[k])


@kernel
def _take_for_score(best: Floats, found: Floats, log_ratio: float) -> None:
    """Make scores of log-likelihoods of the best box, best (pillar,), where the view may find (pillar,) the body."""
    for i in range(len(best)):
        best[i] = max(log_ratio + best[i], -_EXPECTED_MISSING_COST * found[i]) if found[i] > 0 else 0.0
