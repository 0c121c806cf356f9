"""Score of the lattice's pillars by the boxes that are assigned to no member.

A frame has several rounds, each with other boxes free; the pillars that fit a box are found once. Most pillars fit none
of the free ones: their score is that of the frame without boxes, and they cost nothing.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.bodies.pillar_index import fill_fits
from stseg.bodies.views import BoxView, ViewObservation
from stseg.kernels.accelerate import kernel

_EXPECTED_MISSING_COST = 0.3
"""Cost of a missing box while candidates are sought, nats: occluders are not known yet."""


class BoxLattice:
    """The pillars of the lattice and the boxes of a frame, of the views that have some; pillars (height * cell,).

    `prior` float64 (pillar,) is the score of each pillar without any view, nats. Views are numbered as the rig has
    them.
    """

    def __init__(self, views: dict[int, tuple[BoxView, ViewObservation]], prior: Floats) -> None:
        self._views, self._prior, self._without = views, prior, prior.copy()
        self._fits = {number: dict[int, tuple[Labels, Floats]]() for number in views}
        self._best = {number: np.full(len(prior), -np.inf) for number in views}
        for view, _ in views.values():
            self._without -= _EXPECTED_MISSING_COST * view.found

    def score(self, assigned: Sequence[Ints]) -> Floats:
        """Score of each pillar by the boxes that are free, -1 in the assigned (box,) of their view: nats."""
        score, is_open = self._without.copy(), np.zeros(len(self._prior), bool)
        for number in self._views:
            for box in np.flatnonzero(assigned[number] < 0).tolist():
                if box not in self._fits[number]:
                    self._fits[number][box] = self._fits_of(number, box)
                _raise_to(*self._fits[number][box], self._best[number], is_open)
        pillars = np.flatnonzero(is_open)
        score[pillars] = self._prior[pillars]
        for number, (view, _) in self._views.items():
            _add_scores(pillars, self._best[number], view.found, view.config.box_log_ratio, score)
        return score

    def _fits_of(self, number: int, box: int) -> tuple[Labels, Floats]:
        """The pillars that gain by a box, int32 (k,), and its log-likelihood given each, nats, float64 (k,)."""
        view, observation = self._views[number]
        index, least = view.index, -view.config.box_log_ratio - _EXPECTED_MISSING_COST
        pillar, fit = np.empty(len(index.order), np.int32), np.empty(len(index.order))
        found = fill_fits(index, view.bodies.reshape(-1, 4), view.boxes(observation), box, least, pillar, fit)
        return pillar[:found].copy(), fit[:found].copy()


@kernel
def _raise_to(pillar: Labels, fit: Floats, best: Floats, is_open: Flags) -> None:
    """Raise best of some pillars to the fit of each, and mark them."""
    for k in range(len(pillar)):
        best[pillar[k]] = max(best[pillar[k]], fit[k])
        is_open[pillar[k]] = True


@kernel
def _add_scores(pillars: Ints, best: Floats, found: Floats, log_ratio: float, score: Floats) -> None:
    """Add a view's scores of some pillars by the best fits (pillar,) of boxes, which are -inf again afterwards.

    `found` float64 (pillar,) is the share of the detection rate with which the view finds each body.
    """
    for i in pillars:
        score[i] += max(log_ratio + best[i], -_EXPECTED_MISSING_COST * found[i]) if found[i] > 0 else 0.0
        best[i] = -np.inf
