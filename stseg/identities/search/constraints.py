"""Hard constraints of the identity search: pairs of rows that are one person, or two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stseg.arrays import Flags, Ints
from stseg.kernels.accelerate import kernel, part


@dataclass(frozen=True)
class Constraints:
    """Pairs of rows of which it is known whether they are one person."""

    earlier: Ints
    """int64 (constraint,): first row, of a frame before that of the second."""
    later: Ints
    """int64 (constraint,): second row."""
    same: Flags
    """bool (constraint,): one person, or two."""

    def __len__(self) -> int:
        return len(self.same)

    @classmethod
    def of(cls, same: list[tuple[int, int]], other: list[tuple[int, int]]) -> Constraints:
        """Pairs that are one person, and pairs that are two."""
        pairs = np.array([*same, *other], np.int64).reshape(-1, 2)
        return cls(pairs[:, 0], pairs[:, 1], np.arange(len(pairs)) < len(same))

    def __add__(self, more: Constraints) -> Constraints:
        """The constraints of both."""
        pairs = zip((self.earlier, self.later, self.same), (more.earlier, more.later, more.same), strict=True)
        return Constraints(*(np.concatenate(pair) for pair in pairs))

    def where(self, chosen: Flags) -> Constraints:
        """The chosen constraints, bool (constraint,)."""
        return Constraints(self.earlier[chosen], self.later[chosen], self.same[chosen])

    def renumbered(self, place: Ints) -> Constraints:
        """The same constraints after rows are renumbered: place (row,) is the new number of each, -1 for none."""
        return Constraints(place[self.earlier], place[self.later], self.same)

    def among(self) -> Constraints:
        """The constraints whose rows both have a number."""
        return self.where((self.earlier >= 0) & (self.later >= 0))

    def violated(self, identity: Ints) -> Flags:
        """Which of them identities (row,) do not obey, bool (constraint,)."""
        return np.asarray((identity[self.earlier] == identity[self.later]) != self.same)

    def contradictory(self, frame: Ints) -> Flags:
        """Which of them no identities obey, bool (constraint,); frame (row,) is that of every row.

        Two people of rows that others make one; or one person of rows of which others make one in two places at once.
        """
        number, ends = len(frame), (self.earlier[self.same], self.later[self.same])
        graph = coo_array((np.ones(len(ends[0])), ends), (number, number))
        person = connected_components(graph, directed=False)[1] if number else np.zeros(0, np.int32)
        named = np.unique([self.earlier, self.later])
        once, count = np.unique(np.stack([person[named], frame[named]]), axis=1, return_counts=True)
        is_twice = np.isin(person[self.earlier], once[0, count > 1])
        return np.asarray(np.where(self.same, is_twice, person[self.earlier] == person[self.later]))


NO_CONSTRAINTS = Constraints.of([], [])
"""No pairs of rows."""


@dataclass(frozen=True)
class ConstrainedPeople:
    """People of the observations that constraints name, and which of them are two."""

    observation: Ints
    """int64 (k,): observations, rising."""
    person: Ints
    """int64 (k,): person of each observation."""
    distinct: Flags
    """bool (person, person): pairs that are two people; people of one frame are, too."""
    begin: Ints
    """int64 (person,): first observation of each."""
    end: Ints
    """int64 (person,): last observation of each."""

    @classmethod
    def of(cls, constraints: Constraints, frame: Ints) -> ConstrainedPeople:
        """People of the observations that constraints name; frame (n,) is that of every observation."""
        pairs = np.stack([constraints.earlier, constraints.later])
        observation, ends = np.unique(pairs, return_inverse=True)
        ends = ends.reshape(2, -1)
        same, number = ends[:, constraints.same], len(observation)
        graph = coo_array((np.ones(same.shape[1]), (same[0], same[1])), (number, number))
        people, person = connected_components(graph, directed=False) if number else (0, np.zeros(0, np.int64))
        person = person.astype(np.int64)
        distinct = np.zeros((people, people), bool)
        of_two = person[ends[:, ~constraints.same]]
        together = np.array(np.nonzero(frame[observation][:, None] == frame[observation]))
        simultaneous = person[together[:, together[0] != together[1]]]
        for one, two in (of_two, simultaneous):
            distinct[one, two] = distinct[two, one] = True
        begin, end = np.full(people, len(frame)), np.full(people, -1)
        np.minimum.at(begin, person, observation)
        np.maximum.at(end, person, observation)
        return cls(observation, person, distinct, begin, end)

    def decided(self, frame: Ints) -> Ints:
        """Frames in which an observation must, or must not, have an identity; frame (n,) is of all observations."""
        here, begin = frame[self.observation], frame[self.begin]
        others = (self.distinct[self.person] & (begin < here[:, None])).any(axis=1)
        return np.asarray(here[(begin[self.person] < here) | others])

    def most_open(self) -> int:
        """Most people at once with observations still to come."""
        ends = np.concatenate([self.begin, self.end])
        change = np.repeat([1, -1], len(self.begin))
        return int(np.cumsum(change[np.lexsort((change, ends))]).max(initial=0))

    def by_frame(self, start: Ints) -> NamedPeople:
        """The same for kernels, by frame; start (frame + 1,) is the first observation of each frame."""
        others = np.where(self.distinct, self.begin, -1).max(axis=1, initial=-1)
        return NamedPeople(
            self.observation,
            self.person,
            np.searchsorted(self.observation, start),
            self.distinct,
            self.begin,
            self.end,
            np.maximum(self.end, others),
        )


class NamedPeople(NamedTuple):
    """People of constraints; `observation`, `person`, `distinct`, `begin` and `end` are as of `ConstrainedPeople`."""

    observation: Ints
    person: Ints
    start: Ints
    """int64 (frame + 1,): the first of the named observations from each frame on."""
    distinct: Flags
    begin: Ints
    end: Ints
    binding: Ints
    """int64 (person,): the last observation that depends on the identity of each."""


@part
def is_awaited(people: NamedPeople, identity: Ints, h: int, name: int, first: int) -> bool:
    """Whether an identity must be observed again, from an observation on; identity (hypothesis, person) is of all."""
    for person in range(identity.shape[1]):
        if identity[h, person] == name and people.begin[person] < first <= people.end[person]:
            return True
    return False


@kernel
def binding_people(people: NamedPeople, first: int) -> Ints:
    """People observed before an observation with an identity that later ones depend on."""
    found, number = np.empty(len(people.begin), np.int64), 0
    for person in range(len(found)):
        if people.begin[person] < first <= people.binding[person]:
            found[number] = person
            number += 1
    return found[:number]


@part
def mark_of(identity: Ints, h: int, binding: Ints) -> int:
    """A hash of the identities of some people, identity (hypothesis, person): equal where hypotheses agree on them."""
    mark = 0
    for person in binding:
        mark = (mark * 1_000_003 + identity[h, person] + 2) % 2_147_483_647
    return mark
