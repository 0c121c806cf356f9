"""Frame numbers from the names of files and images."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from stseg.arrays import Ints

_DIGITS = re.compile(r"[0-9]+")


def last_numbers(names: Sequence[str]) -> Ints | None:
    """The last number in each name, int64 (n,); None where a name has none or two share one."""
    found = [_DIGITS.findall(PurePath(name).stem) for name in names]
    numbers = [int(digits[-1][-15:]) for digits in found if digits]
    return None if len(set(numbers)) < len(names) else np.array(numbers, np.int64)


def listed_frames(names: Sequence[str]) -> tuple[Ints, int | None]:
    """Frames of listed images, int64 (n,), and their count.

    Images at equal steps are consecutive frames, counted from 0; with unequal gaps their numbers are the frames, and
    the count is unknown. Names without usable numbers are frames in the order of the list.
    """
    numbers = last_numbers(names)
    if numbers is None:
        return np.arange(len(names), dtype=np.int64), len(names)
    if len(numbers) < 2:
        return np.zeros(len(numbers), np.int64), len(names)
    step = int(np.gcd.reduce(np.diff(np.sort(numbers))))
    ranks = (numbers - numbers.min()) // step
    if int(ranks.max()) + 1 == len(numbers):
        return ranks, len(names)
    return numbers, None
