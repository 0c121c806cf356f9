"""Arrivals of people in a simulated scene."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from stseg.simulation.random_streams import Topic, random_stream
from stseg.simulation.scene import SceneSpec


class Arrivals(Protocol):
    """The people who come into a scene, by their numbers from 1."""

    def next(self, inside: int, /) -> int:
        """Number of the next person to arrive now, 0 for none; `inside` people are present or about to be."""

    def advance(self, step: float, present: Iterable[int]) -> None:
        """Let some seconds pass; `present` are in the scene."""


class Replacements:
    """A new person replaces each one that leaves."""

    def __init__(self, spec: SceneSpec) -> None:
        self._people, self._number = spec.people, 0

    def next(self, inside: int) -> int:
        """The next number while fewer than the scene's people are inside."""
        if inside >= self._people:
            return 0
        self._number += 1
        return self._number

    def advance(self, step: float, present: Iterable[int]) -> None:
        """Replacements arrive at once."""


class Regulars:
    """The same people come again and again."""

    def __init__(self, spec: SceneSpec) -> None:
        self._absence, self._rng = spec.absence, random_stream(spec.seed, Topic.ARRIVALS)
        self._people = range(1, spec.people + 1)
        self._away = {person: self._absence * self._rng.uniform(0.0, 1.6) for person in self._people}

    def next(self, _inside: int) -> int:
        """The first number of those with an absence that is over."""
        due = min((person for person, left in self._away.items() if left <= 0), default=0)
        self._away.pop(due, None)
        return due

    def advance(self, step: float, present: Iterable[int]) -> None:
        """Absences go by, and begin for those who have left."""
        here = set(present)
        for person in self._people:
            if person in self._away:
                self._away[person] -= step
            elif person not in here:
                self._away[person] = self._absence * self._rng.uniform(0.4, 1.6)
