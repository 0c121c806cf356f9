"""Costs of the rows of a frame as those of identities or of new people."""

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.hypotheses import Pasts, Rules, predicted_variance, size_evidence
from stseg.kernels.accelerate import kernel, part

FORBIDDEN = 1e6
"""Cost of an assignment that is not allowed, nats."""
UNLIKELY = 200.0
"""Cost of an assignment that is demanded though the person is far away, nats."""
CONTRADICTION = 1e4
"""Cost of an assignment against a constraint, nats: taken only where constraints contradict each other."""


class RowCosts(NamedTuple):
    """Costs of the rows of a frame, nats."""

    cost: Floats
    """float64 (past, row): as those of each past."""
    follower: Ints
    """int64 (past,): the row that certainly follows each, -1 for none."""
    begun: Floats
    """float64 (row,): as a new person."""


@kernel
def row_costs(
    pasts: Pasts, size: int, first: int, rows: int, now: float, observed: ObservedRows, rules: Rules
) -> RowCosts:
    """Costs of the rows of a frame, which begin with `first`, as those of some pasts."""
    sizes = len(rules.spread)
    costs = RowCosts(np.empty((size, rows)), np.empty(size, np.int64), np.empty(rows))
    costs.cost[:] = FORBIDDEN
    costs.follower[:] = -1
    alone = np.empty((rows, sizes))
    for i in range(rows):
        r, evidence = first + i, 0.0
        for d in range(sizes):
            alone[i, d] = size_evidence(observed.precision[r, d], observed.information[r, d], rules.spread[d])
            evidence += alone[i, d]
        costs.begun[i] = rules.birth * observed.inside[r] - evidence
    for p in range(size):
        _fill_costs(pasts, p, first, now, observed, rules, alone, costs)
    return costs


@part
def _fill_costs(
    pasts: Pasts, p: int, first: int, now: float, observed: ObservedRows, rules: Rules, alone: Floats, costs: RowCosts
) -> None:
    """Fill the costs of rows as those of the p-th past; `alone` (row, size) is the size evidence of new people."""
    since = now - pasts.seconds[p]
    x = pasts.state[p, 0] + since * pasts.state[p, 2]
    y = pasts.state[p, 1] + since * pasts.state[p, 3]
    spreads = predicted_variance(pasts.covariance, p, since, rules.process_noise)
    for i in range(len(alone)):
        r = first + i
        if observed.certain[r] and observed.previous[r] != pasts.last[p]:
            continue
        total = spreads + observed.variance[r]
        square = (observed.ground[r, 0] - x) ** 2 + (observed.ground[r, 1] - y) ** 2
        gain = -0.5 * square / total - math.log(2.0 * math.pi * total) - rules.absence * since
        for d in range(alone.shape[1]):
            if observed.precision[r, d] == 0.0:
                continue
            both = pasts.precision[p, d] + observed.precision[r, d]
            together = size_evidence(both, pasts.information[p, d] + observed.information[r, d], rules.spread[d])
            gain += max(together - pasts.evidence[p, d], alone[i, d] - rules.most_against[d] * observed.precision[r, d])
        costs.cost[p, i] = -gain
        if observed.certain[r]:
            costs.follower[p] = i
