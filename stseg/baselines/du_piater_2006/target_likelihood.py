"""Colour likelihood p(z | x) of a target at a place in a view (Du and Piater 2006, section 3.3, in eqs 8 to 11)."""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.baselines.du_piater_2006.histogram import histograms
from stseg.baselines.du_piater_2006.view import StarView
from stseg.config import BeliefConfig


@dataclass(frozen=True)
class TargetLikelihood:
    """One target in one view of one frame.

    The likelihood of a place is exp(-k D^2) with D^2 = 1 - sum sqrt(p q), p and q the histogram there
    and the learned one (the sum is their Bhattacharyya coefficient), averaged over the parts of the body. What a nearer
    person hides, or lies beyond the image, is uninformative: its D^2 is `belief.neutral_distance`. A target that is not
    visible at all is a case of its own, of the same D^2.
    """

    view: StarView
    """The view."""
    image: Bytes
    """uint8 (v, u, 3): its frame: blue, green, red."""
    reference: Floats
    """float64 (part, bin): the target's colours."""
    height: float
    """The target's height, metres."""
    nearer: Floats
    """float64 (k, 4): boxes of people in front of the target."""
    config: BeliefConfig
    """The constants."""

    @property
    def hidden(self) -> float:
        """Likelihood of the image if the target is not visible."""
        return float(np.exp(-self.config.colour_weight * self.config.neutral_distance))

    def likelihood(self, ground: Floats) -> tuple[Floats, Floats]:
        """Likelihood of the target at ground points (n, 2), and its visible fraction there; both (n,)."""
        colours, share = histograms(self.image, self.view.boxes(ground, self.height), self.nearer)
        square = share * squares(colours, self.reference) + (1 - share) * self.config.neutral_distance
        return np.exp(-self.config.colour_weight * square.mean(1)), share.mean(1)


def squares(colours: Floats, reference: Floats) -> Floats:
    """D^2 of histograms (n, part, bin) and the parts of a reference (part, bin), 0..1, float64 (n, part)."""
    return np.asarray(1.0 - np.einsum("npb,pb->np", np.sqrt(colours), np.sqrt(reference))).clip(0.0)
