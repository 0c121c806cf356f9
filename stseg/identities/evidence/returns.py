"""Returns: visits of one person, decided one after the other in the order of time; means of people for later runs.

A visit v is that of a new person, or of one of the n people g who were there before and are away. By the odds

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

from stseg.arrays import AnyArray, Floats, Ints, Rows
from stseg.identities.evidence.appearance_model import row_means
from stseg.identities.evidence.size_model import evidence
from stseg.records.tables import KNOWN_PERSON

_EVIDENCE_LIMIT = 500.0
"""Most evidence that is told apart from certainty, nats."""


@dataclass(frozen=True)
class Return:
    """A visit that takes the identity of an earlier one."""

    frame: int
    """First frame of the visit."""
    identity: int
    """The identity that it takes."""
    visit: int
    """The visit's own identity."""
    probability: float
    """Probability that both are one person's."""
    absence: int | None
    """Frames since that person was there; None for a person of an earlier recording."""


@dataclass
class _People:
    """People so far, by the visit in which each was first: sums over all visits, last frame; person of each visit."""

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
        people = np.array(self.first, np.int64)
        people = people[self.last[people] < frame]
        return people[~np.isin(people, self.person[list(others)])] if others else people

    def add(self, person: int, visit: int) -> None:
        """A visit of a person who was there before."""
        self.precision[person] += self.precision[visit]
        self.information[person] += self.information[visit]
        self.last[person] = self.last[visit]
        self.person[visit] = person


def find_returns(visits: Visits, spread: Floats, least: float, different: Ints) -> list[Return]:
    """Visits, given in the order of time, of people who were there before.

    `spread` float64 (size,) is the variance of each size among people, `least` the least probability of a return, and
    `different` int64 (pair, 2) are identities that are known to be two people.
    """
    people, found, chances = _People.of(visits), list[Return](), 0
    visit_of = {identity: visit for visit, identity in enumerate(visits.identity.tolist())}
    known_different = dict[int, set[int]]()
    for one, two in different.tolist():
        if one in visit_of and two in visit_of:
            known_different.setdefault(visit_of[one], set()).add(visit_of[two])
            known_different.setdefault(visit_of[two], set()).add(visit_of[one])
    for visit in range(len(visits)):
        away = people.away(visits.first[visit], known_different.get(visit, set()))
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
    simultaneous = np.concatenate([[visit], _beside(visits, visit, founders)])
    precision, information = people.precision[away], people.information[away]
    weight, total = visits.precision[simultaneous, None], visits.information[simultaneous, None]
    ratio = evidence(precision + weight, information + total, spread) - evidence(weight, total, spread)
    ratio -= evidence(precision, information, spread)
    possible = people.last[away] < visits.first[simultaneous, None]
    odds = np.where(possible, np.exp(np.minimum(ratio + prior, _EVIDENCE_LIMIT)), 0.0)
    return np.asarray(odds[0] / (1.0 + odds[0].sum() + odds[1:].sum(axis=0)))


def _beside(visits: Visits, visit: int, founders: Ints) -> Ints:
    """Visits that overlap one in time and are not decided to be returns."""
    later = np.arange(visit + 1, np.searchsorted(visits.first, visits.last[visit], "right"))
    return np.concatenate([founders[visits.last[founders] >= visits.first[visit]], later])


def _return(visits: Visits, visit: int, person: int, probability: float, people: _People) -> Return:
    frame = int(visits.first[visit])
    identity, own_identity = visits.identity[[person, visit]].tolist()
    last = int(people.last[person])
    return Return(frame, identity, own_identity, probability, frame - last if last >= 0 else None)


@dataclass(frozen=True)
class Visits:
    """Stays of people, each under an identity of its own."""

    identity: Ints
    """int64 (visit,): identities, in the order of `first`."""
    first: Ints
    """int64 (visit,): first frame."""
    last: Ints
    """int64 (visit,): last frame."""
    precision: Floats
    """float64 (visit, size): inverse variance of the visit's mean of each size and axis of appearance."""
    information: Floats
    """float64 (visit, size): the precision times the mean."""
    lasting: Floats
    """float64 (size,): variance of what lasts as long as a visit, which the precision counts."""

    def __len__(self) -> int:
        return len(self.identity)

    def after(self, identity: Ints, precision: Floats, information: Floats) -> Visits:
        """The visits after those of some people (person,) before the recording, by sums over these (person, size)."""
        shrink, before = 1.0 / (1.0 + precision * self.lasting), np.full(len(identity), -1)
        return Visits(
            np.concatenate([identity, self.identity]),
            np.concatenate([before, self.first]),
            np.concatenate([before, self.last]),
            np.concatenate([precision * shrink, self.precision]),
            np.concatenate([information * shrink, self.information]),
            self.lasting,
        )


def pooled_visits(identity: Ints, frame: Ints, precision: Floats, information: Floats) -> Visits:
    """The visits of identities.

    A visit's mean errs by the errors of its frames, and by what lasts as long as a visit: light and posture where the
    person happened to be. The variance of the latter is learned from the halves of every visit.

    Of each row are `identity` int64 (n,), 0 for none, `frame` int64 (n,), and `precision` and `information` float64 (n,
    size), see `stseg.identities.evidence.observations.ObservedRows`.
    """
    order = np.lexsort((frame, identity))
    order = order[identity[order] > 0]
    names, start, count = np.unique(identity[order], return_index=True, return_counts=True)
    half = 2 * (np.arange(len(order)) - np.repeat(start, count)) >= np.repeat(count, count)
    key = 2 * np.repeat(np.arange(len(names)), count) + half
    weight, total = (_sums(part[order], key, len(names)) for part in (precision, information))
    lasting = lasting_variance(weight, total)
    shrink = 1.0 / (1.0 + weight.sum(axis=1) * lasting)
    first, last = frame[order[start]], frame[order[start + count - 1]]
    by_time = np.lexsort((names, first))
    return Visits(
        names[by_time],
        first[by_time],
        last[by_time],
        (weight.sum(axis=1) * shrink)[by_time],
        (total.sum(axis=1) * shrink)[by_time],
        lasting,
    )


def lasting_variance(precision: Floats, information: Floats) -> Floats:
    """Variance of errors that last half a visit, from sums over both halves of each (visit, 2, size); float64 (size,).

    Half of the squared difference of both means less their known variances, averaged over visits; at least 0.
    """
    measured = (precision > 0).all(axis=1)
    variance = 1.0 / np.where(precision > 0, precision, 1.0)
    mean = information * variance
    excess = np.where(measured, ((mean[:, 0] - mean[:, 1]) ** 2 - variance.sum(axis=1)) / 2, 0.0)
    return np.asarray(np.maximum(excess.sum(axis=0) / np.maximum(measured.sum(axis=0), 1), 0.0))


def _sums(value: Floats, half: Ints, number: int) -> Floats:
    """Sums over the rows (n, size) of each half (n,) of some visits, float64 (visit, 2, size)."""
    sums = np.zeros((2 * number, value.shape[1]))
    np.add.at(sums, half, value)
    return sums.reshape(number, 2, value.shape[1])


def known_people(committed: Rows, appearance: Rows) -> Rows:
    """Means over the rows of every person, KNOWN_PERSON (k,), by rising id.

    Colours are without the offsets of the cameras. Features of a detector are left out: they lie along axes of their
    recording. `committed` are TRAJECTORY (n,) rows as a tracker committed them, under final ids, 0 for none;
    `appearance` is APPEARANCE (l,) of detections.
    """
    people = np.unique(committed["id"][committed["id"] > 0])
    owner = np.where(committed["id"] > 0, np.searchsorted(people, committed["id"]), -1)
    table = np.zeros(len(people), KNOWN_PERSON)
    table["id"] = people
    height, table["height_count"] = _means(committed["height"][:, None], owner, len(people))
    table["height"] = height[:, 0]
    colours = row_means(committed, (appearance,), "colours")
    table["colours"], table["appearance_count"] = _means(colours, owner, len(people))
    return table


def _means(value: AnyArray, owner: Ints, people: int) -> tuple[Floats, Ints]:
    """Mean of the finite rows of value (n, k) of each person, float64 (people, k), nan without, and their numbers."""
    rows = np.flatnonzero(np.isfinite(value).all(axis=1) & (owner >= 0))
    number = np.bincount(owner[rows], minlength=people)
    sums = np.zeros((people, value.shape[1]))
    np.add.at(sums, owner[rows], value[rows])
    return np.where(number[:, None] > 0, sums / np.maximum(number, 1)[:, None], np.nan), number
