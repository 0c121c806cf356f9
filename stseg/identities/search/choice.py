"""The choice of the best hypotheses among alternatives: of those of one key the best alone.

A key tells who is present in a hypothesis, and who is unseen: hypotheses of one key have the same future. It is a sum
of numbers drawn at random for each row (Zobrist 1970): of each identity's first row times that of its last one.

Keys take time, and of many alternatives few are chosen: they are found for the best first, until enough differ.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.extension import Alternatives
from stseg.identities.search.hypotheses import Hypotheses, Pasts
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

KEY_BITS = (1 << 63) - 1
"""Keys have 63 bits, so that they are the same in machine words and as Python's numbers."""


class Present(NamedTuple):
    """People in each hypothesis before a frame, for keys of the hypotheses after it."""

    name: Ints
    """int64 (hypothesis, slot): first row of each identity, -1 for none."""
    unseen: Ints
    """int64 (hypothesis, slot): its term of the key where it has no row of the frame."""
    key: Ints
    """int64 (hypothesis,): key by the best assignment; -1 where it is not filled."""


@kernel
def choose_distinct(
    hypotheses: Hypotheses,
    pasts: Pasts,
    column: Ints,
    first: int,
    observed: ObservedRows,
    mark: Ints,
    every_alternative: Alternatives,
    total: int,
    most_loss: float,
    before: Present,
    chosen: Ints,
) -> int:
    """Choose the best alternatives of different keys, of equally good ones the first; the number of choices.

    The hypotheses before are `hypotheses` and `pasts`, with the slot of each row by the best assignment in `column`
    int64 (hypothesis, row), -1 for a new person, and `mark` int64 (hypothesis,), which differs where constraints bind
    the hypotheses otherwise; `before` is room for their people. `first` is the frame's first row of all rows,
    `observed`. `total` alternatives there are; `most_loss` is the greatest loss against the best, nats. `chosen` int64
    (most,) is filled with alternatives, the best first.
    """
    alternatives, present, size = pointed(every_alternative), pointed(before), 2
    while size < 2 * len(chosen):
        size *= 2
    heap, table, key = np.empty(total, np.int64), np.full(size, -1), np.empty(len(chosen), np.int64)
    waiting, number = _fill_heap(alternatives, total, most_loss, heap), 0
    while waiting > 0 and number < len(chosen):
        best, waiting = heap[0], waiting - 1
        heap[0] = heap[waiting]
        _sink(heap, waiting, 0, alternatives)
        h = alternatives.change[best, 0]
        if present.key[h] < 0:
            _fill_present(hypotheses, pasts, h, column, first, observed, int(mark[h]), present)
        found = _key_of(alternatives, best, column, first, observed, present)
        place = found & (size - 1)  # keys are in a table with open addressing
        while table[place] >= 0 and key[table[place]] != found:
            place = (place + 1) & (size - 1)
        if table[place] < 0:
            table[place], key[number], chosen[number] = number, found, best
            number += 1
    return number


@kernel
def empty_present(hypotheses: int, slots: int) -> Present:
    """Room for the people of some hypotheses."""
    shape = hypotheses, slots
    return Present(np.empty(shape, np.int64), np.empty(shape, np.int64), np.full(hypotheses, -1))


@part
def _fill_present(
    hypotheses: Hypotheses,
    pasts: Pasts,
    h: int,
    column: Ints,
    first: int,
    observed: ObservedRows,
    mark: int,
    present: Present,
) -> None:
    """Fill the people of a hypothesis, and its key by the best assignment."""
    key, slots = mark, present.name.shape[1]
    for s in range(slots):
        p = hypotheses.past[h, s]
        present.name[h, s] = pasts.name[p] if p >= 0 else -1
        if p >= 0:
            present.unseen[h, s] = _product(observed.hash_number[pasts.name[p]], observed.hash_number[pasts.last[p]])
            key = (key + int(present.unseen[h, s])) & KEY_BITS
    for i in range(column.shape[1]):
        key += _key_term(present, h, observed, first + i, column[h, i])
    present.key[h] = key & KEY_BITS


@part
def _key_of(
    alternatives: Alternatives, a: int, column: Ints, first: int, observed: ObservedRows, present: Present
) -> int:
    """Key of an alternative: that of the best assignment, with other terms for both rows that change."""
    change, h = alternatives.change, alternatives.change[a, 0]
    key = int(present.key[h])
    for k in (1, 3):
        i = change[a, k]
        if i >= 0:
            key += _key_term(present, h, observed, first + i, change[a, k + 1])
            key -= _key_term(present, h, observed, first + i, column[h, i])
    return key & KEY_BITS


@part
def _key_term(present: Present, h: int, observed: ObservedRows, r: int, s: int) -> int:
    """Change of the key of a hypothesis where row r is that of a slot, or of a new person (-1)."""
    if s < 0:
        return _product(observed.hash_number[r], observed.hash_number[r])
    return int(_product(observed.hash_number[present.name[h, s]], observed.hash_number[r]) - present.unseen[h, s])


@part
def _product(one: int, other: int) -> int:
    return (int(one) * int(other)) & KEY_BITS


@part
def _fill_heap(alternatives: Alternatives, total: int, most_loss: float, heap: Ints) -> int:
    """Fill a heap, the best first, with the alternatives that lose little against the best; how many they are."""
    best, number = -np.inf, 0
    for a in range(total):
        best = max(best, alternatives.value[a])
    for a in range(total):
        if not alternatives.value[a] < best - most_loss:
            heap[number] = a
            number += 1
    for place in range(number // 2 - 1, -1, -1):
        _sink(heap, number, place, alternatives)
    return number


@part
def _sink(heap: Ints, number: int, place: int, alternatives: Alternatives) -> None:
    """Restore the order of a heap, the best first, of which one place may be too high."""
    sinking = heap[place]
    while 2 * place + 1 < number:
        below = 2 * place + 1
        if below + 1 < number and _is_before(heap[below + 1], heap[below], alternatives):
            below += 1
        if not _is_before(heap[below], sinking, alternatives):
            break
        heap[place] = heap[below]
        place = below
    heap[place] = sinking


@part
def _is_before(one: int, other: int, alternatives: Alternatives) -> bool:
    """Whether one alternative comes before another."""
    better = alternatives.value[one] - alternatives.value[other]
    return bool(better > 0.0 or (better == 0.0 and one < other))
