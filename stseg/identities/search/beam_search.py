"""Search of identities: a beam of joint hypotheses over the frames of a run (Reid 1979).

In every frame each hypothesis is extended by its exact best assignment of rows to identities, and by all that differ
from it by one exchange. Of those with equal present names the best is kept (Viterbi over permutations), of all of them
the best K. Names become final after a lag, so memory does not grow.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints
from stseg.config import MotionConfig
from stseg.identities.evidence.observations import Observations
from stseg.identities.evidence.size_model import SizeModel
from stseg.identities.search.beam import Frames, extend_beam
from stseg.identities.search.constraints import NO_CONSTRAINTS, ConstrainedPeople, Constraints
from stseg.identities.search.hypotheses import Hypotheses, Pasts, Rules

_BIRTH = 6.0
"""Cost of a birth or a death inside the area, nats (per square metre)."""
_ABSENCE = 1.0
"""Cost of being unseen, nats per second."""
_ALTERNATIVE_LOSS, _BEAM_LOSS = 15.0, 60.0
"""Greatest loss of an alternative in one frame, and of a hypothesis against the best, nats."""
_SPARE = 16
"""Slots for hidden people."""
_BLOCK = 256
"""Frames that hypotheses are extended by at a time."""


@dataclass(frozen=True)
class SearchLimits:
    """Extent of the search."""

    hypotheses: int
    """Number that is kept."""
    longest: float
    """Longest time unseen, seconds."""
    lag: float
    """Time after which names are final, seconds."""


class _Choices(NamedTuple):
    """The hypotheses after each of some frames."""

    number: Ints
    """int64 (frame,)."""
    parent: Ints
    """int64 (frame, hypothesis): the hypothesis before."""
    names: Ints
    """int64 (frame, hypothesis, row): of the frame's rows."""

    @classmethod
    def empty(cls, frames: int, hypotheses: int, rows: int) -> _Choices:
        """Room for them."""
        shape = frames, hypotheses
        return cls(np.empty(frames, np.int64), np.empty(shape, np.int64), np.empty((*shape, rows), np.int64))


@dataclass
class _FrameChoices:
    """The choices of one frame: parent (k,) and names (k, row), and the frame's observations and time."""

    parent: Ints
    names: Ints
    first: int
    seconds: float


@dataclass
class _History:
    """Choices of the latest frames, until names are final."""

    name: Ints
    steps: list[_FrameChoices] = field(default_factory=list)

    def add(self, choices: _Choices, observations: Observations, begin: int) -> None:
        """Add the choices of the next frames, from the one of number `begin` on."""
        for k, number in enumerate(choices.number.tolist()):
            first, stop = observations.start[begin + k : begin + k + 2].tolist()
            names = choices.names[k, :number, : stop - first]
            self.steps.append(
                _FrameChoices(choices.parent[k, :number], names, first, float(observations.seconds[begin + k]))
            )

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
        if self.steps:
            last = self.steps[-1]
            last.parent, last.names = last.parent[agree], last.names[agree]
        return agree


@dataclass(frozen=True)
class BestHypothesis:
    """The best hypothesis found."""

    name: Ints
    """int64 (n,): identity of each observation, named by its first observation."""
    score: float
    """Nats."""


def search_identities(
    observations: Observations,
    sizes: SizeModel,
    motion: MotionConfig,
    limits: SearchLimits,
    constraints: Constraints = NO_CONSTRAINTS,
) -> BestHypothesis:
    """The most likely identity of each observation.

    Constraints are pairs of observations. All are obeyed unless they contradict each other.
    """
    frame, rows = observations.frame, observations.rows
    people = ConstrainedPeople.of(constraints, frame)
    # Frames with constraints lose their certain rows: a constraint may overrule them.
    rows = rows._replace(certain=rows.certain & ~np.isin(frame, people.decided(frame)))
    slots = int(np.diff(observations.start).max(initial=0)) + _SPARE + people.most_open()
    most = limits.hypotheses
    hypotheses, spare = (
        (Hypotheses.empty(most, slots, len(people.begin)), Pasts.empty(2 * most * slots, len(sizes.spread)))
        for _ in range(2)
    )
    named, frames = people.by_frame(observations.start), Frames(observations.start, observations.seconds)
    beam = frames, rows, named, _rules(sizes, motion, limits)
    history, number, size, begin = _History(np.full(len(observations.order), -1)), 1, 0, 0
    while begin < len(observations.seconds):
        since = history.steps[0].seconds if history.steps else observations.seconds[begin]
        late = np.flatnonzero(observations.seconds[begin : begin + _BLOCK] - since > 2 * limits.lag)[:1]
        stop = min(begin + int(late.min(initial=_BLOCK - 1)) + 1, len(observations.seconds))
        choices = _Choices.empty(stop - begin, most, int(np.diff(observations.start).max()))
        number, size = extend_beam(begin, *beam, *hypotheses, *spare, number, size, *choices)
        history.add(choices, observations, begin)
        hypotheses, spare = (spare, hypotheses) if (stop - begin) % 2 else (hypotheses, spare)
        if len(late):
            agree = history.decide(float(observations.seconds[stop - 1]) - limits.lag, number)
            hypotheses[0].keep(agree)
            number = len(agree)
        begin = stop
    history.decide(np.inf, number)
    return BestHypothesis(history.name, float(hypotheses[0].score[0]))


def _rules(sizes: SizeModel, motion: MotionConfig, limits: SearchLimits) -> Rules:
    """The constants of the search."""
    return Rules(
        _BIRTH,
        _ABSENCE,
        limits.longest,
        _ALTERNATIVE_LOSS,
        _BEAM_LOSS,
        motion.velocity_noise**2,
        motion.speed_spread**2,
        sizes.spread,
        sizes.most_against * sizes.variance,
    )
