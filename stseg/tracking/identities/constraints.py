"""Hard constraints of the identity search: pairs of rows that are one person, or two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

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

    def __add__(self, more: Constraints) -> Constraints:
        """Both of two."""
        pairs = zip((self.earlier, self.later, self.same), (more.earlier, more.later, more.same), strict=True)
        return Constraints(*(np.concatenate(pair) for pair in pairs))

    def where(self, chosen: Flags) -> Constraints:
        """Some of them."""
        return Constraints(self.earlier[chosen], self.later[chosen], self.same[chosen])

    def renumbered(self, place: Ints) -> Constraints:
        """The same of rows under other numbers: place (row,) is that of each."""
        return Constraints(place[self.earlier], place[self.later], self.same)

    def among(self) -> Constraints:
        """Those of which both rows are there, numbered from 0."""
        return self.where((self.earlier >= 0) & (self.later >= 0))

    def violated(self, identity: Ints) -> Flags:
        """Which of them identities (row,) do not obey, bool (constraint,)."""
        return np.asarray((identity[self.earlier] == identity[self.later]) != self.same)


@dataclass(frozen=True)
class KnownPeople:
    """Observations that constraints name: those that are one person, and pairs of people that are two.

    Attributes
    ----------
    observation, person : int64 (k,)
        Observations, rising, and the person of each.
    other : bool (person, person)
        Who are two; who is there in one frame is, too.
    first, last : int64 (person,)
        First and last of the observations.
    """

    observation: Ints
    person: Ints
    other: Flags
    first: Ints
    last: Ints

    @classmethod
    def of(cls, constraints: Constraints, frame: Ints) -> KnownPeople:
        """People whose observations constraints name; frame (n,) is that of every observation."""
        pairs = np.stack([constraints.earlier, constraints.later])
        observation, ends = np.unique(pairs, return_inverse=True)
        ends = ends.reshape(2, -1)
        same, number = ends[:, constraints.same], len(observation)
        graph = coo_array((np.ones(same.shape[1]), (same[0], same[1])), (number, number))
        people, person = connected_components(graph, directed=False) if number else (0, np.zeros(0, np.int64))
        person = person.astype(np.int64)
        other = np.zeros((people, people), bool)
        apart = person[ends[:, ~constraints.same]]
        together = np.array(np.nonzero(frame[observation][:, None] == frame[observation]))
        beside = person[together[:, together[0] != together[1]]]
        for one, two in (apart, beside):
            other[one, two] = other[two, one] = True
        first, last = np.full(people, len(frame)), np.full(people, -1)
        np.minimum.at(first, person, observation)
        np.maximum.at(last, person, observation)
        return cls(observation, person, other, first, last)

    def within(self, first: int, stop: int) -> list[tuple[int, int]]:
        """Observations from `first` to before `stop`, and the person of each."""
        if not len(self.observation):
            return []
        start, end = np.searchsorted(self.observation, (first, stop))
        return list(zip(self.observation[start:end].tolist(), self.person[start:end].tolist(), strict=True))

    def decided(self, frame: Ints) -> Ints:
        """Frames in which an observation must, or must not, have an identity; frame (n,) is of all observations."""
        here, begin = frame[self.observation], frame[self.first]
        others = (self.other[self.person] & (begin < here[:, None])).any(axis=1)
        return np.asarray(here[(begin[self.person] < here) | others])

    def most_open(self) -> int:
        """Most people at once with observations still to come."""
        ends = np.concatenate([self.first, self.last])
        change = np.repeat([1, -1], len(self.first))
        return int(np.cumsum(change[np.lexsort((change, ends))]).max(initial=0))

    def awaited(self, first: int) -> Flags:
        """People who were observed before an observation, and are to be observed again, bool (person,)."""
        return np.asarray((self.first < first) & (self.last >= first))

    def binding(self, first: int) -> Flags:
        """People observed before an observation whose identity matters from then on, bool (person,)."""
        to_come = (self.other & (self.first >= first)).any(axis=1)
        return np.asarray((self.first < first) & ((self.last >= first) | to_come))
