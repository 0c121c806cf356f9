"""Who comes back: visits that are one person's, decided one after the other in the order of time.

A visit v is that of somebody new, or of one of the n people g who were there before and are away. By the odds

    o(v, g) = P(return) / P(new) / n * exp(E(v and g) - E(v) - E(g)),    E the evidence of one person (size_model)

it is g's with the probability

    P(v, g) = o(v, g) / (1 + sum over the others who are away of o(v, .) + sum over other visits of o(., g))

where the first sum begins with g itself, and the second is over the visits that are there at the same time and may be
g's as well: one person is in one place. P(return) is the mean of a beta posterior over the visits so far, with a
uniform prior. Who is not sure enough stays a person of their own, and competes for those who come after.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.size_model import evidence
from stseg.identities.evidence.visits import Visits

NOBODY: Ints = np.zeros((0, 2), np.int64)
"""No pairs."""
_MOST = 500.0
"""Most evidence that is told apart from certainty, nats."""


@dataclass(frozen=True)
class Return:
    """A visit that takes the identity of an earlier one.

    Attributes
    ----------
    frame
        First frame of the visit.
    identity, visit
        The identity that it takes, and its own.
    probability
        That both are one person's.
    absence
        Frames since that person was there; None for somebody of an earlier recording.
    """

    frame: int
    identity: int
    visit: int
    probability: float
    absence: int | None


@dataclass
class _People:
    """Who was there so far, by the visit in which each was first: sums over all visits, last frame; whose each is."""

    first: list[int]
    precision: Floats
    information: Floats
    last: Ints
    person: Ints

    @classmethod
    def of(cls, visits: Visits) -> _People:
        number = np.arange(len(visits))
        return cls([], visits.precision.copy(), visits.information.copy(), visits.last.copy(), number)

    def away(self, frame: int, others: set[int]) -> Ints:
        """People who were last seen before a frame, without those of some visits."""
        known = np.array(self.first, np.int64)
        known = known[self.last[known] < frame]
        return known[~np.isin(known, self.person[list(others)])] if others else known

    def add(self, person: int, visit: int) -> None:
        """A visit of a person who was there before."""
        self.precision[person] += self.precision[visit]
        self.information[person] += self.information[visit]
        self.last[person] = self.last[visit]
        self.person[visit] = person


def find_returns(visits: Visits, spread: Floats, least: float, apart: Ints = NOBODY) -> list[Return]:
    """Visits of people who were there before.

    Parameters
    ----------
    visits
        In the order of time.
    spread : float64 (size,)
        Variance of each size among people.
    least
        Least probability of a return.
    apart : int64 (pair, 2)
        Identities that are known to be two people.
    """
    people, found, chances = _People.of(visits), list[Return](), 0
    named = {identity: visit for visit, identity in enumerate(visits.identity.tolist())}
    other = dict[int, set[int]]()
    for one, two in apart.tolist():
        other.setdefault(named.get(one, -1), set()).add(named.get(two, -1))
        other.setdefault(named.get(two, -1), set()).add(named.get(one, -1))
    for visit in range(len(visits)):
        away = people.away(visits.first[visit], other.get(visit, set()))
        if len(away):
            often = (len(found) + 1) / (chances + 2)
            probability = _probability(visits, visit, people, away, spread, np.log(often / (1 - often) / len(away)))
            chances, best = chances + 1, int(np.argmax(probability))
            if probability[best] >= least:
                found.append(_return(visits, visit, int(away[best]), float(probability[best]), people))
                people.add(int(away[best]), visit)
                continue
        people.first.append(visit)
    return found


def _probability(visits: Visits, visit: int, people: _People, away: Ints, spread: Floats, prior: float) -> Floats:
    """Probability that a visit is that of each of the people who are away."""
    founders = np.array(people.first, np.int64)
    there = np.concatenate([[visit], _beside(visits, visit, founders)])
    precision, information = people.precision[away], people.information[away]
    own, seen = visits.precision[there, None], visits.information[there, None]
    ratio = evidence(precision + own, information + seen, spread) - evidence(own, seen, spread)
    ratio -= evidence(precision, information, spread)
    possible = people.last[away] < visits.first[there, None]
    odds = np.where(possible, np.exp(np.minimum(ratio + prior, _MOST)), 0.0)
    return np.asarray(odds[0] / (1.0 + odds[0].sum() + odds[1:].sum(axis=0)))


def _beside(visits: Visits, visit: int, founders: Ints) -> Ints:
    """Visits at the time of one of which it is not decided that they are a return."""
    later = np.arange(visit + 1, np.searchsorted(visits.first, visits.last[visit], "right"))
    return np.concatenate([founders[visits.last[founders] >= visits.first[visit]], later])


def _return(visits: Visits, visit: int, person: int, probability: float, people: _People) -> Return:
    frame = int(visits.first[visit])
    identity, own = visits.identity[[person, visit]].tolist()
    last = int(people.last[person])
    return Return(frame, identity, own, probability, frame - last if last >= 0 else None)
