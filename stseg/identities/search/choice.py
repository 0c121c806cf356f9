"""The choice of the best hypotheses among alternatives: of those of one key the best alone.

Keys take time, and of many alternatives few are chosen: they are found for the best first, until enough differ.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.present_names import KEY_BITS, Present, fill_present, row_share
from stseg.identities.search.alternatives import Alternatives
from stseg.identities.search.hypotheses import Hypotheses
from stseg.identities.search.pasts import Pasts
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

_CLASSES = 512
"""Classes of losses against the best alternative; the last has all that are too great."""


@kernel
def choose_distinct(
    held: Hypotheses, pasts: Pasts, column: Ints, first: int, seen: ObservedRows, mark: Ints,
    alternatives: Alternatives, total: int, most_loss: float, before: Present, chosen: Ints,
) -> int:  # fmt: skip
    """Choose the best alternatives of different keys; of equally good ones the first.

    Parameters
    ----------
    held, pasts
        The hypotheses before.
    column : int64 (hypothesis, row)
        Slot of each row by the best assignment, -1 for somebody new.
    first, seen
        The frame's first row, and all rows.
    mark : int64 (hypothesis,)
        Differs where constraints bind the hypotheses otherwise.
    alternatives, total
        The alternatives, and how many there are.
    most_loss
        Greatest loss against the best alternative, nats.
    before
        Work space.
    chosen : int64 (most,)
        Filled with alternatives, the best first.

    Returns
    -------
    int
        Number of choices.
    """
    found, there = pointed(alternatives), pointed(before)
    loss_class, upto = np.empty(total, np.int64), np.empty(_CLASSES, np.int64)
    _fill_classes(found, total, most_loss, loss_class, upto)
    size = 2
    while size < 2 * upto[-2]:
        size *= 2
    table, key, best = np.empty(size, np.int64), np.empty(total, np.int64), np.empty(total, np.int64)
    table[:] = -1
    done, wanted, number = -1, len(chosen), 0
    while number < len(chosen) and done < _CLASSES - 2:
        last = done + 1
        while last < _CLASSES - 2 and upto[last] < wanted:
            last += 1
        number = _tell_apart(
            held, pasts, column, first, seen, mark, found, total, loss_class, done, last, there, table, key, best,
            number,
        )  # fmt: skip
        done, wanted = last, 2 * wanted
    return _fill_best(best, number, found, chosen)


@part
def _fill_classes(found: Alternatives, total: int, most_loss: float, loss_class: Ints, upto: Ints) -> None:
    """Fill the class of each alternative, and how many there are up to each class; the last has too great losses."""
    best = -np.inf
    for a in range(total):
        best = max(best, found.value[a])
    upto[:] = 0
    for a in range(total):
        loss = best - found.value[a]
        own = min(int(loss / most_loss * (_CLASSES - 1)), _CLASSES - 2)
        loss_class[a] = _CLASSES - 1 if found.value[a] < best - most_loss else own
        upto[loss_class[a]] += 1
    for k in range(1, _CLASSES):
        upto[k] += upto[k - 1]


@part
def _tell_apart(
    held: Hypotheses, pasts: Pasts, column: Ints, first: int, seen: ObservedRows, mark: Ints, found: Alternatives,
    total: int, loss_class: Ints, done: int, last: int, there: Present, table: Ints, key: Ints, best: Ints, number: int,
) -> int:  # fmt: skip
    """Add keys, and the best alternative of each (key,), of the classes after one up to another; number of keys.

    Keys are numbered by a table with open addressing.
    """
    h, start, change = -1, 0, found.change
    for a in range(total):
        if not done < loss_class[a] <= last:
            continue
        if change[a, 0] != h:
            h = change[a, 0]
            start = int(mark[h]) + fill_present(held, pasts, h, seen, there)
            for i in range(column.shape[1]):
                start += row_share(there, seen, first + i, column[h, i])
        own = start
        for k in range(4):  # the row, its slot, and what they were, of both rows that change
            i = change[a, 1 + k // 2 * 2]
            if i >= 0:
                s = column[h, i] if k % 2 else change[a, 2 + k // 2 * 2]
                share = row_share(there, seen, first + i, s)
                own += -share if k % 2 else share
        number += _add(own & KEY_BITS, a, found, table, key, best, number)
    return number


@part
def _add(own: int, a: int, found: Alternatives, table: Ints, key: Ints, best: Ints, number: int) -> int:
    """Add an alternative of a key, unless one is as good; by how many keys there are more."""
    at = own & (len(table) - 1)
    while table[at] >= 0 and key[table[at]] != own:
        at = (at + 1) & (len(table) - 1)
    if table[at] < 0:
        table[at], key[number], best[number] = number, own, a
        return 1
    if found.value[a] > found.value[best[table[at]]]:
        best[table[at]] = a
    return 0


@part
def _fill_best(heap: Ints, waiting: int, found: Alternatives, chosen: Ints) -> int:
    """Fill the best of the alternatives that wait; how many there are."""
    for place in range(waiting // 2 - 1, -1, -1):
        _sink(heap, waiting, place, found)
    number = min(waiting, len(chosen))
    for n in range(number):
        chosen[n] = heap[0]
        waiting -= 1
        heap[0] = heap[waiting]
        _sink(heap, waiting, 0, found)
    return number


@part
def _sink(heap: Ints, number: int, place: int, found: Alternatives) -> None:
    """Restore the order of a heap, the best first, of which one place may be too high."""
    own = heap[place]
    while 2 * place + 1 < number:
        below = 2 * place + 1
        if below + 1 < number and _before(heap[below + 1], heap[below], found):
            below += 1
        if not _before(heap[below], own, found):
            break
        heap[place] = heap[below]
        place = below
    heap[place] = own


@part
def _before(one: int, other: int, found: Alternatives) -> bool:
    """Whether one alternative comes before another."""
    better = found.value[one] - found.value[other]
    return bool(better > 0.0 or (better == 0.0 and one < other))
