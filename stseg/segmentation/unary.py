"""What it costs to say whose a cell is: the labels of an expansion (METHODS 4).

    D_p(k) = -u(p) - log share_p(k),     sum_k share_p(k) = 1

u says whether there is a body at the cell, the share says whose it is. So dividing cells costs nothing where only one
body is near, and the labels together are worth what the two-label cut's object was worth.

    share_p(k)  ~  N(p; m_k, S_k + R^2/4) / N(0; 0, R^2/4)  *  exp(-(z_p - h_k)^2 / (2 s^2)) above the head

m_k and S_k are where the body of track k is expected in the cell's frame and how surely; R^2/4 is the variance of a
disc of radius R, the reach of a body's cells around its place. A stranger, whom no track tells of, may be anywhere: of
every cell their share is as pi, the share of cells that a body fills where nobody is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.graphcut.cell_subset import CellSubset
from stseg.graphcut.energy import QUANTUM
from stseg.graphcut.expansion import LabelEnergy
from stseg.model.predicted_places import PredictedPlaces

_GATE = 13.8
"""Squared Mahalanobis distance beyond which a cell is not of a body: one of its cells in a thousand."""


@dataclass(frozen=True)
class BodyShape:
    """What is known of every body.

    Attributes
    ----------
    reach
        R: how far from a person's place their cells reach, metres.
    height_spread
        s: how far off the height of a head is, metres (standard deviation).
    stranger
        pi: share of cells that a body fills where nobody is known, 0..1.
    """

    reach: float
    height_spread: float
    stranger: float


def shares(
    frame: Ints,
    ground: Floats,
    height: Floats,
    places: PredictedPlaces,
    pillar: BodyShape,
    appearance: Floats | None = None,
) -> Floats:
    """Whose body each cell is of, if it is of a body at all.

    Parameters
    ----------
    frame : int64 (n,)
        Frame of each cell, counted from the window's first.
    ground, height : float64 (n, 2), (n,)
        Of the cells, metres.
    appearance : float64 (n, k), optional
        How much likelier what is seen at a cell is on each track's body than on anybody's, nats.

    Returns
    -------
    float64 (n, k + 1)
        Of each track and, last, of a stranger; 0 where a body is out of reach. Rows sum to one.
    """
    body = pillar.reach**2 / 4
    spread = places.covariance + body * np.eye(2)
    wide = 0.5 * np.log(np.linalg.det(spread)) - math.log(body)
    weight = np.zeros((len(frame), len(places.track) + 1)) if appearance is None else _with_stranger(appearance)
    precision: Floats = np.asarray(np.linalg.inv(spread), float)
    _fill_weights(
        frame, ground, height, places.expected, places.ground, precision, wide, places.height,
        pillar.height_spread, weight,
    )  # fmt: skip
    weight[:, -1] = math.log(pillar.stranger)
    share = np.exp(weight - weight.max(1, keepdims=True))
    return np.asarray(share / share.sum(1, keepdims=True))


def label_energy(unary: Ints | Labels, share: Floats, part: CellSubset) -> LabelEnergy:
    """The energy of dividing a part of a window.

    Parameters
    ----------
    unary : int32 or int64 (n,)
        u of the part's cells, quanta.
    share : float64 (n, k + 1)
        As `shares` returns; label j + 1 has column j. Labels without a share are not admissible.
    """
    cell, column = np.nonzero(share)
    penalty = np.rint(-np.log(share[cell, column]) / QUANTUM).astype(np.int64)
    first = np.append(0, np.cumsum(np.bincount(cell, minlength=len(unary))))
    cost = penalty - unary[cell] + part.border[cell]
    return LabelEnergy(first, column + 1, cost, part.start, part.end, part.weight)


def _with_stranger(appearance: Floats) -> Floats:
    return np.column_stack([appearance, np.zeros(len(appearance))])


@kernel
def _fill_weights(
    frame: Ints,
    ground: Floats,
    height: Floats,
    expected: Flags,
    place: Floats,
    precision: Floats,
    wide: Floats,
    head: Floats,
    height_spread: float,
    weight: Floats,
) -> None:
    """Add the logarithms of the tracks' weights to weight (n, k + 1), nats; -inf where a body is out of reach."""
    for i in range(len(frame)):
        t = frame[i]
        for k in range(place.shape[1]):
            dx, dy = ground[i, 0] - place[t, k, 0], ground[i, 1] - place[t, k, 1]
            way = precision[t, k]
            square = way[0, 0] * dx * dx + (way[0, 1] + way[1, 0]) * dx * dy + way[1, 1] * dy * dy
            if not expected[t, k] or square > _GATE:
                weight[i, k] = -np.inf
                continue
            above = max(height[i] - head[t, k], 0.0) / height_spread
            weight[i, k] -= 0.5 * square + wide[t, k] + 0.5 * above * above
