"""Plain twin of the identity search: every partition of a few rows into people, each scored as a whole."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from stseg.arrays import Floats
from stseg.config import MotionConfig
from stseg.identities.evidence.observations import Observations
from stseg.tracking.filter.motion_model import process_noise, transition

BIRTH, ABSENCE, LEAST = 6.0, 1.0, -25.0


def partitions(rows: int) -> Iterator[list[int]]:
    """Names of rows, each the first row of its person."""
    if rows == 0:
        yield []
        return
    for names in partitions(rows - 1):
        for name in {*names, rows - 1}:
            yield [*names, name]


def greatest_score(seen: Observations, spread: Floats, motion: MotionConfig, longest: float) -> float:
    """Score of the best partition."""
    return max(score(seen, names, spread, motion, longest) for names in partitions(len(seen.order)))


def score(seen: Observations, names: list[int], spread: Floats, motion: MotionConfig, longest: float) -> float:
    """Score of a partition of the rows, nats; minus infinity where it is not allowed."""
    seconds = np.repeat(seen.seconds, np.diff(seen.start))
    total = 0.0
    for name in set(names):
        own = [row for row, other in enumerate(names) if other == name]
        if len(set(seconds[own])) < len(own) or (np.diff(seconds[own]) > longest).any():
            return -np.inf
        total += path(seen, own, seconds, motion) - BIRTH * seen.rows.inside[name] + sizes(seen, own, spread)
        if seconds[-1] - seconds[own[-1]] > longest:
            total -= BIRTH * seen.rows.inside[own[-1]]
    broken = [row for row in np.flatnonzero(seen.rows.certain) if names[row] != names[seen.rows.previous[row]]]
    return -np.inf if broken else total


def path(seen: Observations, own: list[int], seconds: Floats, motion: MotionConfig) -> float:
    """Log-likelihood of a person's places after the first, less what absence costs."""
    state = np.append(seen.rows.ground[own[0]], [0.0, 0.0])
    covariance = np.diag([seen.rows.variance[own[0]]] * 2 + [motion.speed_spread**2] * 2)
    total = 0.0
    for before, row in pairwise(own):
        step = seconds[row] - seconds[before]
        state = transition(step) @ state
        covariance = transition(step) @ covariance @ transition(step).T + process_noise(step, motion)
        around = covariance[:2, :2] + seen.rows.variance[row] * np.eye(2)
        off = seen.rows.ground[row] - state[:2]
        total += max(-0.5 * float(off @ np.linalg.solve(around, off)), LEAST) - ABSENCE * step
        total -= float(np.log(2 * np.pi * np.sqrt(np.linalg.det(around))))
        gain = covariance[:, :2] @ np.linalg.inv(around)
        state, covariance = state + gain @ off, covariance - gain @ covariance[:2]
    return total


def sizes(seen: Observations, own: list[int], spread: Floats) -> float:
    """Log-likelihood ratio of one size in all rows, against the mean of the population in each."""
    total = 0.0
    for d, variance in enumerate(spread):
        known = [row for row in own if seen.rows.precision[row, d] > 0]
        noise = np.diag([1 / seen.rows.precision[row, d] for row in known])
        off = np.array([seen.rows.information[row, d] / seen.rows.precision[row, d] for row in known])
        for around, sign in ((noise + variance, -0.5), (noise, 0.5)):
            if known:
                total += sign * float(off @ np.linalg.solve(around, off) + np.linalg.slogdet(around)[1])
    return total
