"""Places and heights of the people of one frame."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.arrays import Floats, Ints


@dataclass(frozen=True)
class PlacedPeople:
    """People of one frame, in the order of their labels.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres.
    covariance : float64 (n, 2, 2)
        Covariance of each place, square metres.
    height : float64 (n,)
        Metres.
    track : int64 (n,)
        Ids.
    """

    ground: Floats
    covariance: Floats
    height: Floats
    track: Ints

    def __len__(self) -> int:
        return len(self.ground)
