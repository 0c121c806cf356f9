"""Population prior of body sizes, learned from the frames that are explained.

Heights h and relative widths r = w / h of people are normal with heavy tails (`stseg.records.sizes`). Each person of a
frame counts for the time of a frame, times the share of the population's variance that the frame resolved: a size
that the frame did not resolve counts nothing. The configured mean m_0 and spread s_0 count for `body.prior_weight`
seconds w_0 of one person, and measured sizes are forgotten (`stseg.records.forgetting`):

    m = (w_0 m_0 + sum w h) / W,    s^2 = (w_0 (s_0^2 + (m_0 - m)^2) + sum w (h - m)^2) / W,    W = w_0 + sum w,

the posterior means under a normal-inverse-gamma prior (Gelman et al. 2013, section 3.3), with s at least s_0: few
people are more alike than a population. Only rigs of pixels learn: a detector's box ends where another person begins,
and says nothing of widths.
"""

from dataclasses import replace

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.records.forgetting import Forgetting
from stseg.records.people import People

_LARGEST_SPREAD = 0.45
"""Largest standard deviation of a population that is learned, share of its mean: more is not one kind of body."""


class PopulationEstimate:
    """Accumulated sizes of people; parameters as of `stseg.noise.estimates`."""

    def __init__(self, body: BodyConfig, frame_rate: float, config: ErrorRateConfig) -> None:
        self._first, self._config = body, config
        self.moments = Forgetting((2, 3), frame_rate, config.memory)
        """(2, 3): of height and relative width: weight, and weighted sums of the size and its square; seconds,
        metres."""

    @property
    def body(self) -> BodyConfig:
        """The population by all frames so far."""
        first = self._first
        height, height_spread = self._posterior(0, first.height_mean, first.height_spread)
        share = 1 / first.height_mean
        wide, spread = self._posterior(1, first.width_mean * share, first.width_spread * share)
        return replace(
            first,
            height_mean=height,
            height_spread=min(height_spread, _LARGEST_SPREAD * height),
            width_mean=wide * height,
            width_spread=min(max(spread * height, first.width_spread), _LARGEST_SPREAD * wide * height),
        )

    def skip_frame(self) -> None:
        """Defer the weight of a frame in which no size was measured to the next one."""
        self.moments.skip_frame()

    def learn(self, people: People) -> None:
        """Count one frame, explained under the present population."""
        now, sizes = self.body, people.sizes
        trusted = people.evidence >= self._config.minimum_evidence
        self.moments.forget()
        for row, size, variance, spread in (
            (0, sizes.height, sizes.height_variance, now.height_spread),
            (1, sizes.width / sizes.height, sizes.width_variance, now.width_spread),
        ):
            self.moments.add(self.moments.seconds(_moments(size, variance / spread**2, trusted)), row)

    def _posterior(self, row: int, first_mean: float, first_spread: float) -> tuple[float, float]:
        """Posterior mean and spread of one size."""
        if not self.moments.sums[row, 0]:
            return first_mean, first_spread
        prior = np.array([1.0, first_mean, first_spread**2 + first_mean**2])
        weight, total, squares = self.moments.with_prior(self._first.prior_weight, prior)[row]
        mean = total / weight
        return float(mean), float(max(np.sqrt(squares / weight - mean**2), first_spread))


def _moments(size: Floats, unresolved: Floats, trusted: Flags) -> Floats:
    """Weight, sum and sum of squares of sizes (n,) of which a frame left such shares of the variance open, (3,)."""
    weight = np.where(trusted, 1.0 - unresolved, 0.0).clip(0.0)
    return np.array([weight.sum(), weight @ size, weight @ size**2])
