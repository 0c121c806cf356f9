"""What a recording that still goes on delivers."""

from __future__ import annotations

import time
from dataclasses import dataclass

from stseg.arrays import Observation

_ZERO = time.time() - time.monotonic()


def now() -> float:
    """Seconds since 1970, by a clock that is never set while it runs."""
    return _ZERO + time.monotonic()


@dataclass(frozen=True, slots=True)
class LiveMoment:
    """What all cameras saw at one time.

    Attributes
    ----------
    frame
        The recording's frame.
    views
        One observation per camera in the rig's order, None where a camera is blind.
    arrived
        When it could first be worked on, by `now`.
    dropped
        Whether there were views that were dropped, since work is slower than the cameras.
    """

    frame: int
    views: tuple[Observation, ...]
    arrived: float
    dropped: bool = False
