"""Reasons of ghosts, read from the rows of a run file: the main evidence against each rejected candidate.

The decision itself is taken by the detector (`stseg.detection.ghosts`).
"""

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
"""The reasons as text."""

_AGAINST = -1.0
"""Greatest evidence against a candidate, nats."""
_PRICE = -3.0
"""Prior log-odds of one more person, where a run has no people to learn it from, nats."""
_EXPRESSIVE = 0.25
"""Least informative evidence of a view, nats; of occluded people a detector's view has almost none."""


@dataclass(frozen=True)
class GhostReasons:
    """Ghosts with their reasons."""

    ghosts: Rows
    """rows (n,) with frame, x, y, evidence, parts."""
    reason: Ints
    """int64 (n,): main reason: `DENIED`, `OTHERS` or `TOO_LITTLE`."""
    denies: Flags
    """bool (n, view): views with evidence against it, whatever the main reason."""

    def counts(self) -> list[int]:
        """Number of ghosts of each reason."""
        return [int(count) for count in np.bincount(self.reason, minlength=len(REASONS))]


def ghost_reasons(candidates: Rows) -> GhostReasons:
    """Find the main reason against every ghost.

    Its evidence is the sum over the views, minus the prior cost of one more person, minus the evidence that people
    already detected lose to it. The prior cost is the median, over the run's people, of the sum minus the evidence. The
    candidates are rows (n,) with status, evidence and parts, as in the run file's /ghosts.
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


def has_evidence(parts: AnyArray) -> Flags:
    """Whether a view has evidence for or against a candidate, bool of the same shape."""
    return np.asarray(np.abs(parts) >= _EXPRESSIVE)
