"""Arrivals and goals of simulated pedestrians: come, walk to a place, stand there, meet another person, leave."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.simulation.scene import SceneSpec, Topic, random_stream

_OUTSIDE_MARGIN = 0.9
"""Distance outside the area at which pedestrians appear and disappear, metres."""
_GOAL_MARGIN = 0.45  # metres that goals keep from the area's border
_GOAL_TIME = 7.0  # seconds after which an unreached goal is replaced
_STAND_PROBABILITY, _MEETING_PROBABILITY = 0.25, 0.15  # probabilities of standing, and of a meeting, on arrival
_MEETING_DISTANCE = 0.7  # metres between two people in a meeting


@dataclass(slots=True)
class Errand:
    """Goal and schedule of one pedestrian."""

    goal: Floats
    """float64 (2,): goal position, metres."""
    stay: float
    """Seconds until the pedestrian leaves."""
    half: Floats
    """float64 (2,): half the area's sides, metres."""
    enters: bool = False
    leaves: bool = False
    """Whether the pedestrian is entering or leaving."""
    pause: float = 0.0
    """Seconds to stand at the goal."""
    waits: bool = False
    """Whether the pedestrian is standing at the goal."""
    spent: float = 0.0
    """Seconds since the goal was set."""
    partner: Floats | None = None
    """float64 (2,) or None: goal of the person to meet."""

    @property
    def stays_inside(self) -> bool:
        """Whether the person is bound to the area."""
        return not (self.enters or self.leaves)

    @property
    def is_free(self) -> bool:
        """Whether the person may be called to a meeting."""
        return self.stays_inside and not self.waits and self.partner is None

    def counts(self, ground: Floats) -> bool:
        """Whether the person is in the area or about to enter it."""
        return self.enters or bool((np.abs(ground) <= self.half).all())

    def is_over(self, ground: Floats) -> bool:
        """Whether the person has left the scene."""
        return self.leaves and bool((np.abs(ground) > self.half + _OUTSIDE_MARGIN - 0.05).any())

    def facing(self, ground: Floats) -> float | None:
        """Direction a waiting pedestrian faces, radians; None for no change."""
        if self.partner is None:
            return None
        displacement = self.partner - ground
        return float(np.arctan2(displacement[1], displacement[0]))

    def send(self, goal: Floats, pause: float = 0.0, partner: Floats | None = None) -> None:
        """Set the next goal."""
        self.goal, self.pause, self.partner = goal, pause, partner
        self.waits, self.spent = False, 0.0


class Planner:
    """Assigns errands to pedestrians.

    Parameters
    ----------
    area
        Its sides, metres.
    stay
        Mean time that a person stays, seconds.
    rng
        Source of randomness.
    """

    def __init__(self, area: tuple[float, float], stay: float, rng: np.random.Generator) -> None:
        self._half, self._stay, self._rng = np.array(area) / 2, stay, rng

    def errand(self, enters: bool) -> Errand:
        """First errand of a pedestrian, inside from the start or entering."""
        return Errand(self._goal(), self._stay * self._rng.uniform(0.4, 1.6), self._half, enters)

    def place_inside(self, others: Floats) -> Floats:
        """A free position inside the area."""
        return self._farthest(np.stack([self._goal() for _ in range(12)]), others)

    def door(self, others: Floats) -> Floats:
        """A free position outside the area."""
        return self._farthest(np.stack([self._exit() for _ in range(6)]), others)

    def revise(self, people: list[tuple[Floats, Errand]], step: float) -> None:
        """Advance all errands by `step` seconds and replace those that are done."""
        for ground, errand in people:
            errand.stay -= step
            errand.spent += step
            errand.enters = errand.enters and bool((np.abs(ground) > self._half - 0.2).any())
            at_goal = float(np.hypot(*(errand.goal - ground))) < 0.3
            if errand.leaves:
                # A pedestrian pushed past its exit gets another one after a few seconds.
                if errand.spent > _GOAL_TIME:
                    errand.send(self._exit())
            elif errand.waits or (at_goal and errand.pause > 0):
                errand.waits = True
                errand.pause -= step
                if errand.pause <= 0:
                    self._next(errand, people)
            elif at_goal or errand.spent > _GOAL_TIME:
                self._next(errand, people)

    def _next(self, errand: Errand, people: list[tuple[Floats, Errand]]) -> None:
        if errand.stay < 0 and not errand.enters:
            errand.leaves = True
            errand.send(self._exit())
            return
        draw = self._rng.uniform()
        free = [other for _, other in people if other.is_free and other is not errand]
        if draw < _MEETING_PROBABILITY and free and not errand.enters:
            self._meet(errand, free[int(self._rng.integers(len(free)))])
        elif draw < _MEETING_PROBABILITY + _STAND_PROBABILITY:
            errand.send(self._goal(), self._rng.uniform(1.5, 5.0))
        else:
            errand.send(self._goal())

    def _meet(self, one: Errand, other: Errand) -> None:
        place, angle = self._goal(), self._rng.uniform(0, np.pi)
        offset = _MEETING_DISTANCE / 2 * np.array([np.cos(angle), np.sin(angle)])
        pause = self._rng.uniform(2.5, 6.0)
        one.send(place + offset, pause, place - offset)
        other.send(place - offset, pause, place + offset)

    def _goal(self) -> Floats:
        return self._rng.uniform(-1.0, 1.0, 2) * (self._half - _GOAL_MARGIN)

    def _exit(self) -> Floats:
        """A position beyond the middle of a side; cameras stand at the corners."""
        side, along = int(self._rng.integers(4)), self._rng.uniform(-0.6, 0.6)
        axis, sign = side % 2, 1 - 2 * (side // 2)
        place = np.empty(2)
        place[axis] = sign * (self._half[axis] + _OUTSIDE_MARGIN)
        place[1 - axis] = along * self._half[1 - axis]
        return place

    @staticmethod
    def _farthest(places: Floats, others: Floats) -> Floats:
        if not len(others):
            return np.asarray(places[0])
        clearance = np.linalg.norm(places[:, None] - others[None], axis=2).min(axis=1)
        return np.asarray(places[int(np.argmax(clearance))])


class Arrivals:
    """The people who come into a scene, by their numbers from 1: a new person replaces each one that leaves."""

    def __init__(self, spec: SceneSpec) -> None:
        self._spec, self._number = spec, 0

    def next(self, inside: int, /) -> int:
        """Number of the next person to arrive now, 0 for none; `inside` people are present or about to be."""
        if inside >= self._spec.people:
            return 0
        self._number += 1
        return self._number

    def advance(self, step: float, present: Iterable[int]) -> None:
        """Let some seconds pass; `present` are in the scene. Replacements arrive at once."""


class Regulars(Arrivals):
    """The same people come again and again."""

    def __init__(self, spec: SceneSpec) -> None:
        super().__init__(spec)
        self._rng = random_stream(spec.seed, Topic.ARRIVALS)
        self._people = range(1, spec.people + 1)
        self._away = {person: spec.absence * self._rng.uniform(0.0, 1.6) for person in self._people}

    def next(self, _inside: int, /) -> int:
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
                self._away[person] = self._spec.absence * self._rng.uniform(0.4, 1.6)
