"""What of a frame belongs to one person once somebody explains it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.ghosts.views import PixelView, View

WORST = -8.0
"""A box never speaks more strongly against a place or a size than this, nats: it may not be theirs after all."""


@dataclass(frozen=True)
class Own:
    """What belongs to one person in one view: a box (its index, -1 for none), or the raster's pixels open to them."""

    box: int
    pixels: Flags


def owned(view: View, person: int, boxes: Ints, pixels: Ints) -> Own:
    """What of a view belongs to a person: the box assigned, or the pixels of nobody else."""
    if isinstance(view, PixelView):
        return Own(-1, (pixels == person) | (pixels < 0))
    theirs = np.flatnonzero(boxes == person)
    return Own(int(theirs[0]) if len(theirs) else -1, np.zeros((0, 0), bool))
