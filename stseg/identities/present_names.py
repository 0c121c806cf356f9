"""Keys of who is present in a hypothesis, and who is unseen: hypotheses of one key have the same future.

A key is a sum of numbers drawn at random for each birth and each row (Zobrist 1970): of each identity's birth times
that of its last row. Identities of one birth are the same: hypotheses that differ in nothing but the frame of it are
one. Where several identities of a hypothesis have one birth, they are told apart by their order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.hypotheses import Hypotheses
from stseg.identities.search.pasts import Pasts
from stseg.kernels.accelerate import kernel, part

KEY_BITS = (1 << 63) - 1
"""Keys have 63 bits, so that they are the same in machine words and as Python's numbers."""


class Present(NamedTuple):
    """Who was there in a hypothesis before a frame, for keys of the hypothesis after it.

    Attributes
    ----------
    name, birth : int64 (slot,)
        First row of each identity, -1 for none, and the number of its birth.
    kin, unseen : int64 (slot,)
        How each identity is known to other hypotheses, and its share of the key where it has no row of the frame.
    """

    name: Ints
    birth: Ints
    kin: Ints
    unseen: Ints


@kernel
def empty_present(slots: int) -> Present:
    """Room for some slots."""
    return Present(
        np.empty(slots, np.int64), np.empty(slots, np.int64), np.empty(slots, np.int64), np.empty(slots, np.int64)
    )


@part
def fill_present(held: Hypotheses, pasts: Pasts, h: int, seen: ObservedRows, there: Present) -> int:
    """Fill who is there in a hypothesis; the key where nobody has a row of the frame."""
    key = 0
    for s in range(len(there.name)):
        p = held.past[h, s]
        there.name[s] = pasts.name[p] if p >= 0 else -1
        there.birth[s] = seen.birth[there.name[s]] if p >= 0 else -1
    for s in range(len(there.name)):
        if there.name[s] >= 0:
            there.kin[s] = _kin(there, there.name[s], there.birth[s])
            there.unseen[s] = _product(there.kin[s], seen.sign[pasts.last[held.past[h, s]]])
            key = (key + int(there.unseen[s])) & KEY_BITS
    return key


@part
def row_share(there: Present, seen: ObservedRows, r: int, s: int) -> int:
    """What the key changes by where row r is that of a slot, or of somebody new (-1)."""
    if s < 0:
        return _product(_kin(there, r, seen.birth[r]), seen.sign[r])
    return int(_product(there.kin[s], seen.sign[r]) - there.unseen[s])


@part
def _product(one: int, other: int) -> int:
    return (int(one) * int(other)) & KEY_BITS


@part
def _kin(there: Present, own: int, born: int) -> int:
    """How an identity of this first row and birth is known: by its birth, and how many others of it began before."""
    rank = 0
    for s in range(len(there.name)):
        if 0 <= there.name[s] < own and there.birth[s] == born:
            rank += 1
    return int(born + rank)
