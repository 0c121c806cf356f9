"""Patches of ground around people: the places that are tried for each, and moments of a posterior over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints

PLACES = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), -1).reshape(-1, 2)
"""Places of a patch along its axes, in spacings."""
_SPACING = 0.08
"""First spacing of a patch, metres: a third of the offset of two lattice places."""
_GREATEST_SPREAD = 1.2
"""Standard deviation along an axis above which a patch does not hold a posterior, in spacings; a level one has 1.4."""


@dataclass(frozen=True)
class Patches:
    """Places that are tried for each person: five along each of two axes."""

    centre: Floats
    """float64 (n, 2): metres."""
    axes: Floats
    """float64 (n, 2, 2): steps along the two axes, as rows, metres; at right angles."""

    @classmethod
    def around(cls, ground: Floats) -> Patches:
        """Patches around people where they stand (n, 2), metres."""
        return cls(ground, np.tile(_SPACING * np.eye(2), (len(ground), 1, 1)))

    @property
    def ground(self) -> Floats:
        """float64 (n, place, 2): metres."""
        return self.centre[:, None] + PLACES @ self.axes

    def at(self, chosen: Ints) -> Patches:
        """Those of the chosen, int64 (k,)."""
        return Patches(self.centre[chosen], self.axes[chosen])

    def with_others(self, chosen: Ints, others: Patches) -> Patches:
        """With those of the chosen, int64 (k,), replaced by others."""
        axes = self.axes.copy()
        axes[chosen] = others.axes
        return Patches(self.centre, axes)

    def is_narrow(self, covariance: Floats) -> Flags:
        """Whether they do not hold posteriors with these covariances (n, 2, 2), bool (n,)."""
        return np.asarray(self._spread(self.axes, covariance).max(1, initial=0.0) > _GREATEST_SPREAD)

    def widened(self, covariance: Floats) -> Patches:
        """Twice as wide where that is needed, along the axes of posteriors by these patches (n, 2, 2)."""
        _, vectors = np.linalg.eigh(covariance)
        steps = np.sort(np.sqrt((self.axes**2).sum(2)), axis=1)  # the longer axis last, as of the covariance
        axes = vectors.transpose(0, 2, 1) * steps[..., None]
        wide = self._spread(axes, covariance) > _GREATEST_SPREAD
        return Patches(self.centre, axes * np.where(wide, 2.0, 1.0)[..., None])

    def moments(self, weight: Floats) -> tuple[Floats, Floats]:
        """Means and covariances of places by their weights (n, place), with that of the spacing; metres."""
        patch = self.ground
        ground = np.matmul(weight[:, None], patch)[:, 0]
        offset = patch - ground[:, None]
        covariance = np.matmul((offset * weight[..., None]).transpose(0, 2, 1), offset)
        return ground, covariance + np.matmul(self.axes.transpose(0, 2, 1), self.axes) / 12

    @staticmethod
    def _spread(axes: Floats, covariance: Floats) -> Floats:
        """Standard deviations along axes, in their steps, float64 (n, 2)."""
        square = (axes**2).sum(2)
        return np.asarray(np.sqrt(np.einsum("nij,njk,nik->ni", axes, covariance, axes)) / square)
