"""Kernels in few words of LLVM's language: elements of arrays and loops over ranges are those of plain Python."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from stseg.arrays import AnyArray, Flags, Floats, Ints
from stseg.kernels.accelerate import kernel, python_form


@kernel
def summed_from_both_ends(values: Floats, counts: Ints, flags: Flags, total: Floats) -> None:
    """Read and write elements by signed and unsigned numbers, by constants, and from the end."""
    planes, rows, columns = values.shape
    for i in range(planes):
        for j in range(1, rows + 1):
            for k in range(columns):
                total[i] += values[i, -j, k] * counts[k - columns]
                values[np.uint64(i), -j, 0] = total[i]
                counts[-1] += 1
                flags[i, k] = not flags[i, k]
    total[-1] += values[0, 0, 1] + counts[0]


@kernel
def second_numbers(stop: int) -> range:
    return range(0, stop, 2)


@kernel
def numbers(start: int, stop: int, seen: Ints) -> int:
    """Fill seen with the numbers of several ranges; their number."""
    place = 0
    for k in range(start, stop):
        seen[place], place = k, place + 1
    for k in range(stop):
        seen[place], place = k, place + 1
    for k in range(stop, start, -2):
        seen[place], place = k, place + 1
    for k in second_numbers(stop):
        seen[place], place = k, place + 1
    chosen = range(start)
    if stop > start:
        chosen = range(stop, stop + 3)
    for k in chosen:
        seen[place], place = k, place + 1
    for order, k in enumerate(range(np.uint64(2))):
        seen[place], place = order + k, place + 1
    return place


def _arrays(cut: Callable[[Floats], Floats]) -> list[AnyArray]:
    rng = np.random.default_rng(5)
    return [cut(rng.random((3, 8, 4))), rng.integers(0, 9, 4), rng.random((3, 4)) > 0.5, np.zeros(3)]


@pytest.mark.parametrize(
    "cut", [lambda values: values[:, :4].copy(), lambda values: values[:, ::-2], lambda values: values[::-1, 1:5]]
)
def test_elements_are_those_of_plain_python(cut: Callable[[Floats], Floats]) -> None:
    compiled, plain = _arrays(cut), _arrays(cut)
    summed_from_both_ends(*compiled)
    python_form(summed_from_both_ends)(*plain)
    for one, other in zip(compiled, plain, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("start", "stop"), [(2, 6), (5, 5), (6, 2), (-3, 4), (0, 0), (-1, -4)])
def test_ranges_are_those_of_plain_python(start: int, stop: int) -> None:
    seen = np.zeros(64, np.int64)
    chosen = range(stop, stop + 3) if stop > start else range(start)
    spans = (range(start, stop), range(stop), range(stop, start, -2), range(0, stop, 2), chosen, (0, 2))
    expected = [k for span in spans for k in span]
    assert numbers(start, stop, seen) == len(expected)
    np.testing.assert_array_equal(seen[: len(expected)], expected)
