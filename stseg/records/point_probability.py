"""Probability that a point of a track is a person, by its score and by the number of views that see its place.

A score is the evidence for a person given the others of a set. Another set may explain the views as well, by people
elsewhere, the more so the fewer views see a place: by any score, a point is wrong as often as those of as many views.
Boxes name their people one by one; silhouettes that join are explained by other people more often.
"""

from collections.abc import Collection

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Rows

_WRONG_BY_BOXES = np.array([0.5, 0.45, 0.011, 0.007, 0.005, 0.001])
_WRONG_BY_PIXELS = np.array([0.5, 0.45, 0.025, 0.007, 0.005, 0.001])
"""Shares of wrong points by the number of views, the last one for more: of choices of the cameras of six recordings."""


def point_probability(rows: Rows, kinds: Collection[str]) -> Floats:
    """Probability of a person at each row of TRAJECTORY (n,), float64 (n,); scores are log-odds, nats.

    `kinds` are those of the cameras' sources (`stseg.io.recording.recording`).
    """
    wrong = _WRONG_BY_BOXES if {*kinds} <= {"boxes", "instances"} else _WRONG_BY_PIXELS
    wrong = wrong[np.minimum(rows["views"], len(wrong) - 1)]
    return np.asarray(expit(rows["score"].astype(float)) * (1.0 - wrong))
