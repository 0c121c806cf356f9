"""Why a candidate is a ghost: what weighed most against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Flags, Ints, Rows

DENIED, OTHERS, TOO_LITTLE = 0, 1, 2
"""Reasons of `ghost_reasons`."""

REASONS = (
    "a view sees nobody there",
    "what supports it belongs to people nearby",
    "no view denies it, but too little supports it",
)
"""The same in words."""

_AGAINST = -1.0
"""Evidence from which on something speaks against a candidate, nats."""
_PRICE = -3.0
"""Prior log-odds of one more person, where a run has no people to learn it from, nats."""
_EXPRESSIVE = 0.25
"""Least evidence of a view that says anything, nats; of people hidden from it a detector's view says almost nothing."""


@dataclass(frozen=True)
class GhostReasons:
    """Why candidates are ghosts.

    Attributes
    ----------
    ghosts : rows (n,) with frame, x, y, evidence, parts
    reason : int64 (n,)
        What weighed most against it: `DENIED`, `OTHERS` or `TOO_LITTLE`.
    denies : bool (n, view)
        Views that see nobody there, whatever weighed most.
    """

    ghosts: Rows
    reason: Ints
    denies: Flags

    def counts(self) -> list[int]:
        """Number of ghosts of each reason."""
        return [int(count) for count in np.bincount(self.reason, minlength=len(REASONS))]


def ghost_reasons(candidates: Rows) -> GhostReasons:
    """The reason of every ghost: what weighed most against it.

    A ghost's evidence is the sum over views, less the price of one more person, less what the people who are there
    already lose to it. The price is the median, over the people of the run, of the sum over views less their evidence.

    Parameters
    ----------
    candidates : rows (n,) with status, evidence, parts
        As in the run file's /ghosts.
    """
    parts = np.nan_to_num(candidates["parts"].astype(float))
    short = candidates["evidence"] - parts.sum(axis=1)
    ghost, person = candidates["status"] == 0, candidates["status"] == 1
    price = float(np.median(short[person])) if person.any() else _PRICE
    parts, lost = parts[ghost], short[ghost] - price
    denies, against = parts <= _AGAINST, np.minimum(parts, 0).sum(axis=1)
    reason = np.full(len(parts), TOO_LITTLE)
    reason[lost <= _AGAINST] = OTHERS
    reason[denies.any(axis=1) & (against <= lost)] = DENIED
    return GhostReasons(candidates[ghost], reason, denies)


def says(parts: AnyArray) -> Flags:
    """Where a view's evidence speaks for or against a candidate, bool of the same shape."""
    return np.asarray(np.abs(parts) >= _EXPRESSIVE)
