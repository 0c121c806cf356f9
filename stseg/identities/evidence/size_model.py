"""Noise and spread of people's sizes, learned from isolated tracklets (docs/how-it-works.md, Tracks).

A measured size is x = mean + person + error. The error of a frame has a variance and lasts for some time; the person's
part has the variance `spread` among people. A size of spread 0 says nothing of identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import Config

_LONGEST = 1.5
"""Longest lag at which errors of one tracklet are compared, seconds."""
_LEAST_FRAMES = 4
"""Least measured frames of a tracklet that is learned from."""
_PRIOR_FRAMES, _PRIOR_PEOPLE = 50.0, 4.0
"""Weight of the prior: differences of frames for the noise, pairs of tracklets for the spread."""
_PRIOR_LASTING = 0.5
"""Prior duration of an error, seconds."""


@dataclass(frozen=True)
class SizePrior:
    """Errors and spread of a size before the recording.

    Attributes
    ----------
    noise, spread
        Standard deviations of a frame's error, and among people.
    """

    noise: float
    spread: float


@dataclass(frozen=True)
class MeasuredSizes:
    """Sizes of the person in each row of a trajectory.

    Attributes
    ----------
    value : float64 (n, size)
        Nan where unmeasured.
    priors
        One for each size.
    """

    value: Floats
    priors: list[SizePrior]

    @classmethod
    def of_heights(cls, height: Floats, config: Config) -> MeasuredSizes:
        """Heights (n,) alone, metres."""
        prior = SizePrior(config.tracking.height_noise, config.body.height_spread)
        return cls(np.asarray(height, float)[:, None], [prior])

    def with_unmeasured(self, number: int) -> MeasuredSizes:
        """The sizes with some rows more, of which nothing is known."""
        return MeasuredSizes(np.pad(self.value, ((0, number), (0, 0)), constant_values=np.nan), self.priors)


@dataclass(frozen=True)
class SizeModel:
    """Statistics of each size; all float64 (size,).

    Attributes
    ----------
    mean
        Of the population.
    noise
        Variance of a frame's error.
    lasting
        Correlation time of the errors, seconds.
    spread
        Variance among people; 0 where the size says nothing.
    most_against
        Greatest evidence of one independent look for a new person instead of a known one, nats: it may be an outlier.
    """

    mean: Floats
    noise: Floats
    lasting: Floats
    spread: Floats
    most_against: Floats

    @classmethod
    def joined(cls, parts: Sequence[SizeModel]) -> SizeModel:
        """The sizes of all parts, one after the other."""
        names = ("mean", "noise", "lasting", "spread", "most_against")
        return cls(*(np.concatenate([np.zeros(0), *(getattr(part, name) for part in parts)]) for name in names))

    def evidence(self, sizes: Floats, frame_rate: float) -> tuple[Floats, Floats]:
        """Precision of each measured size (n, size), and precision times deviation; 0 where unmeasured.

        Errors that last are shared among the frames for which they last.
        """
        measured = np.isfinite(sizes)
        precision = np.where(measured, 1.0 / (self.noise * np.maximum(self.lasting * frame_rate, 1.0)), 0.0)
        return precision, np.where(measured, sizes - self.mean, 0.0) * precision


def learn_sizes(sizes: MeasuredSizes, frame: Ints, tracklets: Sequence[Ints], frame_rate: float) -> SizeModel:
    """Statistics of the sizes of a recording.

    Parameters
    ----------
    sizes
        Of each row.
    frame : int64 (n,)
        Frame of each row.
    tracklets
        Rows of each isolated tracklet, in the order of time.
    frame_rate
        Frames per second.
    """
    columns = zip(sizes.value.T, sizes.priors, strict=True)
    learned = [_learn(column, frame, tracklets, prior, frame_rate) for column, prior in columns]
    mean, noise, lasting, spread = np.array(learned, np.float64).reshape(-1, 4).T
    return SizeModel(mean, noise, lasting, spread, np.full(len(learned), np.inf))


def evidence(precision: Floats, information: Floats, spread: Floats) -> Floats:
    """Log-likelihood ratio of sums of one person against the population's mean, over the last axis, nats."""
    total = 1.0 + precision * spread
    return np.asarray((0.5 * (spread * information**2 / total - np.log(total))).sum(axis=-1))


def measured_tracklets(size: Floats, tracklets: Sequence[Ints]) -> list[Ints]:
    """Rows with a size (n,) of each tracklet that has enough of them."""
    measured = [rows[np.isfinite(size[rows])] for rows in tracklets]
    return [rows for rows in measured if len(rows) >= _LEAST_FRAMES]


def frame_errors(
    sizes: Floats, frame: Ints, tracklets: Sequence[Ints], prior: SizePrior, frame_rate: float
) -> tuple[Floats, Floats]:
    """Variance and correlation time of a frame's error, from half squared differences at growing lags.

    Parameters
    ----------
    sizes : float64 (size, n)
        Of each row; all sizes are measured in the same rows.
    frame : int64 (n,)
        Frame of each row.
    tracklets
        Measured rows of each isolated tracklet, in the order of time.
    prior
        What is known of the error before the recording.
    frame_rate
        Frames per second.

    Returns
    -------
    noise, lasting : float64 (size,)
        The variance, and the correlation time in seconds.
    """
    lags = np.arange(1, max(round(_LONGEST * frame_rate), 1) + 1)
    total, count = np.zeros((len(sizes), len(lags))), np.zeros(len(lags))
    for rows in tracklets:
        frames, value = frame[rows], sizes[:, rows]
        if frames[-1] - frames[0] == len(frames) - 1:  # in every frame: most are
            number = np.maximum(len(frames) - lags, 0)
            pairs = [(value[:, lag:], value[:, :-lag]) for lag in lags[number > 0].tolist()]
        else:
            after = np.searchsorted(frames, frames + lags[:, None]).clip(max=len(rows) - 1)
            paired = frames[after] - frames == lags[:, None]
            number = paired.sum(axis=1)
            pairs = [(value[:, later[which]], value[:, which]) for later, which in zip(after, paired, strict=True)]
        for k, (later, earlier) in enumerate(pairs):
            total[:, k] += 0.5 * ((later - earlier) ** 2).sum(axis=1)
        count += number
    expected = prior.noise**2 * (1.0 - np.exp(-lags / frame_rate / _PRIOR_LASTING))
    differences = (total + _PRIOR_FRAMES * expected) / (count + _PRIOR_FRAMES)
    noise = differences.max(axis=1)
    alike = np.clip(1.0 - differences / noise[:, None], 0.0, 1.0)
    return noise, (1.0 + 2.0 * alike.sum(axis=1)) / frame_rate


def _learn(
    size: Floats, frame: Ints, tracklets: Sequence[Ints], prior: SizePrior, frame_rate: float
) -> tuple[float, float, float, float]:
    measured = measured_tracklets(size, tracklets)
    mean = float(np.mean(size[np.concatenate(measured)])) if measured else 0.0
    noise, lasting = (float(one[0]) for one in frame_errors(size[None], frame, measured, prior, frame_rate))
    return mean, noise, lasting, _spread(size - mean, measured, prior)


def _spread(deviation: Floats, tracklets: Sequence[Ints], prior: SizePrior) -> float:
    """Variance among people: the covariance of the first and the last third of each tracklet.

    Errors of the two are independent unless they last as long, so no noise has to be subtracted.
    """
    total = people = 0.0
    for rows in tracklets:
        third = max(len(rows) // 3, 1)
        total += float(deviation[rows[:third]].mean() * deviation[rows[-third:]].mean())
        people += 1.0
    return max((total + _PRIOR_PEOPLE * prior.spread**2) / (people + _PRIOR_PEOPLE), 0.0)
