"""Connected pieces of labelled ground cells of one frame."""

from dataclasses import dataclass

from stseg.arrays import Floats, Ints, Labels

UNASSIGNED = -1
"""Label of occupied cells that no track claims."""


@dataclass(frozen=True)
class Blobs:
    """The blobs of one frame."""

    cells: Labels
    """int32 (y, x): blob of each ground cell, counted from 1; 0 for none."""
    track: Ints
    """int64 (n,): the track that claims each blob; UNASSIGNED for none."""
    person: Ints
    """int64 (n,): the detected person that each blob holds, -1 for none."""
    ground: Floats
    """float64 (n, 2): centroid of the likelihood-weighted mass, metres."""
    extent: Floats
    """float64 (n,): ground area, square metres."""
    touches: Ints
    """int64 (k, 2): pairs of blobs (counted from 0) that share one connected piece of ground."""
