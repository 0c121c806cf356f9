"""The tracked people and their particles: the joint state of Kim and Davis 2006, section 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.baselines.kim_davis_2006.appearance import PersonAppearance


@dataclass(frozen=True)
class Crowd:
    """Tracked people."""

    ids: Ints
    last_detection: Ints
    """int64 (n,) each: track ids, and the last frame in which each was detected."""
    height: Floats
    """float64 (n,): metres."""
    ground: Floats
    covariance: Floats
    """float64 (n, 2) and (n, 2, 2): estimate of the last frame, metres."""
    particles: Floats
    """float64 (particle, n, 2): joint hypotheses of all places, metres."""
    appearances: tuple[PersonAppearance, ...]
    """Colour model of each person."""

    @classmethod
    def empty(cls, particles: int) -> Crowd:
        """No people, with a number of particles."""
        none = np.zeros(0, np.int64)
        return cls(none, none, np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros((particles, 0, 2)), ())

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def reference(self) -> Floats:
        """q* of every person, float64 (n, part, bin)."""
        none = np.zeros((0, *PersonAppearance.unknown().reference.shape))
        return np.concatenate([none, *(one.reference[None] for one in self.appearances)])

    def kept(self, which: Flags) -> Crowd:
        """The chosen people, bool (n,)."""
        appearances = tuple(one for one, stays in zip(self.appearances, which, strict=True) if stays)
        return Crowd(
            self.ids[which],
            self.last_detection[which],
            self.height[which],
            self.ground[which],
            self.covariance[which],
            self.particles[:, which],
            appearances,
        )

    def joined_with(self, others: Crowd) -> Crowd:
        """These, then others, concatenated."""
        return Crowd(
            np.append(self.ids, others.ids),
            np.append(self.last_detection, others.last_detection),
            np.append(self.height, others.height),
            np.concatenate([self.ground, others.ground]),
            np.concatenate([self.covariance, others.covariance]),
            np.concatenate([self.particles, others.particles], 1),
            self.appearances + others.appearances,
        )
