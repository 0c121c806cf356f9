"""Prior log-odds of a frame's cells, and their revision where a later decision changes the people of the frame."""

import numpy as np
from scipy.special import logit

from stseg.arrays import Floats
from stseg.config import Config, OccupancyConfig
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.records.people import People
from stseg.records.sparse_volume import SparseVolume

NEAR_PRIOR = 0.0
"""Prior log-odds of a cell within reach of a person, nats."""
_BODY_LOG_ODDS = 1.0
"""Least log-odds of the cells inside a body that was added to a frame, nats."""


def cell_prior_log_odds(config: OccupancyConfig) -> float:
    """Prior log-odds of a cell within reach of no person, nats."""
    return float(logit(config.occupied_share))


def revised_volume(
    volume: SparseVolume, before: Floats, people: Floats, added: People, grid: Grid, config: Config
) -> SparseVolume:
    """Log-odds with the prior of the revised people, and at least the odds of a body inside the added ones.

    Parameters
    ----------
    volume
        Log-odds of the frame.
    before, people : float64 (n, 2), (m, 2)
        Places of the people by which the volume was fused, and of the revised ones, metres.
    added
        Those of the revised people who were not among the former.
    grid, config
        The cells, the prior by which they were fused, and the width of a body.
    """
    ground, radius = grid.ground.reshape(-1, 2), config.occupancy.person_radius
    near_before = nearest_person(ground, before, radius) >= 0
    near_people = nearest_person(ground, people, radius) >= 0
    body = nearest_person(ground, added.ground, config.body.width_mean / 2)
    places = np.flatnonzero((near_before != near_people) | (body >= 0))
    body = body[places]
    change = near_people[places].astype(np.float32) - near_before[places]
    prior = NEAR_PRIOR - cell_prior_log_odds(config.occupancy)
    log_odds = volume.at(places) + (prior * change).astype(np.float32)
    tall = np.append(added.height, -1.0)[body] >= grid.heights[:, None]
    revised = np.where(tall & (body >= 0), np.fmax(log_odds, np.float32(_BODY_LOG_ODDS)), log_odds)
    return volume.with_values(places, revised)
