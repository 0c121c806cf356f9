"""What it costs that the rows of a frame are those of identities, of nobody known, or of whom constraints demand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.rules import Rules
from stseg.identities.search.pasts import Pasts, predicted_variance, size_evidence
from stseg.kernels.accelerate import kernel, part

FORBIDDEN = 1e6
"""Cost of an assignment that is not allowed, nats."""
UNLIKELY = 200.0
"""Cost of an assignment that is demanded though the person is far away, nats."""
CONTRADICTION = 1e4
"""Cost of an assignment against a constraint, nats: taken only where constraints contradict each other."""


class RowCosts(NamedTuple):
    """Costs of the rows of a frame, nats.

    Attributes
    ----------
    cost : float64 (past, row)
        As those of each past.
    follower : int64 (past,)
        The row that certainly follows each, -1 for none.
    begun : float64 (row,)
        As somebody new.
    """

    cost: Floats
    follower: Ints
    begun: Floats


@kernel
def row_costs(pasts: Pasts, size: int, first: int, rows: int, now: float, seen: ObservedRows, rules: Rules) -> RowCosts:
    """Costs of the rows of a frame, which begin with `first`, as those of some pasts."""
    sizes = len(rules.spread)
    costs = RowCosts(np.empty((size, rows)), np.empty(size, np.int64), np.empty(rows))
    costs.cost[:] = FORBIDDEN
    costs.follower[:] = -1
    alone = np.empty((rows, sizes))
    for i in range(rows):
        r, evidence = first + i, 0.0
        for d in range(sizes):
            alone[i, d] = size_evidence(seen.precision[r, d], seen.information[r, d], rules.spread[d])
            evidence += alone[i, d]
        costs.begun[i] = rules.birth * seen.inside[r] - evidence
    for p in range(size):
        _fill_costs(pasts, p, first, now, seen, rules, alone, costs)
    return costs


@part
def _fill_costs(
    pasts: Pasts, p: int, first: int, now: float, seen: ObservedRows, rules: Rules, alone: Floats,
    costs: RowCosts,
) -> None:  # fmt: skip
    """Fill the costs of rows as those of the p-th past; sizes say `alone` (row, size) of somebody new."""
    since = now - pasts.seconds[p]
    x = pasts.state[p, 0] + since * pasts.state[p, 2]
    y = pasts.state[p, 1] + since * pasts.state[p, 3]
    spreads = predicted_variance(pasts.covariance, p, since, rules.turn)
    for i in range(len(alone)):
        r = first + i
        follows = seen.previous[r] == pasts.last[p]
        if seen.certain[r] and not follows:
            continue
        total = spreads + seen.variance[r]
        square = (seen.ground[r, 0] - x) ** 2 + (seen.ground[r, 1] - y) ** 2
        gain = max(-0.5 * square / total, rules.least) - math.log(2.0 * math.pi * total) - rules.absence * since
        if gain < 4.0 * rules.least and not follows:
            continue
        for d in range(alone.shape[1]):
            if seen.precision[r, d] == 0.0:
                continue
            both = pasts.precision[p, d] + seen.precision[r, d]
            together = size_evidence(both, pasts.information[p, d] + seen.information[r, d], rules.spread[d])
            gain += max(together - pasts.evidence[p, d], alone[i, d] - rules.most_against[d] * seen.precision[r, d])
        costs.cost[p, i] = -gain
        if seen.certain[r]:
            costs.follower[p] = i
