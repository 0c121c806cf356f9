"""Connected pieces of labelled ground cells of one frame."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.arrays import Floats, Ints, Labels

UNASSIGNED = -1
"""Label of occupied cells that no track claims."""


@dataclass(frozen=True)
class Blobs:
    """The blobs of one frame.

    Attributes
    ----------
    cells : int32 (y, x)
        Blob of each ground cell, counted from 1; 0 for none.
    track : int64 (n,)
        The track that claims each blob; UNASSIGNED for none.
    person : int64 (n,)
        The detected person that each blob holds, -1 for none.
    ground : float64 (n, 2)
        Centroid of the likelihood-weighted mass, metres.
    covariance : float64 (n, 2, 2)
        Square metres.
    extent : float64 (n,)
        Ground area, square metres.
    height : float64 (n,)
        Height of the uppermost occupied plane, metres.
    mass : float64 (n,)
        Mean log-odds of the occupied cells, nats.
    touches : int64 (k, 2)
        Pairs of blobs (counted from 0) that share one connected piece of ground.
    """

    cells: Labels
    track: Ints
    person: Ints
    ground: Floats
    covariance: Floats
    extent: Floats
    height: Floats
    mass: Floats
    touches: Ints
