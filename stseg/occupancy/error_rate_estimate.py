"""Online estimation of the views' error rates: misses, and false alarms (clutter).

A frame is counted after its detection, so the person of each cell is known:

    m   misses among the cells in the pillars of persons that the *other* views support,
    b   foreground on the rays of cells near no person that is assigned to no person,
    b'  foreground on the rays of the cells within reach of such a person and outside the pillar,
    pi' the share of the cells within reach of a person that the pillar fills.

A likelihood L is a probability itself, so a cell counts with the probability that its ray met foreground given what it
is, (1 - m) L / ((1 - m) L + m (1 - L)) in a pillar and b L / (b L + (1 - b)(1 - L)) outside; for maps of 0 and 1 that
is L. This is the E step of the maximum-likelihood estimate of the rates.

A rate is the mean of a beta posterior: `prior_weight` seconds of the first guess, and the counts since, which are
forgotten (`stseg.records.forgetting`). A view's own evidence is left out of its counts, or it would confirm itself:
persons count where the rest of the evidence supports them, and a cell near no person counts as empty with the
probability that the other views give it, so that a missed person is no clutter. This is one round of Dawid and Skene's
estimate of observers' error rates (Applied Statistics 28, 1979) per frame, each observer's own vote left out.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.pillars import PROFILE
from stseg.config import ErrorRateConfig
from stseg.geometry import Grid
from stseg.geometry.summed_area import TOP_LEVEL
from stseg.kernels.accelerate import kernel, part
from stseg.occupancy.fusion import ErrorRates, FrameTerms, Sums
from stseg.records.forgetting import Forgetting

MISS, CLUTTER, NEAR_CLUTTER = 0, 1, 2
_FIRST_FILLED = 0.5
"""First guess of pi'."""
_LEAST_WEIGHT = 1e-6
"""Weight of the other views, relative to the view's own, below which they count as blind."""
_INTERVAL = 0.25
"""Seconds from one counted frame to the next: rates have a memory of minutes."""


class ErrorRateEstimate:
    """Current estimate of all views' error rates; state of one session.

    Parameters
    ----------
    first
        First guess of each view.
    frame_rate
        Frames per second.
    """

    def __init__(self, first: Sequence[ErrorRates], frame_rate: float, config: ErrorRateConfig) -> None:
        self.first = np.array(first, float).reshape(-1, 3)
        self.config = config
        self.counts = Forgetting((2, *self.first.shape), frame_rate, config.memory)
        """(2, view, 3): trials and errors of each rate in `ErrorRates`, in seconds: of one person's cells for m and b',
        of all the view's cells for b."""
        self.filled = Forgetting((2,), frame_rate, config.memory)
        """(2,): seconds of one person's cells: all within reach of the person, and those that the pillar fills."""
        self.interval = max(1, round(_INTERVAL * frame_rate))
        """Frames from one counted frame to the next."""
        self._frames = 0

    @property
    def rates(self) -> list[ErrorRates]:
        """Estimate for each view."""
        prior = np.stack([np.ones_like(self.first), self.first])
        trials, errors = self.counts.with_prior(self.config.prior_weight, prior)
        return [ErrorRates(*row) for row in (errors / trials).tolist()]

    @property
    def filled_share(self) -> float:
        """Share of the cells within reach of a person that bodies fill; one half at first."""
        reached, filled = self.filled.with_prior(self.config.prior_weight, np.array([1.0, _FIRST_FILLED]))
        return float(filled / reached)

    def next_is_due(self) -> bool:
        """Advance by one frame; whether its counts are to be learned, for all frames until the next such one."""
        self._frames += 1
        return (self._frames - 1) % self.interval == 0

    def learn(self, counts: Floats, filled: Floats, frames: int = 1) -> None:
        """Add the counts of one frame, 0 for a blind view, as many times as the `frames` that it represents."""
        for total, count in ((self.counts, counts), (self.filled, filled)):
            total.forget(frames=frames)
            total.add(total.seconds(count))


def cells_per_person(grid: Grid, height: float, reach: float) -> tuple[float, float]:
    """Number of cells that one person's pillar fills, and number within reach of the person."""
    radius = np.interp(grid.heights / height, PROFILE[:, 0], PROFILE[:, 1], right=0.0)
    filled = float((np.pi * radius**2).sum() / grid.cell**2)
    return max(filled, 1.0), max(grid.planes * np.pi * reach**2 / grid.cell**2, 1.0)


@kernel
def _error_posterior(rate: float, likelihood: float) -> float:
    """Posterior probability of an error of prior `rate`, given its likelihood: the E step."""
    error = rate * likelihood
    return error / (error + (1.0 - rate) * (1.0 - likelihood))


@kernel
def fill_counts(
    views: FrameTerms,
    sums: Sums,
    inside: Flags,
    counted: Ints,
    number: Floats,
    trusted: Flags,
    rates: Floats,
    observations: float,
    prior: float,
    errors: Floats,
    trials: Floats,
) -> None:
    """Fill errors and trials (view, 3) with each view's errors and trials of m, b and b' in a frame, in cells.

    Parameters
    ----------
    views, sums
        The views' terms, and their sums.
    inside : bool (n,)
        Whether the pillar of the person near it fills each cell.
    counted : int64 (c,), number : float64 (c,)
        The cells that are counted, and those that each stands for where no person is near.
    trusted : bool (view, person)
        Persons supported by the rest of the evidence, and not hidden from the view.
    rates : float64 (view, 3)
        m, b and b' so far.
    observations
        k of `stseg.occupancy.fusion`.
    prior
        Prior log-odds of a cell near no person, nats.
    """
    errors[:], trials[:] = 0.0, 0.0
    wrong, empty, all_wrong, all_empty = np.zeros((4, len(views.weight)))
    last = -1
    for k, c in enumerate(counted):
        if views.near_person[c] >= 0:
            _count_beside_person(views, c, inside[c], trusted, rates, errors, trials)
            continue
        if last < 0 or number[k] != number[last] or not _are_seen_alike(views, c, counted[last]):
            last = k
            for i in range(len(wrong)):
                level, share = views.levels[i, c], views.share[i, c]
                wrong[i], empty[i] = 0.0, 0.0
                if level >= 0 and share > 0.0:
                    empty[i] = number[k] * share / (1.0 + _occupied_odds(views, sums, i, c, observations, prior))
                    wrong[i] = _error_posterior(rates[i, CLUTTER], level / TOP_LEVEL) * empty[i]
        for i in range(len(wrong)):
            all_wrong[i] += wrong[i]
            all_empty[i] += empty[i]
    for i in range(len(wrong)):
        errors[i, CLUTTER], trials[i, CLUTTER] = all_wrong[i], all_empty[i]


@part
def _are_seen_alike(views: FrameTerms, one: int, other: int) -> bool:
    """Whether all views see two cells alike, which saves exponentials."""
    for i in range(len(views.weight)):
        level = views.levels[i, one]
        if level != views.levels[i, other] or (level >= 0 and views.share[i, one] != views.share[i, other]):
            return False
    return True


@part
def _count_beside_person(
    views: FrameTerms, c: int, is_inside: bool, trusted: Flags, rates: Floats, errors: Floats, trials: Floats
) -> None:
    """Count a cell within reach of a person."""
    for i in range(len(views.weight)):
        level, share = views.levels[i, c], views.share[i, c]
        if level >= 0 and share > 0.0 and trusted[i, views.near_person[c]]:
            likelihood = level / TOP_LEVEL
            rate, error_likelihood = (MISS, 1.0 - likelihood) if is_inside else (NEAR_CLUTTER, likelihood)
            errors[i, rate] += _error_posterior(rates[i, rate], error_likelihood) * share
            trials[i, rate] += share


@part
def _occupied_odds(views: FrameTerms, sums: Sums, i: int, c: int, observations: float, prior: float) -> float:
    """Odds that a cell near no person is occupied, by all views but one that sees it."""
    weight, share, others = views.weight[i], views.share[i, c], prior
    rest = sums.weights[c] - weight * share
    if rest > _LEAST_WEIGHT * weight:
        own_term = weight * share * views.terms[i, 0, views.levels[i, c]]
        others += observations * (sums.shares[c] - share) * (sums.weighted[c] - own_term) / rest
    return float(np.exp(min(max(others, -30.0), 30.0)))
