"""Joint hypotheses of the identities of all people up to a frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.rules import Rules
from stseg.identities.search.pasts import Pasts, begin_past, continue_past, keep_past
from stseg.kernels.accelerate import kernel, part

FREE = -1
"""Past of a slot that holds no identity."""


class Hypotheses(NamedTuple):
    """Hypotheses, the best first; each holds identities in slots.

    Attributes
    ----------
    score : float64 (hypothesis,)
        Nats.
    past : int64 (hypothesis, slot)
        Which of the pasts each identity has, `FREE` where there is none.
    bound : int64 (hypothesis, person)
        Identity of each person whom constraints know, -1 before the first observation.
    """

    score: Floats
    past: Ints
    bound: Ints

    @classmethod
    def empty(cls, number: int, slots: int, known: int) -> Hypotheses:
        """Room for hypotheses, of nobody."""
        return cls(np.zeros(number), np.full((number, slots), FREE), np.full((number, known), -1))

    def keep(self, chosen: Ints) -> None:
        """Move the chosen hypotheses to the front."""
        for own in self:
            own[: len(chosen)] = own[chosen]


@part
def slots_in_use(past: Ints, number: int) -> int:
    """Number of slots up to the last that holds an identity in one of some hypotheses."""
    for s in range(past.shape[1] - 1, -1, -1):
        for h in range(number):
            if past[h, s] >= 0:
                return s + 1
    return 0


@kernel
def fill_successors(
    held: Hypotheses, pasts: Pasts, size: int, parent: Ints, slot: Ints, slots: int, first: int, now: float,
    seen: ObservedRows, rules: Rules, fresh: Hypotheses, later_pasts: Pasts,
) -> int:  # fmt: skip
    """Fill hypotheses with those before and a frame's rows from `first` on, and number their pasts.

    Parameters
    ----------
    held, pasts, size
        The hypotheses before, their pasts, and the number of these.
    slots
        Number of slots.
    first, now, seen
        The frame's first row and its time, and all rows.
    rules
        The constants of the search.
    fresh, later_pasts
        Filled, but for scores.
    """
    rows, number = slot.shape[1], 0
    later, now_born = np.empty((size, rows + 1), np.int64), np.empty(rows, np.int64)
    later[:] = FREE
    now_born[:] = FREE
    for n in range(len(parent)):
        before, after = held.past[parent[n]], fresh.past[n]
        after[:] = FREE
        for i in range(rows):
            s = slot[n, i]
            if s < 0:  # a new identity takes the first free slot, or that of who was unseen for longest
                s = _slot_for_new(before, after, slots, pasts.seconds, now)
                if now_born[i] < 0:
                    begin_past(later_pasts, number, first + i, now, seen, rules)
                    now_born[i], number = number, number + 1
                after[s] = now_born[i]
            elif after[s] < 0 and later[before[s], i] >= 0:
                after[s] = later[before[s], i]
            else:
                if after[s] < 0:
                    keep_past(pasts, before[s], later_pasts, number)
                    later[before[s], i] = number
                else:  # the slot was just taken: the row is that of who took it
                    keep_past(later_pasts, after[s], later_pasts, number)
                continue_past(later_pasts, number, first + i, now, seen, rules)
                after[s], number = number, number + 1
        for s in range(slots):
            if after[s] < 0 <= before[s]:
                if later[before[s], rows] < 0:
                    keep_past(pasts, before[s], later_pasts, number)
                    later[before[s], rows], number = number, number + 1
                after[s] = later[before[s], rows]
        for person in range(held.bound.shape[1]):
            fresh.bound[n, person] = held.bound[parent[n], person]
    return number


@part
def _slot_for_new(before: Ints, after: Ints, slots: int, seconds: Floats, now: float) -> int:
    """The first free slot, or the one that was unseen for longest."""
    slot, earliest = 0, np.inf
    for s in range(slots):
        if before[s] < 0 and after[s] < 0:
            return s
        last = seconds[before[s]] if after[s] < 0 else now
        if last < earliest:
            slot, earliest = s, last
    return slot
