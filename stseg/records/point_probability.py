"""Probability that a point of a track is a person, by its score and by the number of views that see its place.

A score is the evidence for a person given the others of a set. Another set may explain the views as well, by people
elsewhere, the more so the fewer views see a place: by any score, a point is wrong as often as those of as many views.
"""

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Rows

WRONG_SHARES = np.array([0.5, 0.45, 0.025, 0.007, 0.005, 0.001])
"""Share of wrong points by the number of views, the last one for more: of choices of the cameras of six recordings."""


def point_probability(rows: Rows) -> Floats:
    """Probability of a person at each row of TRAJECTORY (n,), float64 (n,); scores are log-odds, nats."""
    wrong = WRONG_SHARES[np.minimum(rows["views"], len(WRONG_SHARES) - 1)]
    return np.asarray(expit(rows["score"].astype(float)) * (1.0 - wrong))
