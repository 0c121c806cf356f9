"""Axes along which people differ most beside the scatter within them (Ioffe 2006)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints

_MOST = 4
"""Most axes."""
_WHOLE = 0.1
"""Weight of the whole scatter in that within people: no axis is free of noise."""


@dataclass(frozen=True)
class Axes:
    """mean (k,), axis (k, d) of unit noise, and the spread among people along each, (d,)."""

    mean: Floats
    axis: Floats
    spread: Floats

    def of(self, value: Floats) -> Floats:
        """Appearance along the axes."""
        return np.asarray((value - self.mean) @ self.axis)


def discriminant_axes(value: Floats, people: Sequence[Ints]) -> Axes:
    """Axes of the greatest spread among people (rows of each, in the order of time) beside the scatter within them."""
    every = value[np.concatenate(people)]
    mean, size = every.mean(axis=0), value.shape[1]
    within, between = np.zeros((size, size)), np.zeros((size, size))
    for rows in people:
        centred = value[rows] - value[rows].mean(axis=0)
        within += centred.T @ centred / len(every)
        # Errors of the two halves are nearly independent, so no noise has to be subtracted.
        early, late = (part.mean(axis=0) - mean for part in np.array_split(value[rows], 2))
        between += (np.outer(early, late) + np.outer(late, early)) / 2 / len(people)
    whole = (every - mean).T @ (every - mean) / len(every)
    within = (1 - _WHOLE) * within + _WHOLE * whole + 1e-9 * max(np.trace(whole), 1e-9) * np.eye(size)
    root = np.linalg.cholesky(np.linalg.inv(within))
    spread, turn = np.linalg.eigh(root.T @ between @ root)
    chosen = np.argsort(-spread, kind="stable")[:_MOST]
    chosen = chosen[spread[chosen] > 0]
    return Axes(mean, root @ turn[:, chosen], spread[chosen])
