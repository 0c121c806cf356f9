"""What of a frame belongs to whom once people explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stseg.arrays import Ints

WORST = -8.0
"""A box never speaks more strongly against a place or a size than this, nats: it may not be theirs after all."""


@dataclass(frozen=True)
class Assignment:
    """What belongs to each of some people.

    Attributes
    ----------
    box : int64 (view, person)
        The box of each; -1 for none, and in views with pixels.
    pixels : sequence of int64 (v, u), one a view
        The person to whom each raster pixel belongs, -1 for nobody: those are open to everybody. Nothing reads it of a
        view with boxes.
    """

    box: Ints
    pixels: Sequence[Ints]
