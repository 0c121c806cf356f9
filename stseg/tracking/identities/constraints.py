"""Hard constraints of the identity search: pairs of rows that are one person, or two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints


@dataclass(frozen=True)
class Constraints:
    """Pairs of rows of which it is known whether they are one person.

    Attributes
    ----------
    earlier, later : int64 (constraint,)
        Rows; the frame of the first lies before that of the second.
    same : bool (constraint,)
        One person, or two.
    """

    earlier: Ints
    later: Ints
    same: Flags

    def __len__(self) -> int:
        return len(self.same)

    @classmethod
    def of(cls, same: list[tuple[int, int]], other: list[tuple[int, int]]) -> Constraints:
        """Pairs that are one person, and pairs that are two."""
        pairs = np.array([*same, *other], np.int64).reshape(-1, 2)
        return cls(pairs[:, 0], pairs[:, 1], np.arange(len(pairs)) < len(same))

    def observed(self, order: Ints) -> Constraints:
        """The same of observations, where `order` holds the row of each."""
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return Constraints(place[self.earlier], place[self.later], self.same)

    def most_open(self) -> int:
        """Most pairs of one person that are open at once: their first row seen, their second not yet."""
        ends = np.concatenate([self.earlier[self.same], self.later[self.same]])
        change = np.repeat([1, -1], int(self.same.sum()))
        return int(np.cumsum(change[np.lexsort((change, ends))]).max(initial=0))

    def violated(self, identity: Ints) -> Flags:
        """Which of them identities (row,) do not obey, bool (constraint,)."""
        return np.asarray((identity[self.earlier] == identity[self.later]) != self.same)
