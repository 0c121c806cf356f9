"""Paths of candidates by a minimum-cost flow (Zhang, Li and Nevatia, CVPR 2008), and marginals along them."""

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

from stseg.arrays import Floats, Ints

_QUANTUM = 1e-6
"""Unit of the matching's costs, nats. In whole units sums are exact: by rounded ones the matching may never end."""


def best_paths(gain: Floats, start: Ints, end: Ints, bonus: Floats) -> Ints:
    """Successor of each candidate on the paths of greatest total gain, -1 for none, int64 (n,).

    A bipartite matching: rows are the ends of candidates, columns their beginnings. A candidate that is unused is
    matched to itself; one that is used is matched to its successor, or to an end of its own.
    """
    n = len(gain)
    each = np.arange(n)
    # Rows: n candidates as predecessors, n births. Columns: n candidates as successors, n deaths.
    rows = np.concatenate([each, start, each, n + each, n + end, n + each])
    columns = np.concatenate([each, end, n + each, each, n + start, n + each])
    cost = np.concatenate([np.zeros(n), -gain[end] - bonus, np.zeros(n), -gain, np.zeros(len(start) + n)])
    cost = np.rint(cost / _QUANTUM)
    lift = 1.0 - cost.min()  # explicit zeros are no edges; every perfect matching has as many
    table = coo_array((cost + lift, (rows, columns)), shape=(2 * n, 2 * n)).tocsr()
    _, partner = min_weight_full_bipartite_matching(table)
    successor = partner[:n].astype(np.int64)
    return np.where((successor < n) & (successor != each), successor, -1)


def path_marginals(gain: Floats, start: Ints, end: Ints, bonus: Floats) -> Floats:
    """Marginal log-odds of each candidate on its path by messages both ways, nats; links in order of time."""
    gains, forward, backward = gain.tolist(), gain.tolist(), [0.0] * len(gain)  # lists: few links, one after the other
    for i, j, b in zip(start.tolist(), end.tolist(), bonus.tolist(), strict=True):
        forward[j] += _message(forward[i], b)
    for i, j, b in zip(start[::-1].tolist(), end[::-1].tolist(), bonus[::-1].tolist(), strict=True):
        backward[i] += _message(gains[j] + backward[j], b)
    return np.asarray(np.array(forward) + np.array(backward))


def _message(log_odds: float, bonus: float) -> float:
    """Message of a neighbour with these log-odds across a link, nats."""
    return _log_one_and(log_odds + bonus) - _log_one_and(log_odds)


def _log_one_and(nats: float) -> float:
    """log(1 + e^x)."""
    return max(nats, 0.0) + math.log1p(math.exp(-abs(nats)))
