"""Joint hypotheses of the identities of all people up to a frame."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from stseg.arrays import Floats, Ints

FREE = -1
"""Name of a slot that holds no identity."""
_STEP = 4
"""Slots by which their number changes: most often it need not."""


@dataclass(frozen=True)
class Hypotheses:
    """Hypotheses, the best first; each holds identities in slots.

    Attributes
    ----------
    score : float64 (hypothesis,)
        Nats.
    name, last : int64 (hypothesis, slot)
        First and last observation of each identity; the first is its name, `FREE` where there is none.
    seconds : float64 (hypothesis, slot)
        Time of the last observation.
    state : float64 (hypothesis, slot, 4)
        x, y, vx, vy, in metres and metres per second.
    covariance : float64 (hypothesis, slot, 3)
        Of either axis: place, place and velocity, velocity.
    precision, information : float64 (hypothesis, slot, size)
        Sums over the identity's observations.
    bound : int64 (hypothesis, person)
        Identity of each person whom constraints know, `FREE` before the first observation.
    """

    score: Floats
    name: Ints
    last: Ints
    seconds: Floats
    state: Floats
    covariance: Floats
    precision: Floats
    information: Floats
    bound: Ints

    @classmethod
    def empty(cls, number: int, slots: int, sizes: int, known: int = 0) -> Hypotheses:
        """Hypotheses of nobody."""
        shape = (number, slots)
        return cls(
            np.zeros(number), np.full(shape, FREE), np.full(shape, -1), np.zeros(shape), np.zeros((*shape, 4)),
            np.zeros((*shape, 3)), np.zeros((*shape, sizes)), np.zeros((*shape, sizes)),
            np.full((number, known), FREE),
        )  # fmt: skip

    def at(self, chosen: Ints) -> Hypotheses:
        """Copies of the chosen hypotheses."""
        return Hypotheses(*(getattr(self, own.name).take(chosen, axis=0) for own in fields(self)))

    def with_room(self, free: int, most: int) -> Hypotheses:
        """The same, with at least so many free slots after all that are used, but `most` slots at most."""
        used = int(np.flatnonzero((self.name != FREE).any(axis=0)).max(initial=-1)) + 1
        number, before = min(-(-(used + free) // _STEP) * _STEP, most), self.name.shape[1]
        if number == before:
            return self
        more = Hypotheses.empty(len(self.score), max(number - before, 0), self.precision.shape[2])
        return replace(
            self,
            **{
                own.name: np.concatenate([getattr(self, own.name)[:, :number], getattr(more, own.name)], axis=1)
                for own in fields(self)[1:-1]
            },
        )
