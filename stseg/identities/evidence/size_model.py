"""Errors and spread of people's sizes, learned from isolated tracklets (docs/how-it-works.md, Tracks).

A measured size is x = mean + person + error. A part of the error lasts (`stseg.noise.lasting_error`); the person's
part has the variance `spread` among people. A size of spread 0 says nothing of identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config
from stseg.noise.lasting_error import LastingError, constant_errors

_LEAST_FRAMES = 4
"""Least measured frames of a tracklet that is learned from."""
_PRIOR_PEOPLE = 4.0
"""Weight of the prior of the spread: pairs of tracklets."""
_PRIOR_TIME = 0.5
"""Prior time constant of an error, seconds."""
_POSTURE = LastingError(np.array(0.0), np.array(0.005**2), np.array(5.0))
"""Error of a height by posture beside what is learned, square metres and seconds: it lasts longer than most tracklets.
Without it, the many frames of a person who stoops are surely of two people."""
_FARTHEST = 4.0
"""Deviation of a row's size from which it is no size of the person, standard deviations: those who sit or bend."""


def prior_errors(noise: float, sizes: int = 1) -> LastingError:
    """Errors of some sizes before the recording: all of a row's error lasts, of the standard deviation `noise`."""
    one = np.ones(sizes)
    return LastingError(0.0 * one, noise**2 * one, _PRIOR_TIME * one)


@dataclass(frozen=True)
class SizeModel:
    """Statistics of each size; all float64 (size,)."""

    mean: Floats
    """Mean of the population."""
    variance: Floats
    row_variance: Floats
    """Variance of the error of one row, and that with which each of many rows counts as independent of the others."""
    spread: Floats
    """Variance among people; 0 where the size says nothing."""
    most_against: Floats
    """Greatest evidence of one independent look for a new person instead of a known one, nats: it may be an outlier."""

    @classmethod
    def joined(cls, parts: Sequence[SizeModel]) -> SizeModel:
        """The sizes of all parts, one after the other."""
        names = ("mean", "variance", "row_variance", "spread", "most_against")
        return cls(*(np.concatenate([np.zeros(0), *(getattr(part, name) for part in parts)]) for name in names))

    def evidence(self, sizes: Sequence[Floats], rows: Ints | slice = slice(None)) -> tuple[Floats, Floats]:
        """Precision of each measured size of some rows, and precision times deviation, float64 (row, size) each.

        `sizes` are float64 (n,) each. Both are 0 where a size is unmeasured or too far.
        """
        number = len(sizes[0][rows])
        precision, information = np.zeros((number, len(sizes))), np.zeros((number, len(sizes)))
        for k, farthest in enumerate(_FARTHEST * np.sqrt(self.variance + self.spread)):
            deviation = sizes[k][rows] - self.mean[k]
            measured = np.flatnonzero(np.abs(deviation) < farthest)  # nan is not
            precision[measured, k] = 1.0 / self.row_variance[k]
            information[measured, k] = deviation[measured] * precision[measured, k]
        return precision, information


def learn_heights(
    height: Floats, frame: Ints, tracklets: Sequence[Ints], frame_rate: float, config: Config
) -> SizeModel:
    """Statistics of heights, metres, nan where unmeasured: `height` float64 (n,) and `frame` int64 (n,) of each row.

    `tracklets` are rows of each isolated tracklet, in the order of time, `frame_rate` is in frames per second.
    """
    measured = measured_tracklets(height, tracklets)
    mean = float(np.mean(height[np.concatenate(measured)])) if measured else 0.0
    errors = constant_errors(height[None], frame, measured, prior_errors(config.tracking.height_noise), frame_rate)
    row_variance = errors.row_variance(frame_rate) + _POSTURE.row_variance(frame_rate)
    spread = _spread(height - mean, measured, config.body.height_spread)
    return SizeModel(np.array([mean]), errors.variance, row_variance, np.array([spread]), np.full(1, np.inf))


def evidence(precision: Floats, information: Floats, spread: Floats) -> Floats:
    """Log-likelihood ratio of sums of one person against the population's mean, over the last axis, nats."""
    total = 1.0 + precision * spread
    return np.asarray((0.5 * (spread * information**2 / total - np.log(total))).sum(axis=-1))


def measured_tracklets(size: Floats, tracklets: Sequence[Ints]) -> list[Ints]:
    """Rows with a size (n,) of each tracklet that has enough of them."""
    measured = [rows[np.isfinite(size[rows])] for rows in tracklets]
    return [rows for rows in measured if len(rows) >= _LEAST_FRAMES]


def _spread(deviation: Floats, tracklets: Sequence[Ints], prior_spread: float) -> float:
    """Variance among people: the covariance of the first and the last third of each tracklet.

    Errors of the two are independent unless they last as long, so no noise has to be subtracted.
    """
    thirds = [(rows, max(len(rows) // 3, 1)) for rows in tracklets]
    total = sum(float(deviation[rows[:third]].mean() * deviation[rows[-third:]].mean()) for rows, third in thirds)
    return max((total + _PRIOR_PEOPLE * prior_spread**2) / (len(tracklets) + _PRIOR_PEOPLE), 0.0)
