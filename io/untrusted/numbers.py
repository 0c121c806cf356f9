"""Numbers from outside: the one place where text and parsed values become numbers.

Form, digits, finiteness and range are checked before a number is used; a caller names file and key.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from stseg.io.untrusted import limits

_LONGEST = 400
"""Characters of a number: the longest that Python itself writes has 326."""
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,5})?\s*", re.ASCII)
_WHOLE_NUMBER = re.compile(r"\s*[+-]?\d{1,18}\s*", re.ASCII)


def parse_number(text: str) -> float:
    """A finite decimal number from text; nan for anything else.

    Unlike `float`, neither underscores, digits of other scripts, nor words such as `infinity` are numbers.
    """
    if len(text) > _LONGEST or _NUMBER.fullmatch(text) is None:
        return math.nan
    number = float(text)
    return number if math.isfinite(number) else math.nan


def parse_whole(text: str, low: int, high: int) -> int | None:
    """A whole number within [low, high] from text; None for anything else."""
    if _WHOLE_NUMBER.fullmatch(text) is None:
        return None
    number = int(text)
    return number if low <= number <= high else None


def parse_numbers(words: Sequence[str], largest: float = limits.NUMBER) -> list[float] | None:
    """Finite numbers no larger than `largest` in size; None where one of them is none."""
    numbers = [parse_number(word) for word in words]
    return numbers if all(abs(number) <= largest for number in numbers) else None


def finite_number(value: object, largest: float = math.inf) -> float | None:
    """A value of TOML, JSON or YAML as a finite float, no larger than `largest` in size; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an int beyond the floats
        return None
    return number if math.isfinite(number) and abs(number) <= largest else None
