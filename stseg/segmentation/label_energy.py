"""Unary terms of track labels (docs/how-it-works.md, Energy).

    D_p(k) = -u(p) - log share_p(k),     sum_k share_p(k) = 1

u decides whether the cell is occupied, the share by which track. Where one body is near its share is 1: division costs
nothing, and the labels have the energy of the binary cut.

    share_p(k)  ~  N(p; m_k, S_k + R^2/4) / N(0; 0, R^2/4)  *  exp(-(z_p - h_k)^2 / (2 s^2)) above the head

m_k and S_k are predicted place and covariance of track k in the cell's frame; R^2/4 is the variance of a disc of radius
R, the reach of a body's cells around its place. An unknown body may be anywhere: UNASSIGNED weighs pi at every cell,
the prior share of occupied cells.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.graphcut.cell_subset import CellSubset
from stseg.graphcut.expansion import LabelEnergy
from stseg.graphcut.grid_energy import QUANTUM
from stseg.kernels.accelerate import kernel
from stseg.records.predicted_tracks import PredictedPlaces

PLACE_GATE = 13.8
"""Squared Mahalanobis distance that one place in a thousand exceeds (chi square, two degrees of freedom)."""


@dataclass(frozen=True)
class BodyShape:
    """Extent of every body."""

    reach: float
    """R: reach of a body's cells around its place, metres."""
    height_spread: float
    """s: standard deviation of a head's height, metres."""
    prior_share: float
    """pi: prior share of occupied cells, 0..1."""


class _TrackDensities(NamedTuple):
    """Densities of places predicted for tracks, each (time, k, ...): as of `PredictedPlaces`, metres."""

    expected: Flags
    ground: Floats
    precision: Floats
    log_volume: Floats
    height: Floats


def track_shares(frame: Ints, ground: Floats, height: Floats, predicted: PredictedPlaces, body: BodyShape) -> Floats:
    """Share of each track and, last, of UNASSIGNED in each cell, given that the cell is occupied, float64 (n, k + 1).

    Shares are 0 outside the gate; rows sum to one. Of each cell are `frame` int64 (n,), counted from the window's
    first, `ground` float64 (n, 2) and `height` float64 (n,), metres.
    """
    disc = body.reach**2 / 4
    spread = predicted.covariance + disc * np.eye(2)
    log_volume = 0.5 * np.log(np.linalg.det(spread)) - math.log(disc)
    weight = np.empty((len(frame), len(predicted.track) + 1))
    precision: Floats = np.asarray(np.linalg.inv(spread), float)
    tracks = _TrackDensities(predicted.expected, predicted.ground, precision, log_volume, predicted.height)
    _fill_log_weights(frame, ground, height, tracks, body.height_spread, weight)
    weight[:, -1] = math.log(body.prior_share)
    share = np.exp(weight - weight.max(1, keepdims=True))
    return np.asarray(share / share.sum(1, keepdims=True))


def label_energy(unary: Ints | Labels, share: Floats, subgraph: CellSubset) -> LabelEnergy:
    """Energy of the division of a subgraph.

    `unary` int32 or int64 (n,) is u of its cells, quanta. `share` float64 (n, k + 1) is as `track_shares` returns it;
    column j has label j + 1. Labels with share 0 are inadmissible.
    """
    cell, column = np.nonzero(share)
    penalty = np.rint(-np.log(share[cell, column]) / QUANTUM).astype(np.int64)
    first = np.append(0, np.cumsum(np.bincount(cell, minlength=len(unary))))
    cost = penalty - unary[cell] + subgraph.border[cell]
    return LabelEnergy(first, column + 1, cost, subgraph.start, subgraph.end, subgraph.weight)


@kernel
def _fill_log_weights(
    frame: Ints, ground: Floats, height: Floats, tracks: _TrackDensities, height_spread: float, weight: Floats
) -> None:
    """Fill weight (n, k + 1) with the tracks' log-weights, nats; -inf outside the gate."""
    for i in range(len(frame)):
        t = frame[i]
        for k in range(tracks.ground.shape[1]):
            dx, dy = ground[i, 0] - tracks.ground[t, k, 0], ground[i, 1] - tracks.ground[t, k, 1]
            inverse = tracks.precision[t, k]
            square = inverse[0, 0] * dx * dx + (inverse[0, 1] + inverse[1, 0]) * dx * dy + inverse[1, 1] * dy * dy
            if not tracks.expected[t, k] or square > PLACE_GATE:
                weight[i, k] = -np.inf
                continue
            above = max(height[i] - tracks.height[t, k], 0.0) / height_spread
            weight[i, k] = -(0.5 * square + tracks.log_volume[t, k] + 0.5 * above * above)
