"""The constants of the identity search."""

from __future__ import annotations

from typing import NamedTuple

from stseg.arrays import Floats


class Rules(NamedTuple):
    """Constants of the search.

    Attributes
    ----------
    birth, absence
        Costs of a birth or a death inside the area, nats, and of being unseen, nats per second.
    least
        Least evidence of a place against an identity, nats.
    longest
        Longest time out of sight, seconds.
    alternative_loss, beam_loss
        Greatest loss of an alternative in one frame, and of a hypothesis against the best, nats.
    turn, pace
        Variances of the velocity gained in a second, and of that of somebody new.
    spread, most_against : float64 (size,)
        Variance of each size among people, and the greatest evidence of a look for somebody new, nats times variance.
    """

    birth: float
    absence: float
    least: float
    longest: float
    alternative_loss: float
    beam_loss: float
    turn: float
    pace: float
    spread: Floats
    most_against: Floats
