"""Search of identities: a beam of joint hypotheses over the frames of a run (Reid 1979).

In every frame each hypothesis is extended by its exact best assignment of rows to identities, and by all that differ
from it by one exchange. Of those with equal present names the best is kept (Viterbi over permutations), of all of them
the best K. Names become final after a lag, so memory does not grow.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.config import MotionConfig
from stseg.tracking.identities import step_kernels
from stseg.tracking.identities.constraints import Constraints, KnownPeople
from stseg.tracking.identities.crossings import Crossings, crossings_of
from stseg.tracking.identities.hypotheses import Hypotheses
from stseg.tracking.identities.observations import Observations
from stseg.tracking.identities.size_model import SizeModel

_BIRTH = 6.0
"""Cost of a birth or a death inside the area, nats (per square metre)."""
_ABSENCE = 1.0
"""Cost of being unseen, nats per second."""
_LEAST_PLACE = -25.0
"""Least evidence of a place against an identity, nats."""
_ALTERNATIVE_LOSS, _BEAM_LOSS = 15.0, 60.0
"""Greatest loss of an alternative in one frame, and of a hypothesis against the best, nats."""
FREELY = Constraints.of([], [])
"""No constraint."""
_SPARE = 16
"""Slots for people out of sight."""


@dataclass(frozen=True)
class SearchLimits:
    """Extent of the search.

    Attributes
    ----------
    hypotheses
        Number that is kept.
    longest
        Longest time out of sight, seconds.
    lag
        Time after which names are final, seconds.
    """

    hypotheses: int
    longest: float
    lag: float


@dataclass
class _Step:
    """The choices of one frame: parent (k,) and names (k, row), and the frame's observations and time."""

    parent: Ints
    names: Ints
    first: int
    seconds: float


@dataclass
class _History:
    """Choices of the latest frames, until names are final."""

    name: Ints
    steps: list[_Step] = field(default_factory=list)

    def decide(self, until: float, number: int) -> Ints:
        """Make names up to a time final, by the best hypothesis; which of the `number` hypotheses agree, int64 (k,)."""
        late = sum(step.seconds > until for step in self.steps)
        ancestor = np.arange(number)
        for step in self.steps[len(self.steps) - late :][::-1]:
            ancestor = step.parent[ancestor]
        agree, best = np.flatnonzero(ancestor == ancestor[0]), int(ancestor[0])
        for step in self.steps[: len(self.steps) - late][::-1]:
            self.name[step.first : step.first + step.names.shape[1]] = step.names[best]
            best = int(step.parent[best])
        self.steps = self.steps[len(self.steps) - late :]
        return agree


@dataclass(frozen=True)
class Solution:
    """The best hypothesis found.

    Attributes
    ----------
    name : int64 (n,)
        Identity of each observation, named by its first observation.
    score
        Nats.
    """

    name: Ints
    score: float


def search_identities(
    seen: Observations, sizes: SizeModel, motion: MotionConfig, limits: SearchLimits, constraints: Constraints = FREELY
) -> Solution:
    """The most likely identity of each observation.

    Parameters
    ----------
    seen
        The observations.
    sizes
        Statistics of the sizes.
    motion
        Motion model.
    limits
        Extent of the search.
    constraints
        Pairs of observations. All are obeyed unless they contradict each other.
    """
    frame = np.repeat(np.arange(len(seen.seconds)), np.diff(seen.start))
    known = KnownPeople.of(constraints, frame)
    # Where it is known who somebody is, who seemed certain may have to give way.
    seen = replace(seen, certain=seen.certain & ~np.isin(frame, known.decided(frame))).foreseen()
    slots = int(np.diff(seen.start).max(initial=0)) + _SPARE + known.most_open()
    held = Hypotheses.empty(1, 0, len(sizes.spread), len(known.first))
    history = _History(np.full(len(seen.order), -1))
    for k, now in enumerate(seen.seconds.tolist()):
        held = held.with_room(int(seen.start[k + 1] - seen.start[k]), slots)
        held, step = _extended(held, seen, k, sizes, motion, limits, known)
        history.steps.append(step)
        if now - history.steps[0].seconds > 2 * limits.lag:
            agree = history.decide(now - limits.lag, len(held.score))
            history.steps[-1].parent, history.steps[-1].names = step.parent[agree], step.names[agree]
            held = held.at(agree)
    history.decide(np.inf, len(held.score))
    return Solution(history.name, float(held.score[0]))


def _extended(
    held: Hypotheses, seen: Observations, k: int, sizes: SizeModel, motion: MotionConfig, limits: SearchLimits,
    known: KnownPeople,
) -> tuple[Hypotheses, _Step]:  # fmt: skip
    """The best hypotheses after one more frame, the k-th, and how they were chosen."""
    first, stop, now = int(seen.start[k]), int(seen.start[k + 1]), float(seen.seconds[k])
    turn, pace = motion.velocity_noise**2, motion.speed_spread**2
    number, slots = held.name.shape
    rows = stop - first
    step_kernels.end_identities(
        held.name, held.last, held.seconds, now, limits.longest, seen.inside, _BIRTH,
        _awaited(held, known, first), held.score,
    )  # fmt: skip
    cost = np.empty((number, rows, slots + rows))
    step_kernels.fill_costs(
        held.name, held.last, held.seconds, held.state, held.covariance, held.precision, held.information, first, now,
        seen.ground, seen.variance, seen.previous, seen.certain, seen.inside, seen.precision, seen.information,
        sizes.spread, sizes.most_against * sizes.noise, turn, _BIRTH, _ABSENCE, _LEAST_PLACE, cost,
    )  # fmt: skip
    _impose(held, known, first, stop, cost)
    column, total = np.empty((number, rows), np.int64), np.empty(number)
    step_kernels.fill_best_assignments(cost, column, total)
    most = number * (1 + rows * (slots + 1) + rows * (rows - 1) // 2)
    change, value = np.empty((most, 5), np.int64), np.empty(most)
    crossings = _crossings(seen, k, motion)
    found = step_kernels.fill_alternatives(
        cost, column, held.score - total, held.last, crossings, _ALTERNATIVE_LOSS, change, value
    )
    ordered = np.argsort(-value[:found], kind="stable")
    kept = limits.hypotheses
    parent, score, keys = np.empty(kept, np.int64), np.empty(kept), np.empty(kept, np.int64)
    chosen, names = np.empty((kept, rows), np.int64), np.empty((kept, rows), np.int64)
    kept = step_kernels.choose_distinct(
        ordered, change, value, column, held.name, held.last, seen.birth, _marks(held, known, first), first,
        float(value[ordered[0]]) - _BEAM_LOSS, parent, chosen, names, score, keys,
    )  # fmt: skip
    new = held.at(parent[:kept])
    new.score[:] = score[:kept]
    step_kernels.update_identities(
        chosen[:kept], new.name, new.last, new.seconds, new.state, new.covariance, new.precision, new.information,
        first, now, seen.ground, seen.variance, seen.precision, seen.information, turn, pace,
    )  # fmt: skip
    for observation, person in known.within(first, stop):
        new.bound[:, person] = names[:kept, observation - first]
    return new, _Step(parent[:kept], names[:kept], first, now)


def _crossings(seen: Observations, k: int, motion: MotionConfig) -> Crossings:
    """Crossings between the frame before and the k-th."""
    earlier = max(k - 1, 0)
    before, first, stop = (int(seen.start[frame]) for frame in (earlier, k, k + 1))
    bend = motion.speed_spread * float(seen.seconds[k] - seen.seconds[earlier]) / 4.0
    return crossings_of(before, first, stop, seen.ground, seen.variance, bend, seen.room)


def _impose(held: Hypotheses, known: KnownPeople, first: int, stop: int, cost: Floats) -> None:
    """Impose on the cost of a frame who its observations are, and who they are not."""
    for observation, person in known.within(first, stop):
        if known.first[person] < first:
            step_kernels.impose_identity(held.name, held.bound[:, person].copy(), observation - first, True, cost)
            continue
        for other in np.flatnonzero(known.other[person] & (known.first < first)).tolist():
            step_kernels.impose_identity(held.name, held.bound[:, other].copy(), observation - first, False, cost)


def _awaited(held: Hypotheses, known: KnownPeople, first: int) -> Flags:
    """Which slots hold an identity that a later observation must have, bool (hypothesis, slot)."""
    if not len(known.first):
        return np.zeros(held.name.shape, bool)
    bound = held.bound[:, None, known.awaited(first)]
    return np.asarray((held.name[:, :, None] == bound).any(axis=2) & (held.name >= 0))


def _marks(held: Hypotheses, known: KnownPeople, first: int) -> Ints:
    """A number that differs where hypotheses differ in who known people are, int64 (hypothesis,)."""
    mark = np.zeros(len(held.score), np.int64)
    binding = known.binding(first) if len(known.first) else known.first
    for person in np.flatnonzero(binding).tolist():
        mark = (mark * 1_000_003 + held.bound[:, person] + 2) % 2_147_483_647
    return mark
