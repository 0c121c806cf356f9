"""Links between candidates of a window that may be the same body in two frames, and their gains.

    b_ij = birth cost_j + death cost_i + log(s^2 / sqrt|S_ij|) - d_ij^2 / 2 - prior log-odds + height ratio - absence

A link saves the birth of the later candidate and the death of the earlier one, and adds how much likelier the later
place is as the continuation of the earlier one than as the place of any other person.
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import BodyConfig, MotionConfig
from stseg.kernels.accelerate import kernel
from stseg.records.predicted_tracks import EXISTENCE_DECAY, LEAST_HEIGHT_RATIO, PLACE_RESOLUTION
from stseg.records.sizes import log_population_height
from stseg.segmentation.label_energy import PLACE_GATE

_LINKS_PER_CANDIDATE = 32
"""Links of a candidate for which there is room at first."""
Links = tuple[Ints, Ints, Floats]
"""Candidates before and after, and b, nats, (link,) each."""


@dataclass(frozen=True)
class WindowCandidates:
    """Candidates of all frames of a window, by rising frame."""

    frames: int
    """Number of frames of the window."""
    frame: Ints
    """int64 (n,): counted from the window's first."""
    ground: Floats
    """float64 (n, 2): metres."""
    covariance: Floats
    """float64 (n, 2, 2): square metres."""
    height: Floats
    """float64 (n,): metres."""
    evidence: Floats
    """float64 (n,): evidence of the views alone, given the detector's people of the frame, nats."""
    track: Ints
    """int64 (n,): track that the detector gave each person; 0 for rejected candidates."""

    def __len__(self) -> int:
        return len(self.frame)


@dataclass(frozen=True)
class LinkModel:
    """Gains of links."""

    frame_rate: float
    """Frames per second."""
    longest_absence: float
    """Longest absence inside a path, seconds."""
    prior_log_odds: float
    """Log of the prior odds of a person at a place, nats."""
    motion: MotionConfig
    body: BodyConfig

    def between(self, found: WindowCandidates, birth: Floats, death: Floats) -> Links:
        """Possible links and b; those that gain nothing are left out."""
        start, end = self._near(found)
        seconds = (found.frame[end] - found.frame[start]) / self.frame_rate
        off = found.ground[end] - found.ground[start]
        noise = 2 * self.motion.position_noise**2 + (self.motion.speed_spread * seconds) ** 2
        spread = found.covariance[start] + found.covariance[end] + noise[:, None, None] * np.eye(2)
        square = np.einsum("ei,eij,ej->e", off, np.linalg.inv(spread), off)
        place = np.log(PLACE_RESOLUTION**2 / np.sqrt(np.linalg.det(spread))) - 0.5 * square
        absence = EXISTENCE_DECAY * (seconds - 1 / self.frame_rate)
        bonus = place - self.prior_log_odds + self._height_ratio(found, start, end) - absence
        bonus = bonus + birth[end] + death[start]
        kept = (bonus > 0) & (square < PLACE_GATE)
        return start[kept], end[kept], bonus[kept]

    def _near(self, found: WindowCandidates) -> tuple[Ints, Ints]:
        """Pairs within the longest absence and the gate: a window's pairs would take more memory than its volume."""
        span = max(1, round(self.longest_absence * self.frame_rate))
        noise, speed = 2 * self.motion.position_noise**2, self.motion.speed_spread / self.frame_rate
        number = _LINKS_PER_CANDIDATE * len(found)
        while True:
            pair = np.empty((number, 2), np.int64)
            number = _fill_near(found.frame, found.ground, found.covariance, span, noise, speed, pair)
            if number <= len(pair):
                break
        start, end = pair[:number].T
        return start, end

    def _height_ratio(self, found: WindowCandidates, start: Ints, end: Ints) -> Floats:
        """Log-ratio of a height as the continuation of another against the population, nats."""
        spread, error = self.body.height_spread, self.body.height_spread / 2
        off = found.height[end] - found.height[start]
        population = log_population_height(found.height[end], self.body)
        ratio = np.log(spread / error) - 0.5 * (off / error) ** 2 - population
        return np.asarray(np.maximum(ratio, LEAST_HEIGHT_RATIO))


@kernel
def _fill_near(
    frame: Ints, ground: Floats, covariance: Floats, span: int, noise: float, speed: float, pair: Ints
) -> int:
    """Fill pair (pair, 2), as far as it reaches, with candidates that may be linked; the number of these pairs.

    `frame`, `ground` and `covariance` are as of `WindowCandidates`; `span` is the most frames between two that are
    linked, `noise` the variance of the distance between two places of a standing person, square metres, and `speed` the
    standard deviation of a step, metres a frame.
    """
    found = 0
    for i in range(len(frame)):
        x, y = ground[i]
        variance = covariance[i, 0, 0] + covariance[i, 1, 1] + 2.0 * noise
        for j in range(i + 1, len(frame)):
            frames = frame[j] - frame[i]
            if frames > span:
                break
            if frames == 0:
                continue
            # The square distance is at least that by the sum of both variances: most pairs need no inverse.
            spread = variance + covariance[j, 0, 0] + covariance[j, 1, 1] + 2.0 * (speed * frames) * (speed * frames)
            if (ground[j, 0] - x) ** 2 + (ground[j, 1] - y) ** 2 < PLACE_GATE * spread:
                if found < len(pair):
                    pair[found, 0], pair[found, 1] = i, j
                found += 1
    return found
