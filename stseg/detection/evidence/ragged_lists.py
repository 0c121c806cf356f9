"""Lists of different lengths, one behind the other, for kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel, part


class Lists(NamedTuple):
    """The list of row r is `item[start[r]:start[r + 1]]`, with `value` beside it.

    Attributes
    ----------
    start : int64 (row + 1,)
    item : int64 (k,)
    value : float64 (k,)
    """

    start: Ints
    item: Ints
    value: Floats


@kernel
def lists_of(number: Ints) -> tuple[Lists, Ints]:
    """Lists with room for number (row,) of items each, and the places of their next items, int64 (row,)."""
    start = np.zeros(len(number) + 1, np.int64)
    for row in range(len(number)):
        start[row + 1] = start[row] + number[row]
    return Lists(start, np.empty(start[-1], np.int64), np.empty(start[-1])), start[:-1].copy()


@part
def append(lists: Lists, place: Ints, row: int, item: int, value: float) -> None:
    """Add an item to the list of a row, at its next place."""
    lists.item[place[row]], lists.value[place[row]] = item, value
    place[row] += 1


def no_lists() -> Lists:
    """Of no rows."""
    return Lists(np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0))
