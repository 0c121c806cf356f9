"""Named tuples that kernels pass on by their address: the same fields, the same arrays, as Python sees them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed


class Walk(NamedTuple):
    """Steps of a walk."""

    step: Floats
    number: int


class Walker(NamedTuple):
    """A walk within a tuple, beside other fields."""

    name: Ints
    walk: Walk
    pace: float


@kernel
def distance(walker: Walker) -> float:
    """The length of the way; marks the walker as done."""
    walker.name[0] = -1
    total = 0.0
    for k in range(walker.walk.number):
        total += walker.pace * walker.walk.step[k]
    return total


@kernel
def distance_by_address(walker: Walker) -> float:
    return distance(pointed(walker))


@kernel
def farthest_of_own_walks(number: int, steps: int) -> float:
    """Kernels may make tuples themselves, and pass them to the one that asks for the address."""
    farthest = 0.0
    for k in range(number):
        walk = Walk(np.full(steps, float(k)), steps)
        farthest = max(farthest, distance_by_address(Walker(np.zeros(1, np.int64), walk, 0.5)))
    return farthest


def test_fields_of_inner_tuples_are_those_of_the_whole() -> None:
    walker = Walker(np.array([7]), Walk(np.array([1.0, 2.0, 4.0]), 2), 0.5)
    assert distance_by_address(walker) == distance(walker) == 1.5


def test_arrays_are_not_copied() -> None:
    walker = Walker(np.array([7, 8]), Walk(np.empty(0), 0), 0.5)
    distance_by_address(walker)
    np.testing.assert_array_equal(walker.name, [-1, 8])


def test_what_a_kernel_makes_itself_lasts_as_long_as_the_call() -> None:
    assert farthest_of_own_walks(200, 1000) == 199 * 0.5 * 1000
