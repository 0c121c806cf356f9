"""Who of one frame is whom of the next: one-to-one assignments of places within a walker's reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats, Ints
from stseg.config import IdentityConfig

_TURN = 0.8
"""How people change their velocity, metres per second per square root of a second (standard deviation)."""
_STILL = 0.8
"""Standard deviation of the velocity of somebody new, metres per second."""
_GATE = 9.2
"""Squared Mahalanobis distance beyond which nobody is linked: one true link in a hundred."""
_STRANGER = 13.8
"""Minus twice the log-probability that somebody leaves and another comes instead: one in a thousand."""
_GAPS, _LINKS = 2.0, 20.0
"""How often people are lost from sight before anything is known, as so many of so many links."""
_STILL_HIDDEN = 0.6
"""Who is out of sight stays so for another frame this often."""


def assign(cost: Floats, alone: float) -> tuple[Ints, Ints]:
    """Pairs of least total cost where staying alone costs `alone` a pair; rows and columns, both int64."""
    if not cost.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    gain = np.minimum(cost - alone, 0.0)
    rows, columns = linear_sum_assignment(gain)
    kept = gain[rows, columns] < 0
    return rows[kept], columns[kept]


def distances(a: Floats, b: Floats) -> Floats:
    """Distances of every point (n, 2) from every other (m, 2), metres, float64 (n, m)."""
    return np.asarray(np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)))


@dataclass(frozen=True)
class Walker:
    """Somebody whom the linker follows: chain, last frame, and a constant-velocity estimate of (x, y, vx, vy)."""

    chain: int
    frame: int
    state: Floats
    covariance: Floats

    def at(self, frame: int, frame_rate: float) -> Walker:
        """Carried to a later frame, metres and seconds."""
        dt = (frame - self.frame) / frame_rate
        motion = np.eye(4)
        motion[:2, 2:] = dt * np.eye(2)
        noise = np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2)) * _TURN**2
        return Walker(self.chain, self.frame, motion @ self.state, motion @ self.covariance @ motion.T + noise)

    def seen(self, frame: int, ground: Floats, noise: Floats) -> Walker:
        """Corrected by a place with its covariance (Kalman's update)."""
        gain = self.covariance[:, :2] @ np.linalg.inv(self.covariance[:2, :2] + noise)
        state = self.state + gain @ (ground - self.state[:2])
        return Walker(self.chain, frame, state, self.covariance - gain @ self.covariance[:2])


class Linker:
    """Follows people from frame to frame, and over as many frames as patience allows.

    Each frame's places are assigned one to one to the walkers, by Mahalanobis distance from where each was expected
    and by how likely it is that the walker was missed meanwhile: how often people are missed is learned on the way.
    """

    def __init__(self, frame_rate: float, config: IdentityConfig) -> None:
        self.frame_rate = frame_rate
        self.config = config
        self.walkers: list[Walker] = []
        self.issued = 0
        self.gaps, self.links = _GAPS, _LINKS

    def link(self, frame: int, ground: Floats, covariance: Floats) -> Ints:
        """The chain to which each person of a frame belongs.

        Parameters
        ----------
        frame
            Its number; frames come in order.
        ground, covariance : float64 (n, 2), (n, 2, 2)
            Metres, square metres.

        Returns
        -------
        int64 (n,)
            Chain numbers from 1; those not met before are new.
        """
        noise = covariance + np.eye(2) * self.config.place_noise**2
        expected = [walker.at(frame, self.frame_rate) for walker in self.walkers]
        unseen = np.array([self._unseen(frame - walker.frame - 1) for walker in expected])
        cost = np.array([_surprise(w, ground, noise, self._reach(frame, w)) for w in expected])
        cost = cost.reshape(len(expected), len(ground)) + unseen[:, None]
        rows, columns = assign(cost, _STRANGER)
        self.links += len(rows)
        self.gaps += sum(frame - expected[row].frame > 1 for row in rows)
        chains = np.zeros(len(ground), np.int64)
        met = dict(zip(columns.tolist(), rows.tolist(), strict=True))
        followed = []
        for j in range(len(ground)):
            if j in met:
                walker = expected[met[j]].seen(frame, ground[j], noise[j])
            else:
                self.issued += 1
                spread = np.diag([0.0, 0.0, _STILL**2, _STILL**2])
                spread[:2, :2] = noise[j]
                walker = Walker(self.issued, frame, np.append(ground[j], [0.0, 0.0]), spread)
            chains[j] = walker.chain
            followed.append(walker)
        patience = round(self.config.patience * self.frame_rate) + 1
        lost = [w for k, w in enumerate(self.walkers) if k not in met.values() and frame - w.frame < patience]
        self.walkers = followed + lost
        return chains

    def _unseen(self, frames: int) -> float:
        """Minus twice the log-probability of being out of sight for so many frames, in this recording."""
        if frames == 0:
            return 0.0
        return float(-2.0 * (np.log(self.gaps / self.links) + (frames - 1) * np.log(_STILL_HIDDEN)))

    def _reach(self, frame: int, walker: Walker) -> float:
        """How far a walker may be from where they were last seen, metres."""
        return self.config.walking_speed * (frame - walker.frame) / self.frame_rate + self.config.slack


def _surprise(walker: Walker, ground: Floats, noise: Floats, reach: float) -> Floats:
    """Squared Mahalanobis distances of places (n, 2) from a walker's expected place, float64 (n,)."""
    off = ground - walker.state[:2]
    spread = walker.covariance[:2, :2] + noise
    square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off) if len(off) else np.zeros(0)
    return np.where((np.hypot(off[:, 0], off[:, 1]) <= reach) & (square <= _GATE), square, np.inf)
