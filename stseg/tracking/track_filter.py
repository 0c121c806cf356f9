"""Who is followed from frame to frame: a constant-velocity filter for each (HW12's Kalman filter; METHODS 7, 8).

What a frame expects of them is a prior of its pass, which says who of the people that it found is whom: so who is who
and who is there are decided together, and each piece of evidence is used once. A walker's height is a property of the
person: it is what tells two people apart who have just crossed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config, MotionConfig
from stseg.model.people import People
from stseg.model.predicted_tracks import PredictedTracks
from stseg.model.sizes import Sizes
from stseg.tracking.assignment import distances

_GROWTH = 0.002
"""How a person's height changes, metres per square root of a second (standard deviation): shoes, stoop, lens."""
_STAYING = 1.0
"""Log-odds at most that somebody seen in one frame is found in the next, nats."""
_DOUBTFUL = -4.0
"""Log-odds below which somebody who was not found is not looked for again, nats."""
_REPEATED = 2.0
"""What is taken off them: a second frame's evidence is not independent of the first's, nats."""
_BESIDE = 0.5
"""Nobody new is looked for so near to somebody who is followed, metres."""
_OPEN = 0.6
"""A frame that leaves more of the variance of people's sizes than this has not seen somebody's."""
_FORGETTING = 4.0
"""How fast those fall while a walker is out of sight, nats per second."""


class Measurement(NamedTuple):
    """One measurement and its variance, metres and square metres."""

    mean: float
    variance: float


@dataclass(frozen=True)
class TrackState:
    """Somebody who is followed.

    Attributes
    ----------
    chain
        Number, from 1; 0 for somebody who was not found yet, but may be there.
    seen
        The last frame that showed them.
    state, covariance : float64 (4,), (4, 4)
        x, y, vx, vy in metres and metres per second, at that frame.
    height, height_variance, width, width_variance
        Metres, square metres.
    odds
        Log-odds that they are there, nats.
    """

    chain: int
    seen: int
    state: Floats
    covariance: Floats
    height: float
    height_variance: float
    width: float
    width_variance: float
    odds: float

    def carried(self, seconds: float, model: MotionConfig) -> TrackState:
        """Some time after they were last seen."""
        motion = np.eye(4)
        motion[:2, 2:] = seconds * np.eye(2)
        turn = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]]) * model.velocity_noise**2
        return replace(
            self,
            state=motion @ self.state,
            covariance=motion @ self.covariance @ motion.T + np.kron(turn, np.eye(2)),
            height_variance=self.height_variance + _GROWTH**2 * seconds,
            width_variance=self.width_variance + _GROWTH**2 * seconds,
        )

    def found(
        self, frame: int, ground: Floats, covariance: Floats, height: Measurement, width: Measurement, odds: float
    ) -> TrackState:
        """Corrected by the posterior of their place, in which the expected place is the prior.

        The velocity follows by what the place and it have in common. Height and width are measurements.
        """
        gain = self.covariance[:, :2] @ np.linalg.inv(self.covariance[:2, :2])
        surplus = self.covariance[:2, :2] - covariance
        tall = self.height_variance / (self.height_variance + height.variance)
        wide = self.width_variance / (self.width_variance + width.variance)
        return TrackState(
            self.chain,
            frame,
            self.state + gain @ (ground - self.state[:2]),
            self.covariance - gain @ surplus @ gain.T,
            self.height + tall * (height.mean - self.height),
            self.height_variance * (1 - tall),
            self.width + wide * (width.mean - self.width),
            self.width_variance * (1 - wide),
            odds,
        )


class TrackFilter:
    """All who are followed, from frame to frame, and over as many frames as patience allows.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        The constants of all stages: body, motion, detection and tracking.
    """

    def __init__(self, frame_rate: float, config: Config) -> None:
        self.frame_rate = frame_rate
        self.body, self.motion = config.body, config.motion
        self.config, self.birth_log_odds = config.tracking, config.detection.prior_log_odds
        self.walkers: list[TrackState] = []
        self.issued = 0
        self.begun = False

    def expected(self, frame: int) -> PredictedTracks | None:
        """Whom to expect in a frame later than those seen; None before the first."""
        if not self.begun:
            return None
        carried = [self._carried(walker, frame) for walker in self.walkers]
        return PredictedTracks(
            np.array([w.state[:2] for w in carried]).reshape(-1, 2),
            np.array([w.covariance[:2, :2] for w in carried]).reshape(-1, 2, 2) + self._place_noise,
            Sizes(
                np.array([w.height for w in carried]),
                np.array([w.height_variance for w in carried]) + self.config.height_noise**2,
                np.array([w.width for w in carried]),
                np.array([w.width_variance for w in carried]) + self.config.width_noise**2,
            ),
            np.array([w.odds for w in carried]),
        )

    def follow(self, frame: int, people: People, ghosts: People) -> Ints:
        """The chain of each person of a frame that was explained with what `expected` said.

        Returns
        -------
        int64 (n,)
            Chain numbers from 1; those not met before are new.
        """
        self.begun = True
        heights, widths = self._measured(people)
        chains, followed = np.zeros(len(people), np.int64), []
        for j in range(len(people)):
            known = int(people.track_index[j])
            before = self._carried(self.walkers[known], frame) if known >= 0 else self._newcomer(frame, people, j)
            odds = (before.odds if known >= 0 else self.birth_log_odds) + people.evidence[j] - people.prior[j]
            followed.append(
                before.found(
                    frame, people.ground[j], people.covariance[j], heights[j], widths[j], min(float(odds), _STAYING)
                )
            )
            if before.chain == 0:
                self.issued += 1
                followed[-1] = replace(followed[-1], chain=self.issued)
            chains[j] = followed[-1].chain
        patience = round(self.config.patience * self.frame_rate)
        hidden = np.setdiff1d(np.arange(len(self.walkers)), people.track_index)
        lost = [self.walkers[k] for k in hidden if self.walkers[k].chain and frame - self.walkers[k].seen <= patience]
        self.walkers = followed + lost
        self.walkers += self._doubtful(frame, ghosts)
        return chains

    def _measured(self, people: People) -> tuple[list[Measurement], list[Measurement]]:
        """Heights and widths of a frame; one that leaves a size as open as it was before has no weight."""
        sizes, like, noise = people.sizes, self.body, self.config
        return (
            _told(sizes.height, sizes.height_variance, like.height_spread, noise.height_noise),
            _told(sizes.width, sizes.width_variance, like.width_spread, noise.width_noise),
        )

    @property
    def _place_noise(self) -> Floats:
        return np.eye(2) * self.motion.position_noise**2

    def _carried(self, walker: TrackState, frame: int) -> TrackState:
        seconds = (frame - walker.seen) / self.frame_rate
        hidden = seconds - 1 / self.frame_rate
        return replace(walker.carried(seconds, self.motion), odds=walker.odds - _FORGETTING * hidden)

    def _doubtful(self, frame: int, ghosts: People) -> list[TrackState]:
        """Who was not believed in this frame, but will be if the next shows them again (evidence adds up over time)."""
        standing = np.array([self._carried(walker, frame).state[:2] for walker in self.walkers]).reshape(-1, 2)
        near = distances(ghosts.ground, standing).min(1, initial=np.inf) < _BESIDE
        return [
            replace(self._newcomer(frame, ghosts, j), odds=float(ghosts.evidence[j]) - _REPEATED)
            for j in np.flatnonzero(~near & (ghosts.evidence > _DOUBTFUL)).tolist()
        ]

    def _newcomer(self, frame: int, people: People, j: int) -> TrackState:
        """Somebody new: anywhere near the place, as tall as anybody, of any velocity."""
        spread = np.diag([0.0, 0.0, self.motion.speed_spread**2, self.motion.speed_spread**2])
        spread[:2, :2] = people.covariance[j] + self._place_noise
        state = np.append(people.ground[j], [0.0, 0.0])
        like = self.body
        sizes = (like.height_mean, like.height_spread**2, like.width_mean, like.width_spread**2)
        return TrackState(0, frame, state, spread, *sizes, 0.0)


def _told(mean: Floats, variance: Floats, spread: float, noise: float) -> list[Measurement]:
    """Measurements of one size, metres, from posteriors whose prior has a standard deviation of `spread`."""
    off = np.where(variance < _OPEN * spread**2, noise**2, np.inf)
    return [Measurement(*one) for one in zip(mean.tolist(), off.tolist(), strict=True)]
