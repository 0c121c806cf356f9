"""Assignment of one frame's boxes and pixels to people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints

WORST = -8.0
"""Least log-likelihood of a box in a person's posterior, nats: beyond it the assignment itself is in doubt."""


@dataclass(frozen=True)
class Assignment:
    """What is assigned to each of some people.

    Attributes
    ----------
    box : int64 (view, person)
        The box of each; -1 for none, and in views with pixels.
    pixels : sequence of int64 (v, u), one a view
        The person whom each raster pixel is assigned to, -1 for none: those are open to everybody. Not read for views
        with boxes.
    """

    box: Ints
    pixels: Sequence[Ints]

    def of(self, chosen: Ints) -> Assignment:
        """What is assigned to some of the people, int64 (k,), who count from 0; others are all person k."""
        number = np.full(self.box.shape[1] + 1, len(chosen))
        number[chosen], number[-1] = np.arange(len(chosen)), -1
        return Assignment(self.box[:, chosen], [number[person] for person in self.pixels])
