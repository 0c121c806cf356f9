"""Likelihood per plane from boxes: each box has a head and feet (docs/how-it-works.md, Fusion).

    M(X, Z) = max over boxes j and heights h >= Z of N(h) / N(mean) exp(match(j, pillar(X, h)))

is how well the best box fits a body there. The boxes of a cell are that of the person near it, and the unassigned ones.
A body is missed with probability m, or has a box that fits that well; an empty cell has such a box with probability b.
The likelihood ratio is r = m + M (1 - m) / b. L(X, Z) is the likelihood that gives the same ratio in the log-odds of
`stseg.occupancy.fusion`,

    ((1 - m) L + m (1 - L)) / (b L + (1 - b) (1 - L)) = r,

with b' for b within reach of a person. The ray of an empty cell then meets foreground with a probability of about M
(the E step of `stseg.occupancy.error_rate_estimate`), so b and b' converge to the means of M from any first guess.
"""

from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.bodies.box_fit import ViewBoxes, half_square
from stseg.bodies.pillar_index import PillarIndex, fill_fits
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, Levels
from stseg.kernels.accelerate import kernel, part
from stseg.occupancy.fusion import ErrorRates
from stseg.occupancy.shown_cells import ShownCells

_LEAST_FIT = 18.0
"""A box that fits a pillar by this much worse than perfectly is none, nats: it would raise L by less than a level."""


class Vicinity(NamedTuple):
    """Ground cells by the person near them."""

    near_person: Ints
    """int64 (cell,): the person near each cell, -1 for none."""
    cell: Ints
    """int64 (n,): cells near a person, in the order of persons."""
    start: Ints
    """int64 (person + 1,): index in `cell` of each person's first cell."""

    @classmethod
    def of(cls, near_person: Ints, people: int) -> Self:
        """From the person near each cell, int64 (y, x), -1 for none, and the number of people."""
        flat = near_person.reshape(-1)
        cell = np.flatnonzero(flat >= 0)
        cell = cell[np.argsort(flat[cell], kind="stable")]
        return cls(flat, cell, np.searchsorted(flat[cell], np.arange(people + 1)))


class CellFit(NamedTuple):
    """Fit of boxes to bodies at ground cells."""

    found: Flags
    """bool (cell,): cells that some box fits."""
    best: Singles
    """float32 (height, cell): at these cells, the log-likelihood of the best box of each height, -inf where there is
    none."""

    @classmethod
    def unfilled(cls, heights: int, cells: int) -> Self:
        """No cell found yet."""
        return cls(np.zeros(cells, bool), np.empty((heights, cells), np.float32))


@kernel
def fill_fit(
    index: PillarIndex,
    pillars: Singles,
    height_prior: Floats,
    person_prior: Floats,
    boxes: ViewBoxes,
    owner: Ints,
    vicinity: Vicinity,
    fit: CellFit,
) -> None:
    """Fill the fit, which has no cell yet.

    Parameters
    ----------
    index, pillars : float32 (height * cell, 4)
        Boxes of the pillars of each height at each cell, pixels.
    height_prior : float64 (height,), person_prior : float64 (person, height)
        Log-prior of the height at cells near no person, and near each person. The second is centred on the person's
        estimated height, so that an unusual height costs nothing again in every view.
    owner : int64 (box,)
        The person that each box is assigned to, -1 for none.
    """
    ground_cells, pillar, match = len(fit.found), np.empty(len(index.order), np.int32), np.empty(len(index.order))
    for b in range(len(boxes.edges)):
        box, tolerance, person = boxes.edges[b], boxes.tolerance[b], owner[b]
        if person >= 0:
            for k in range(vicinity.start[person], vicinity.start[person + 1]):
                for h in range(len(height_prior)):
                    body = pillars[h * ground_cells + vicinity.cell[k]]
                    own_match = boxes.belief[b] - half_square(body, box, tolerance, boxes.width, boxes.height)
                    _add_fit(np.float32(person_prior[person, h] + own_match), h, vicinity.cell[k], fit)
            continue
        number = fill_fits(index, pillars, boxes, b, boxes.belief[b] - _LEAST_FIT, pillar, match)
        for k in range(number):
            h, cell = pillar[k] // ground_cells, pillar[k] % ground_cells
            prior = height_prior[h] if vicinity.near_person[cell] < 0 else person_prior[vicinity.near_person[cell], h]
            _add_fit(np.float32(prior + match[k]), h, cell, fit)


@part
def _add_fit(log_fit: np.float32, h: int, cell: int, fit: CellFit) -> None:
    """Add the log-likelihood of a box at a height of a cell; a cell without any gets a column of -inf first."""
    if not fit.found[cell]:
        fit.found[cell] = True
        for other in range(len(fit.best)):
            fit.best[other, cell] = -np.inf
    fit.best[h, cell] = max(fit.best[h, cell], log_fit)


@kernel
def fill_levels(
    fit: CellFit,
    heights: Floats,
    planes: Floats,
    cells: ShownCells,
    marked: Flags,
    places: Labels,
    rates: ErrorRates,
    levels: Levels,
) -> None:
    """Fill levels (n,), which are those of `fill_empty`, with L of the cells near a person, or that a box fits.

    Heights float64 (height,) and planes float64 (plane,) are in metres, rising. Blocks of the ground with such cells
    are marked, bool (block of one plane,); `places` int32 (cell,) is that of `CellTables`.
    """
    first_taller = np.searchsorted(heights, planes)
    unfit = level_of_match(0.0, rates.miss, rates.near_clutter)
    for b in range(len(cells.block)):
        plane, column = divmod(cells.block[b], len(marked))
        if not marked[column]:
            continue
        shift, first_height = cells.first[b] - cells.start[b], first_taller[plane]
        for k in range(cells.start[b], cells.start[b + 1]):
            place, is_near, best = places[k + shift], cells.near_person[k] >= 0, -np.inf
            if levels[k] == UNSEEN:
                continue
            if fit.found[place]:
                for h in range(first_height, len(heights)):
                    best = max(best, float(fit.best[h, place]))
            if best > -np.inf:
                levels[k] = level_of_match(np.exp(best), rates.miss, rates.near_clutter if is_near else rates.clutter)
            elif is_near:
                levels[k] = unfit


@kernel
def level_of_match(match: float, miss: float, clutter: float) -> np.int16:
    """L in whole levels."""
    return np.int16(np.rint(plane_likelihood(match, miss, clutter) * TOP_LEVEL))


@kernel
def plane_likelihood(match: float, miss: float, clutter: float) -> float:
    """L, 0..1, of a match M by the miss rate m and the clutter rate b of the cell."""
    ratio = miss + match * (1.0 - miss) / clutter
    likelihood = (ratio * (1.0 - clutter) - miss) / (1.0 - 2.0 * miss + ratio * (1.0 - 2.0 * clutter))
    return min(max(likelihood, 0.0), 1.0)
