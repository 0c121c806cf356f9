"""The beam of joint hypotheses, carried on frame by frame.

In every frame each hypothesis is extended by its best assignment of rows to identities, and by those that differ little
from it (`alternatives`); the best of them are the next hypotheses (`choice`).
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.choice import choose_distinct, empty_present
from stseg.identities.search.constraints import NamedPeople, binding_people, mark_of
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
    named_people: NamedPeople,
    constants: Rules,
    current: Hypotheses,
    pasts_of_current: Pasts,
    spare: Hypotheses,
    pasts_of_spare: Pasts,
    number: int,
    size: int,
    counts: Ints,
    parents: Ints,
    names: Ints,
) -> tuple[int, int]:
    """Extend hypotheses by some frames, from number `begin` on; the numbers of the new hypotheses and of their pasts.

    The hypotheses are `number` in `current`, with `size` pasts; `spare` and its pasts are room for as many. After an
    even number of frames the new ones are in the former. For each of k frames, `counts` int64 (k,) is filled with the
    number of hypotheses after it, `parents` int64 (k, hypothesis) with the one before of each, and `names` int64 (k,
    hypothesis, row) with the names of its rows.
    """
    observed, people, rules = pointed(every_row), pointed(named_people), pointed(constants)
    hypotheses, pasts = pointed(current), pointed(pasts_of_current)
    successors, later_pasts = pointed(spare), pointed(pasts_of_spare)
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
        _note_identities(successors, people, k, first, names[step, :number])
        counts[step] = number
        hypotheses, pasts, successors, later_pasts = successors, later_pasts, hypotheses, pasts
    return number, size


@kernel
def _marks(number: int, hypotheses: Hypotheses, people: NamedPeople, first: int) -> Ints:
    """Numbers that differ where hypotheses differ in the identities of people that constraints bind from a row on."""
    binding, mark = binding_people(people, first), np.empty(number, np.int64)
    for h in range(number):
        mark[h] = mark_of(hypotheses.identity, h, binding)
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
    people: NamedPeople,
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
        _impose(hypotheses.identity, h, people, k, first, one, identities)
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
def _impose(identity: Ints, h: int, people: NamedPeople, k: int, first: int, one: Extension, identities: int) -> None:
    """Impose on the costs the identities that rows of the k-th frame must, and must not, have.

    identity (hypothesis, person) is that of each person of the constraints.
    """
    for j in range(people.start[k], people.start[k + 1]):
        person, row = people.person[j], people.observation[j] - first
        if people.begin[person] < first:
            impose_identity(one, identities, identity[h, person], row, True)
            continue
        for other in range(identity.shape[1]):
            if people.distinct[person, other] and people.begin[other] < first:
                impose_identity(one, identities, identity[h, other], row, False)


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
def _note_identities(successors: Hypotheses, people: NamedPeople, k: int, first: int, name: Ints) -> None:
    """Note the identities of people of the constraints by the names (hypothesis, row) of the k-th frame's rows."""
    for j in range(people.start[k], people.start[k + 1]):
        for n in range(len(name)):
            successors.identity[n, people.person[j]] = name[n, people.observation[j] - first]
