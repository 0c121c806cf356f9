"""Colour model of a person: colour samples of each body part (Kim and Davis 2006, samples of eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Floats, Ints
from stseg.baselines.kim_davis_2006.bodies import PARTS
from stseg.baselines.kim_davis_2006.colours import histogram

SAMPLES = 120
"""Colours kept of each part: N_M of eq. 1."""
_FEWEST = 20
"""A part with fewer samples has no model yet."""


@dataclass(frozen=True)
class PersonAppearance:
    """The colours of one person."""

    samples: Bytes
    """uint8 (part, SAMPLES, 3): as `colours.normalised` returns them."""
    counts: Ints
    """int64 (part,): number of valid samples of each part."""
    reference: Floats
    """float64 (part, bin): q* of eq. 7: their histograms; 0 where there are too few samples."""

    @classmethod
    def unknown(cls) -> PersonAppearance:
        """Model without samples."""
        parts = len(PARTS)
        empty = histogram(np.zeros((0, 3), np.uint8))
        return cls(np.zeros((parts, SAMPLES, 3), np.uint8), np.zeros(parts, np.int64), np.tile(empty, (parts, 1)))

    @property
    def usable_samples(self) -> Ints:
        """Number of usable samples of each part, int64 (part,); 0 for a part without a model."""
        return np.where(self.counts >= _FEWEST, self.counts, 0)

    def learned(self, part: int, colour: Bytes, share: float, rng: np.random.Generator) -> PersonAppearance:
        """With new colours, uint8 (n, 3), of a part: they fill the buffer, and replace a share of a full one."""
        samples, counts, reference = self.samples.copy(), self.counts.copy(), self.reference.copy()
        room = SAMPLES - int(counts[part])
        wanted = room if room else rng.binomial(SAMPLES, share)
        drawn = colour[rng.permutation(len(colour))[:wanted]]
        where = counts[part] + np.arange(len(drawn)) if room else rng.permutation(SAMPLES)[: len(drawn)]
        samples[part, where] = drawn
        counts[part] += len(drawn) if room else 0
        reference[part] = histogram(samples[part, : counts[part]] if counts[part] >= _FEWEST else drawn[:0])
        return PersonAppearance(samples, counts, reference)
