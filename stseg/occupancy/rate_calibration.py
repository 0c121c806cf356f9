"""The evidence level: how often each view misses bodies and shows what is not there, learned as a recording runs.

Each frame is explained before it is counted (METHODS 4, 7), so whose cells are whose is known:

    m   the cells of a person's pillar whose ray meets no foreground, of people whom the *other* views support,
    b   the cells near nobody whose ray meets foreground that nobody explains,
    b'  the same of the cells within reach of such a person and outside the pillar: rays past a person meet that person,
    pi' the share of the cells within reach of a person that the pillar fills.

A likelihood L is a probability itself, so a cell counts with the probability that its ray met foreground given what it
is, (1 - m) L / ((1 - m) L + m (1 - L)) in a pillar and b L / (b L + (1 - b)(1 - L)) outside; for maps of 0 and 1 that
is L. These are the E steps of the rates that make all L most likely.

A rate is the mean of a beta posterior: `weight` seconds of the first guess, and what was seen since, which is forgotten
at exp(-t / memory). What a view alone asserts teaches nothing of that view, or it would confirm itself: people count
for it where the rest of the evidence supports them, and a cell near nobody counts as empty with the probability that
the other views give it, so somebody whom the pass missed is no clutter. This is one round of Dawid and Skene's
estimate of observers' error rates (Applied Statistics 28, 1979) a frame, each observer's own vote left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.config import ErrorRateConfig
from stseg.geometry import Grid
from stseg.geometry.bodies import PROFILE
from stseg.geometry.summed_area import TOP, Levels
from stseg.occupancy.fusion import ErrorRates

MISS, CLUTTER, NEAR_CLUTTER = 0, 1, 2
_HALF = 0.5
_REST = 1e-6


class RateCalibration:
    """The rates of all views as far as they are known.

    Parameters
    ----------
    first
        First guess of each view.
    frame_rate
        Frames per second.

    Attributes
    ----------
    errors, seen : float64 (view, 3)
        Seconds in which the view erred, and in which it could have, for each of `ErrorRates`: seconds of one person for
        m and b', of all the view's cells for b.
    filled : float64 (2,)
        Seconds of one person's cells that the pillar fills, and of all cells within reach of the person.
    """

    def __init__(self, first: Sequence[ErrorRates], frame_rate: float, config: ErrorRateConfig) -> None:
        self.first = np.array(first, float).reshape(-1, 3)
        self.frame_rate, self.config = frame_rate, config
        self.errors, self.seen, self.filled = np.zeros_like(self.first), np.zeros_like(self.first), np.zeros(2)

    @property
    def rates(self) -> list[ErrorRates]:
        """Of each view."""
        weight = self.config.prior_weight
        return [ErrorRates(*row) for row in ((weight * self.first + self.errors) / (weight + self.seen)).tolist()]

    @property
    def filled_share(self) -> float:
        """Share of the cells within reach of a person that bodies fill; one half at first."""
        weight = self.config.prior_weight
        return float((weight * _HALF + self.filled[0]) / (weight + self.filled[1]))

    def learn(self, errors: Floats, seen: Floats, filled: Floats) -> None:
        """Count one frame, all in frames of what the attributes hold in seconds; a blind view has seen nothing."""
        kept = np.exp(-1.0 / (self.frame_rate * self.config.memory))
        for total, fresh in ((self.errors, errors), (self.seen, seen), (self.filled, filled)):
            total *= kept
            total += fresh / self.frame_rate


def inside_bodies(grid: Grid, near: Ints, ground: Floats, height: Floats) -> Flags:
    """Cells that the pillar of the person near them fills, bool (plane, y, x).

    Parameters
    ----------
    near : int64 (y, x)
        The person near each cell, -1 for nobody.
    ground, height : float64 (person, 2), (person,)
        Metres.
    """
    inside = np.zeros(grid.shape, bool)
    here = near >= 0
    person = near[here]
    away = np.hypot(*(grid.ground[here] - ground[person]).T)
    for plane, above in zip(inside, grid.heights, strict=True):
        plane[here] = away <= np.interp(above / height[person], PROFILE[:, 0], PROFILE[:, 1], right=-1.0)
    return inside


def cells_per_person(grid: Grid, height: float, reach: float) -> tuple[float, float]:
    """How many cells one person's pillar fills, and how many are within reach of the person."""
    radius = np.interp(grid.heights / height, PROFILE[:, 0], PROFILE[:, 1], right=0.0)
    filled = float((np.pi * radius**2).sum() / grid.cell**2)
    return max(filled, 1.0), max(grid.planes * np.pi * reach**2 / grid.cell**2, 1.0)


@kernel
def _share(rate: float, likelihood: float) -> float:
    """Probability of an error that is as frequent as `rate` and as likely by itself as `likelihood`."""
    erring = rate * likelihood
    return erring / (erring + (1.0 - rate) * (1.0 - likelihood))


@kernel
def fill_counts(
    levels: Levels,
    terms: Singles,
    weight: float,
    share: Singles,
    faith: Singles,
    weighted: Singles,
    weights: Singles,
    count: Singles,
    near: Ints,
    inside: Flags,
    trusted: Flags,
    rates: Floats,
    looks: float,
    prior: float,
    errors: Floats,
    seen: Floats,
) -> None:
    """Fill errors and seen (3,) with what one view's frame says of m, b and b', in cells.

    Parameters
    ----------
    levels, terms, weight, share, faith
        What the view gave to the sums, see `stseg.occupancy.fusion.add_terms`.
    weighted, weights, count : float32 (plane, y, x)
        The sums over all views.
    near : int64 (y, x), inside : bool (plane, y, x)
        The person near each cell, -1 for nobody, and whether the pillar fills it.
    trusted : bool (person,)
        Who stands there whatever this view shows, and is not hidden from it.
    rates : float64 (3,)
        m, b and b' so far.
    looks
        k of `stseg.occupancy.fusion`.
    prior
        Log-odds of a cell near nobody before any view is asked, nats.
    """
    errors[:], seen[:] = 0.0, 0.0
    level, part, sure, body = levels.reshape(-1), share.reshape(-1), faith.reshape(-1), inside.reshape(-1)
    said, said_weight, said_count = weighted.reshape(-1), weights.reshape(-1), count.reshape(-1)
    person = near.reshape(-1)
    for c in range(len(level)):
        if level[c] < 0 or part[c] <= 0.0:
            continue
        likelihood = level[c] / TOP
        who = person[c % len(person)]
        if who < 0:
            rest, others = said_weight[c] - weight * part[c], prior
            if rest > _REST * weight:
                own = weight * part[c] * sure[c] * terms[0, level[c]]
                others += looks * (said_count[c] - part[c]) * (said[c] - own) / rest
            empty = part[c] / (1.0 + np.exp(min(max(others, -30.0), 30.0)))
            errors[CLUTTER] += _share(rates[CLUTTER], likelihood) * empty
            seen[CLUTTER] += empty
        elif trusted[who]:
            kind, erring = (MISS, 1.0 - likelihood) if body[c] else (NEAR_CLUTTER, likelihood)
            errors[kind] += _share(rates[kind], erring) * part[c]
            seen[kind] += part[c]
