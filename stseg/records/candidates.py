"""Candidate places of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints


@dataclass(frozen=True)
class Candidates:
    """Places where a person may stand: ground float64 (n, 2), height and width float64 (n,), all in metres."""

    ground: Floats
    height: Floats
    width: Floats

    def __len__(self) -> int:
        return len(self.ground)

    def joined_with(self, other: Candidates) -> Candidates:
        """This pool's candidates, then the other's."""
        pairs = ((self.ground, other.ground), (self.height, other.height), (self.width, other.width))
        return Candidates(*map(np.concatenate, pairs))

    def joined_if_distant(self, other: Candidates, distance: float) -> Candidates:
        """This pool's candidates, then those of the other that stand `distance` metres or more from all before them."""
        joined = self.joined_with(other)
        kept = list(range(len(self)))
        for i in range(len(self), len(joined)):
            if not (np.hypot(*(joined.ground[kept] - joined.ground[i]).T) < distance).any():
                kept.append(i)
        return joined.at(kept)

    def after(self, number: int) -> Candidates:
        """All candidates but the first ones."""
        return Candidates(self.ground[number:], self.height[number:], self.width[number:])

    def new_to(self, pool: Candidates) -> Candidates:
        """Those of these candidates that are not in a pool, with the same place and size."""
        same = (self.ground[:, None] == pool.ground).all(2)
        same &= (self.height[:, None] == pool.height) & (self.width[:, None] == pool.width)
        return self.at(np.flatnonzero(~same.any(1)))

    def at(self, chosen: Sequence[int] | Ints) -> Candidates:
        """The chosen candidates, in that order."""
        index = np.asarray(chosen, int)
        return Candidates(self.ground[index], self.height[index], self.width[index])
