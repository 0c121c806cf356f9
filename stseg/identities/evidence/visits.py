"""What is kept of people who were there: sums of sizes and appearance over each visit, with their learned errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints


@dataclass(frozen=True)
class Visits:
    """Stays of people, each under an identity of its own.

    Attributes
    ----------
    identity : int64 (visit,)
        In the order of `first`.
    first, last : int64 (visit,)
        Frames.
    precision, information : float64 (visit, size)
        Inverse variance of the visit's mean of each size and axis of appearance, and that times the mean.
    lasting : float64 (size,)
        Variance of what lasts as long as a visit, which the precision counts.
    """

    identity: Ints
    first: Ints
    last: Ints
    precision: Floats
    information: Floats
    lasting: Floats

    def __len__(self) -> int:
        return len(self.identity)

    def after(self, identity: Ints, precision: Floats, information: Floats) -> Visits:
        """The visits after those of some people (person,) before the recording, by sums over these (person, size)."""
        shrink, before = 1.0 / (1.0 + precision * self.lasting), np.full(len(identity), -1)
        return Visits(
            np.concatenate([identity, self.identity]), np.concatenate([before, self.first]),
            np.concatenate([before, self.last]), np.concatenate([precision * shrink, self.precision]),
            np.concatenate([information * shrink, self.information]), self.lasting,
        )  # fmt: skip


def pooled_visits(identity: Ints, frame: Ints, precision: Floats, information: Floats) -> Visits:
    """The visits of identities.

    A visit's mean errs by the errors of its frames, and by what lasts as long as a visit: light and posture where the
    person happened to be. The variance of the latter is learned from the halves of every visit.

    Parameters
    ----------
    identity : int64 (n,)
        Of each row, 0 for none.
    frame : int64 (n,)
    precision, information : float64 (n, size)
        Of each row, see `stseg.identities.evidence.observations.Observations`.
    """
    order = np.lexsort((frame, identity))
    order = order[identity[order] > 0]
    own, start, count = np.unique(identity[order], return_index=True, return_counts=True)
    half = 2 * (np.arange(len(order)) - np.repeat(start, count)) >= np.repeat(count, count)
    key = 2 * np.repeat(np.arange(len(own)), count) + half
    weight, total = (_sums(part[order], key, len(own)) for part in (precision, information))
    lasting = lasting_variance(weight, total)
    shrink = 1.0 / (1.0 + weight.sum(axis=1) * lasting)
    first, last = frame[order[start]], frame[order[start + count - 1]]
    by_time = np.lexsort((own, first))
    return Visits(
        own[by_time], first[by_time], last[by_time], (weight.sum(axis=1) * shrink)[by_time],
        (total.sum(axis=1) * shrink)[by_time], lasting,
    )  # fmt: skip


def lasting_variance(precision: Floats, information: Floats) -> Floats:
    """Variance of errors that last half a visit, from sums over both halves of each (visit, 2, size); float64 (size,).

    The half of the squared difference of both means, less the errors that are known.
    """
    known = (precision > 0).all(axis=1)
    variance = 1.0 / np.where(precision > 0, precision, 1.0)
    mean = information * variance
    excess = np.where(known, ((mean[:, 0] - mean[:, 1]) ** 2 - variance.sum(axis=1)) / 2, 0.0)
    return np.asarray(np.maximum(excess.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0))


def _sums(value: Floats, half: Ints, number: int) -> Floats:
    """Sums over the rows (n, size) of each half (n,) of some visits, float64 (visit, 2, size)."""
    sums = np.zeros((2 * number, value.shape[1]))
    np.add.at(sums, half, value)
    return sums.reshape(number, 2, value.shape[1])
