"""Assignment of one frame's boxes and pixels to people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Shorts

WORST = -8.0
"""Least log-likelihood of a box in a person's posterior, nats: beyond it the assignment itself is in doubt."""


@dataclass(frozen=True)
class Assignment:
    """What is assigned to each of some people.

    Attributes
    ----------
    box : int64 (view, person)
        The box of each; -1 for none, and in views with pixels.
    pixels : sequence of int16 (v, u), one a view
        The number of the person whom each raster pixel is assigned to, -1 for none: those are open to everybody. Not
        read for views with boxes.
    number : int64 (person,)
        The number of each, by which pixels name them; others have numbers, too.
    """

    box: Ints
    pixels: Sequence[Shorts]
    number: Ints

    @classmethod
    def of_all(cls, box: Ints, pixels: Sequence[Shorts]) -> Assignment:
        """What is assigned to people who are numbered as they stand."""
        return cls(box, pixels, np.arange(box.shape[1]))

    def of(self, chosen: Ints) -> Assignment:
        """What is assigned to some of the people, int64 (k,)."""
        return Assignment(self.box[:, chosen], self.pixels, self.number[chosen])
