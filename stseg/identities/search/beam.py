"""The beam of joint hypotheses, carried on frame by frame.

In every frame each hypothesis is extended by its best assignment of rows to identities, and by those that differ little
from it (`alternatives`); the best of them are the next hypotheses (`choice`).
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.choice import choose_distinct, empty_present
from stseg.identities.search.constraints import BoundPeople, binding_people, mark_of
from stseg.identities.search.costs import RowCosts, row_costs
from stseg.identities.search.extension import (
    Alternatives,
    Extension,
    add_alternatives,
    empty_alternatives,
    empty_extension,
    end_identities,
    fill_cheapest_identities,
    fill_identities,
    fill_least,
    impose_identity,
)
from stseg.identities.search.hypotheses import Hypotheses, Pasts, Rules, fill_successors, slots_in_use
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

_SLOT_STEP = 4
"""Slots by which their number changes."""


class Frames(NamedTuple):
    """The frames of a run."""

    start: Ints
    """int64 (frame + 1,): first row of each."""
    seconds: Floats
    """float64 (frame,)."""


@kernel
def extend_beam(
    begin: int,
    frames: Frames,
    every_row: ObservedRows,
    bound_people: BoundPeople,
    constants: Rules,
    one: Hypotheses,
    pasts_of_one: Pasts,
    other: Hypotheses,
    pasts_of_other: Pasts,
    number: int,
    size: int,
    counts: Ints,
    parents: Ints,
    names: Ints,
) -> tuple[int, int]:
    """Extend hypotheses by some frames, from number `begin` on; the numbers of the new hypotheses and of their pasts.

    The hypotheses are `number` in `one`, with `size` pasts in `pasts_of_one`; `other` and `pasts_of_other` are room for
    as many. After an even number of frames the new ones are in the former. For each of k frames, `counts` int64 (k,) is
    filled with the number of hypotheses after it, `parents` int64 (k, hypothesis) with the one before of each, and
    `names` int64 (k, hypothesis, row) with the names of its rows.
    """
    observed, people, rules = pointed(every_row), pointed(bound_people), pointed(constants)
    hypotheses, pasts = pointed(one), pointed(pasts_of_one)
    successors, later_pasts = pointed(other), pointed(pasts_of_other)
    for step in range(len(counts)):
        k = begin + step
        first, stop = frames.start[k], frames.start[k + 1]
        rows, now = stop - first, frames.seconds[k]
        slots = -(-(slots_in_use(hypotheses.past, number) + rows) // _SLOT_STEP) * _SLOT_STEP
        slots = min(slots, hypotheses.past.shape[1])
        costs = row_costs(pasts, size, first, rows, now, observed, rules)
        column, extension = np.empty((number, rows), np.int64), empty_extension(slots, first, rows, observed.certain)
        found, present = empty_alternatives(number, slots, len(extension.doubtful)), empty_present(number, slots)
        total = _fill_alternatives(
            hypotheses, pasts, slots, k, frames, costs, observed, people, rules, extension, column, found
        )
        chosen, mark = np.empty(len(successors.score), np.int64), _marks(number, hypotheses, people, first)
        number = choose_distinct(
            hypotheses, pasts, column, first, observed, mark, found, total, rules.beam_loss, present, chosen
        )
        parent, slot = parents[step, :number], np.empty((number, rows), np.int64)
        for n in range(number):
            successors.score[n] = found.value[chosen[n]]
            parent[n] = found.change[chosen[n], 0]
            _fill_slots(found.change, chosen[n], column, slot, n)
            _fill_names(hypotheses, pasts, parent[n], slot, n, first, names, step)
        size = fill_successors(
            hypotheses, pasts, size, parent, slot, slots, first, now, observed, rules, successors, later_pasts
        )
        _bind(successors, people, k, first, names[step, :number])
        counts[step] = number
        hypotheses, pasts, successors, later_pasts = successors, later_pasts, hypotheses, pasts
    return number, size


@kernel
def _marks(number: int, hypotheses: Hypotheses, people: BoundPeople, first: int) -> Ints:
    """Numbers that differ where hypotheses differ in the identities of people that constraints bind from a row on."""
    binding, mark = binding_people(people, first), np.empty(number, np.int64)
    for h in range(number):
        mark[h] = mark_of(hypotheses.bound, h, binding)
    return mark


@kernel
def _fill_alternatives(
    hypotheses: Hypotheses,
    pasts: Pasts,
    slots: int,
    k: int,
    frames: Frames,
    row_costs: RowCosts,
    observed: ObservedRows,
    people: BoundPeople,
    rules: Rules,
    extension: Extension,
    column: Ints,
    alternatives: Alternatives,
) -> int:
    """Fill the alternatives of all hypotheses for the rows of the k-th frame, and count them.

    Fill the slots of the best assignments, column (hypothesis, row), too.
    """
    costs, one, found = pointed(row_costs), pointed(extension), pointed(alternatives)
    first, total = frames.start[k], 0
    for h in range(len(column)):
        end_identities(hypotheses, pasts, h, first, frames.seconds[k], observed, people, rules)
        identities = fill_identities(hypotheses, pasts, h, costs, one)
        _impose(hypotheses.bound, h, people, k, first, one, identities)
        if not fill_cheapest_identities(one, identities):
            fill_least(one, identities, slots)
        cost = 0.0
        for i in range(column.shape[1]):
            cost += one.cost[i, one.assigned[i]]
            column[h, i] = one.slot[one.assigned[i]]
        score = hypotheses.score[h] - cost
        total = add_alternatives(h, one, identities, score, rules.alternative_loss, total, found)
    return total


@part
def _impose(bound: Ints, h: int, people: BoundPeople, k: int, first: int, one: Extension, identities: int) -> None:
    """Impose on the costs who the rows of the k-th frame are, and are not, by who is bound (hypothesis, person)."""
    for j in range(people.start[k], people.start[k + 1]):
        person, row = people.person[j], people.observation[j] - first
        if people.first[person] < first:
            impose_identity(one, identities, bound[h, person], row, True)
            continue
        for other in range(bound.shape[1]):
            if people.other[person, other] and people.first[other] < first:
                impose_identity(one, identities, bound[h, other], row, False)


@part
def _fill_slots(change: Ints, alternative: int, best: Ints, slot: Ints, n: int) -> None:
    """Fill the n-th slots (n, row) by an alternative to a best assignment (hypothesis, row)."""
    for i in range(slot.shape[1]):
        slot[n, i] = best[change[alternative, 0], i]
    for k in (1, 3):
        if change[alternative, k] >= 0:
            slot[n, change[alternative, k]] = change[alternative, k + 1]


@part
def _fill_names(
    hypotheses: Hypotheses, pasts: Pasts, h: int, slot: Ints, n: int, first: int, names: Ints, step: int
) -> None:
    """Fill the n-th names (step, n, row) of a frame's rows."""
    for i in range(slot.shape[1]):
        s = slot[n, i]
        names[step, n, i] = pasts.name[hypotheses.past[h, s]] if s >= 0 else first + i


@kernel
def _bind(successors: Hypotheses, people: BoundPeople, k: int, first: int, name: Ints) -> None:
    """Note who known people are by the names (hypothesis, row) of the rows of the k-th frame."""
    for j in range(people.start[k], people.start[k + 1]):
        for n in range(len(name)):
            successors.bound[n, people.person[j]] = name[n, people.observation[j] - first]
