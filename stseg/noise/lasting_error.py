"""Errors that last: how much of an error is new in each frame, how much lasts, and for how long.

Places, sizes and appearance of a person err by

    cov(e_s, e_t) = a^2 [s = t] + b^2 exp(-|s - t| / tau)

with a the noise of a frame, and b what lasts for tau: gait, pose, the views that see the person. So n rows in a row
hold less than n rows' information: over a long time the mean of n has the variance

    (a^2 + b^2 (1 + r) / (1 - r)) / n,    r = exp(-1 / (tau rate)).

Of what is constant for a person they are found from n differences over each lag of m frames that the recording bears:

    a^2 + b^2 (1 - r^m) = 1/2 (mean of sqrt |difference|)^4 / (0.457 + 0.494 / n),

a variogram that few outliers hardly change (Cressie and Hawkins 1980, eq 10): a person who sits down is no error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints

_TIMES = np.geomspace(0.1, 25.6, 17)
"""Time constants that are tried, seconds."""
_LONGEST = 15.0
"""Longest lag, seconds."""
_LEAST_DIFFERENCES = 20
"""Least number of differences over a lag."""
_PRIOR_DIFFERENCES = 50.0
"""Weight of the prior: differences over each lag."""
_TIME_SPREAD = 1.2
"""Spread of the logarithm of time constants about that of the prior."""
_SHARE_VARIANCE = 2.9
"""Variance of the variogram at n differences, in shares of its square over n (of Gaussian errors)."""


@dataclass(frozen=True)
class LastingError:
    """Errors of some quantities, all float64 (quantity,); of one alone, ()."""

    white: Floats
    lasting: Floats
    """a^2 and b^2, in the square of the quantity's unit."""
    seconds: Floats
    """tau."""

    @property
    def variance(self) -> Floats:
        """Variance of the error of one row."""
        return np.asarray(self.white + self.lasting)

    def row_variance(self, frame_rate: float) -> Floats:
        """Variance of a row that counts as independent of the rows of the frames around it."""
        kept = np.exp(-1.0 / (self.seconds * frame_rate))
        return np.asarray(self.white + self.lasting * (1.0 + kept) / (1.0 - kept))


PLACE_ERROR = LastingError(np.array(0.2), np.array(0.8), np.array(1.0))
"""The error of a place in shares of its covariance: pose, gait and the views that see a person last for a second.

A recording without truth does not show how long: a place that errs slowly looks like one that moves.
"""


def constant_errors(
    values: Floats, frame: Ints, tracklets: Sequence[Ints], prior: LastingError, rate: float
) -> LastingError:
    """Errors of quantities that are constant for each person.

    Parameters
    ----------
    values : float64 (quantity, n)
        Of each row; all are measured in the same rows.
    frame : int64 (n,)
        Frame of each row.
    tracklets
        Measured rows of each isolated tracklet, in the order of time.
    prior
        The errors before the recording.
    rate
        Frames per second.
    """
    lags = _lags(frame, tracklets, rate)
    roots, count = np.zeros((len(values), len(lags))), np.zeros(len(lags))
    rows, length = np.concatenate([frame[:0], *tracklets]), [len(one) for one in tracklets]
    span = frame.max(initial=0) + lags[-1] + 1  # of a tracklet, so none has a lag to another
    time = frame[rows] + span * np.repeat(np.arange(len(tracklets)), length)
    for k, lag in enumerate(lags.tolist()):
        after = np.searchsorted(time, time + lag)
        earlier = np.flatnonzero(np.append(time, -1)[after] == time + lag)
        roots[:, k] = np.sqrt(np.abs(values[:, rows[after[earlier]]] - values[:, rows[earlier]])).sum(1)
        count[k] = len(earlier)
    number = np.maximum(count, 1.0)
    variogram = 0.5 * (roots / number) ** 4 / (0.457 + 0.494 / number)
    return _fitted(variogram, count, lags, prior, rate)


def _lags(frame: Ints, tracklets: Sequence[Ints], rate: float) -> Ints:
    """Growing lags up to the longest that some tracklets bear, frames."""
    longest = max((int(frame[rows[-1]] - frame[rows[0]]) for rows in tracklets), default=1)
    most = max(min(longest // 2, round(_LONGEST * rate)), 1)
    return np.unique(np.rint(np.geomspace(1, most, 24)).astype(np.int64))


def _fitted(variogram: Floats, count: Floats, lags: Ints, prior: LastingError, rate: float) -> LastingError:
    """Errors by the variogram (quantity, lag), the numbers of differences (lag,), and the lags (lag,), frames.

    Differences that overlap are alike: those over m frames say as much as an m-th of their number.
    """
    enough = count >= _LEAST_DIFFERENCES
    enough[0] = True
    variogram, count, lags = variogram[:, enough], count[enough], lags[enough]
    seconds = lags / rate
    of_prior = 1.0 - np.exp(-seconds / prior.seconds[:, None])
    expected = prior.white[:, None] + prior.lasting[:, None] * of_prior
    measured = (count * variogram + _PRIOR_DIFFERENCES * expected) / (count + _PRIOR_DIFFERENCES)
    shapes = 1.0 - np.exp(-seconds / _TIMES[:, None])
    unlike = _SHARE_VARIANCE * (np.log(_TIMES / prior.seconds[:, None]) / _TIME_SPREAD) ** 2
    weight = (count + _PRIOR_DIFFERENCES) / lags
    found = [_fit(value, weight, shapes, cost) for value, cost in zip(measured, unlike, strict=True)]
    return LastingError(*np.array(found, np.float64).reshape(-1, 3).T)


def _fit(measured: Floats, number: Floats, shapes: Floats, cost: Floats) -> tuple[float, float, float]:
    """a^2, b^2 and tau of least squares to a variogram (lag,), whose errors are in proportion to itself.

    `shapes` (tau, lag) is 1 - r^m, `cost` (tau,) what each tau costs beside the squared residuals;
    `number` (lag,) are independent differences of each lag.
    """
    from scipy.optimize import nnls  # a start that fits nothing is faster without it

    weight = np.sqrt(number) / np.maximum(measured, 1e-12)
    fits = [nnls(np.column_stack([weight, weight * shape]), weight * measured) for shape in shapes]
    best = int(np.argmin(cost + [residual**2 for _, residual in fits]))
    white, lasting = fits[best][0].tolist()
    return white, lasting, float(_TIMES[best])
