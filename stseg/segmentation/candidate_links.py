"""Links between candidates of a window: which of a later frame may be the same body, and what that gains.

    b_ij = birth cost_j + death cost_i + log [ N(m_j - m_i; 0, S_ij) / (prior odds / s^2) ] + height ratio - absence

A link saves the birth of the later candidate and the death of the earlier one, and adds how much likelier the later
place is as the continuation of the earlier one than as the place of any other person.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import BodyConfig, MotionConfig
from stseg.model.sizes import log_heavy_tailed

_RESOLUTION = 0.1
"""s: standard deviation of the place of a detection, to which the prior log-odds refer, metres."""
_ABSENCE = 4.0
"""Cost of a frame without a candidate inside a path, nats per second."""
_GATE = 13.8
"""Squared Mahalanobis distance of a link that one step in a thousand exceeds."""
_OUT_OF_SHAPE = -4.0
"""Least log-ratio of two heights, nats: people stoop and sit."""
Links = tuple[Ints, Ints, Floats]
"""Candidates before and after, and b, nats, (link,) each."""


@dataclass(frozen=True)
class WindowCandidates:
    """Candidates of all frames of a window, by rising frame.

    Attributes
    ----------
    frame : int64 (n,)
        From the window's first.
    ground, covariance : float64 (n, 2), (n, 2, 2)
        Metres, square metres.
    height : float64 (n,)
        Metres.
    evidence : float64 (n,)
        Evidence of the views alone, given the detector's people of the frame, nats.
    track : int64 (n,)
        Track that the detector gave each person; 0 for rejected candidates.
    """

    frame: Ints
    ground: Floats
    covariance: Floats
    height: Floats
    evidence: Floats
    track: Ints

    def __len__(self) -> int:
        return len(self.frame)


@dataclass(frozen=True)
class LinkModel:
    """What a link gains.

    Attributes
    ----------
    frame_rate
        Frames per second.
    patience
        Longest absence inside a path, seconds.
    prior_log_odds
        Log of the prior odds of a person at a place, nats.
    """

    frame_rate: float
    patience: float
    prior_log_odds: float
    motion: MotionConfig
    body: BodyConfig

    def between(self, found: WindowCandidates, birth: Floats, death: Floats) -> Links:
        """Possible links and b; those that gain nothing are left out.

        Frame by frame: a window's pairs all at once would take more memory than its volume.
        """
        span = max(1, round(self.patience * self.frame_rate))
        ends = np.searchsorted(found.frame, np.arange(found.frame[-1] + 2))
        each = []
        for first, stop, last in zip(ends, ends[1:], ends[1 + span :].tolist() + [len(found)] * span, strict=False):
            start, end = np.meshgrid(np.arange(first, stop), np.arange(stop, last), indexing="ij")
            each.append(self._worthwhile(found, start.ravel(), end.ravel(), birth, death))
        start, end, bonus = (np.concatenate(part) for part in zip(*each, strict=True))
        return start, end, bonus

    def _worthwhile(self, found: WindowCandidates, start: Ints, end: Ints, birth: Floats, death: Floats) -> Links:
        """Those of some pairs of candidates whose link gains something."""
        seconds = (found.frame[end] - found.frame[start]) / self.frame_rate
        off = found.ground[end] - found.ground[start]
        noise = 2 * self.motion.position_noise**2 + (self.motion.speed_spread * seconds) ** 2
        spread = found.covariance[start] + found.covariance[end] + noise[:, None, None] * np.eye(2)
        # The square distance is at least that by the sum of both variances: most pairs need no inverse.
        near = np.einsum("ei,ei->e", off, off) < _GATE * np.trace(spread, axis1=1, axis2=2)
        start, end, seconds, off, spread = start[near], end[near], seconds[near], off[near], spread[near]
        square = np.einsum("ei,eij,ej->e", off, np.linalg.inv(spread), off)
        place = np.log(_RESOLUTION**2 / np.sqrt(np.linalg.det(spread))) - 0.5 * square
        absence = _ABSENCE * (seconds - 1 / self.frame_rate)
        bonus = place - self.prior_log_odds + self._height_ratio(found, start, end) - absence
        bonus = bonus + birth[end] + death[start]
        kept = (bonus > 0) & (square < _GATE)
        return start[kept], end[kept], bonus[kept]

    def _height_ratio(self, found: WindowCandidates, start: Ints, end: Ints) -> Floats:
        """Log-ratio of a height as the continuation of another against the population, nats."""
        spread, error = self.body.height_spread, self.body.height_spread / 2
        off = found.height[end] - found.height[start]
        anybody = log_heavy_tailed((found.height[end] - self.body.height_mean) / spread)
        ratio = np.log(spread / error) - 0.5 * (off / error) ** 2 - anybody
        return np.asarray(np.maximum(ratio, _OUT_OF_SHAPE))
