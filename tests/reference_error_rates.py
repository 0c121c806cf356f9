"""What a frame teaches of one view's rates by its definition, cell by cell: slow, plain."""

from typing import NamedTuple

import numpy as np
from scipy.special import expit

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.geometry.summed_area import TOP_LEVEL, Levels
from stseg.occupancy.fusion import ErrorRates, log_odds_terms


class Shown(NamedTuple):
    """What each view shows of each cell: levels int16 and share, float32 (view, plane, y, x)."""

    levels: tuple[Levels, ...]
    share: tuple[Singles, ...]


def counts(
    shown: Shown, view: int, near: Ints, inside: Flags, trusted: Flags, rates: list[ErrorRates], worth: float,
    prior: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Errors and chances of m, b and b' in cells; all views weigh the same."""
    errors, seen = np.zeros(3), np.zeros(3)
    for cell in np.ndindex(*inside.shape):
        level, share = shown.levels[view][cell], float(shown.share[view][cell])
        if level < 0 or share == 0:
            continue
        likelihood, person, mine = int(level) / TOP_LEVEL, near[cell[1:]], rates[view]
        if person < 0:
            others = [i for i in range(len(rates)) if i != view and shown.levels[i][cell] >= 0]
            terms = [shown.share[i][cell] * log_odds_terms(rates[i])[0, shown.levels[i][cell]] for i in others]
            empty = share * float(expit(-prior - worth * sum(terms)))
            errors[1] += empty * _posterior(mine.clutter, likelihood)
            seen[1] += empty
        elif trusted[person]:
            kind = 0 if inside[cell] else 2
            wrong = 1 - likelihood if kind == 0 else likelihood
            errors[kind] += share * _posterior(mine[kind], wrong)
            seen[kind] += share
    return errors, seen


def _posterior(rate: float, likelihood: float) -> float:
    return rate * likelihood / (rate * likelihood + (1 - rate) * (1 - likelihood))
