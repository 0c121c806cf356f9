"""Who stands where in one frame, as the labels of its pixels are told."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.arrays import Floats


@dataclass(frozen=True)
class PlacedPeople:
    """People of one frame.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres.
    covariance : float64 (n, 2, 2)
        How far each place may be off, square metres.
    height : float64 (n,)
        Metres.
    """

    ground: Floats
    covariance: Floats
    height: Floats

    def __len__(self) -> int:
        return len(self.ground)
