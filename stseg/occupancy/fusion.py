"""The volume of one frame: what all views say of each cell, as calibrated log-odds (METHODS 3, 4; KS09 eqs 1 to 7).

    u(p) = n_vis sum_i w_i log[ ((1 - m) L_i + m (1 - L_i)) / (b L_i + (1 - b)(1 - L_i)) ] + log(pi / (1 - pi))

over the views i that see cell p past nearer people, n_vis of them, with clutter weights w_i that sum to one. Evidence
that a person elsewhere explains does not speak for the cell (METHODS 7), so L_i = 0 there. pi is one half within reach
of a person whom the pass of the frame found, where only the cells are left to decide, and `prior` elsewhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles

SHOULDER = 0.3
"""A person hides what is at least this much farther from the camera than they are, metres."""


class Rates(NamedTuple):
    """How a view errs: m, how often a body is missed, and b, how often an empty ray meets foreground (METHODS 4)."""

    miss: float
    clutter: float


@kernel
def fill_terms(
    pixel: NDArray[np.int16],
    likelihood: Singles,
    per_plane: Singles,
    owner: NDArray[np.int16],
    owner_step: int,
    near: Ints,
    has_box: NDArray[np.bool_],
    visible: Floats,
    distance: Singles,
    person_distance: Floats,
    rates: Rates,
    weight: float,
    weighted: Floats,
    weights: Floats,
    count: NDArray[np.uint8],
) -> None:
    """Add one view's weighted log-odds to the frame's sums.

    Parameters
    ----------
    pixel : int16 (plane, y, x, 2)
        Column and row that show each cell, -1 unseen.
    likelihood : float32 (v, u)
        The view's map; empty where it delivers instances.
    per_plane : float32 (plane, y, x)
        Likelihood per plane from instances; empty where the view delivers a map.
    owner : int16 (v, u)
        Person whose body is nearest at each pixel of a raster, -1 for nobody; `owner_step` pixels to a raster pixel.
    near : int64 (y, x)
        Person near each cell, -1 for nobody.
    has_box : bool (person,)
        Whether this view's instances show the person.
    visible : float64 (person,)
        How much of the person the view can see; a missing instance says that much less.
    distance : float32 (y, x), person_distance : float64 (person,)
        From the camera along the ground, metres.
    weighted, weights : float64 (plane, y, x), count : uint8 (plane, y, x)
        Sums of w_i times log-odds and of w_i, and the number of views, added to.
    """
    planes, rows, columns, _ = pixel.shape
    from_map = likelihood.size > 0
    for z in range(planes):
        for y in range(rows):
            for x in range(columns):
                u, v = pixel[z, y, x, 0], pixel[z, y, x, 1]
                if u < 0:
                    continue
                seen = likelihood[v, u] if from_map else per_plane[z, y, x]
                person = owner[v // owner_step, u // owner_step]
                mine = near[y, x]
                if person >= 0 and person != mine and not (mine >= 0 and has_box[mine]):
                    if person_distance[person] < distance[y, x] - SHOULDER:
                        continue
                    if from_map:
                        seen = np.float32(0.0)
                body = (1.0 - rates.miss) * seen + rates.miss * (1.0 - seen)
                empty = rates.clutter * seen + (1.0 - rates.clutter) * (1.0 - seen)
                term = np.log(body / empty)
                if mine >= 0 and not from_map and not has_box[mine]:
                    term *= visible[mine]
                weighted[z, y, x] += weight * term
                weights[z, y, x] += weight
                count[z, y, x] += 1


@kernel
def fill_log_odds(
    weighted: Floats,
    weights: Floats,
    count: NDArray[np.uint8],
    views: NDArray[np.uint8],
    near: Ints,
    prior: float,
    log_odds: Singles,
) -> None:
    """Fill log_odds (plane, y, x): nan where no view's image holds the cell, the prior where all are hidden."""
    for z in range(views.shape[0]):
        for y in range(views.shape[1]):
            for x in range(views.shape[2]):
                if views[z, y, x] == 0:
                    log_odds[z, y, x] = np.nan
                    continue
                total = 0.0 if near[y, x] >= 0 else prior
                if count[z, y, x] > 0:
                    total += count[z, y, x] * weighted[z, y, x] / weights[z, y, x]
                log_odds[z, y, x] = total
