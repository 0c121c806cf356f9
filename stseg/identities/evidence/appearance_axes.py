"""Axes along which the appearance of people differs most, and the frames of one independent observation of a person.

A turned back stays turned for seconds, a place in the light for longer, so frames are not independent; how many of
them make one independent observation is learned where it matters. Axes are learned from one half of each person's
time; then each tracklet of the other half is compared with the person's first half, and with those of the people who
are there at the same time. Under the true number of frames an observation the log-likelihood ratios of these pairs are
most probable (Bruemmer and du Preez 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Flags, Floats, Ints
from stseg.identities.evidence.size_model import evidence

WRONG = 0.1
"""Share of wrong answers: identities are exchanged, and tracks slip from one person to another."""
_LEAST_PROBE = 4
"""Least frames of a tracklet that is compared."""
_FRAME_COUNTS = 2.0 ** np.arange(0, 13)
"""Numbers of frames that make one independent observation, of which one is chosen."""
_LEAST_GAIN = 0.05
"""Least gain of a pair's mean log-probability that is no chance, nats."""


def independent_frames(
    value: Floats, frame: Ints, tracklets: Sequence[Ints], halves: Sequence[tuple[Ints, Ints]]
) -> float:
    """Frames of one independent observation: with this number the pairs of a person and a tracklet are most probable.

    Infinite where no number is better than chance. `value` float64 (n, k) is the appearance and `frame` int64 (n,) the
    frame of each row. `tracklets` are rows of each isolated tracklet, in the order of time, `halves` those of the first
    and the second half of the time of each person.
    """
    cost = np.zeros(len(_FRAME_COUNTS))
    for side in range(2):
        references = [half[side] for half in halves]
        axes = discriminant_axes(value, references)
        probes = _Probes.of(frame, tracklets, [half[1 - side] for half in halves])
        pairs = _Pairs.of(axes, value, references, probes)
        cost += [_cost(pairs.ratio(lasting), probes.same) / 2 for lasting in _FRAME_COUNTS.tolist()]
    best = int(np.argmin(cost))
    return float(_FRAME_COUNTS[best]) if cost[best] < np.log(2.0) - _LEAST_GAIN else np.inf


@dataclass(frozen=True)
class _Probes:
    """Parts of tracklets, and of each the people who were there at its time: one is its own."""

    rows: list[Ints]
    """Rows of each part."""
    probe: Ints
    """int64 (pair,): the part."""
    person: Ints
    """int64 (pair,): one of the people."""
    same: Flags
    """bool (pair,): whether the person is the part's own."""

    @classmethod
    def of(cls, frame: Ints, tracklets: Sequence[Ints], people: Sequence[Ints]) -> _Probes:
        """Parts of each tracklet that belong to the rows of one person."""
        owner = np.full(len(frame), -1)
        for k, rows in enumerate(people):
            owner[rows] = k
        owned = np.flatnonzero(owner >= 0)
        owned = owned[np.argsort(frame[owned], kind="stable")]
        frames, owners = frame[owned], owner[owned]
        probes, present, same = list[Ints](), list[Ints](), list[Flags]()
        for rows in tracklets:
            mine = rows[owner[rows] >= 0]
            for k in np.unique(owner[mine]).tolist():
                of_person = mine[owner[mine] == k]
                if len(of_person) >= _LEAST_PROBE:
                    between = slice(*np.searchsorted(frames, (frame[of_person[0]], frame[of_person[-1]] + 1)))
                    probes.append(of_person)
                    present.append(np.unique(owners[between][np.isin(frames[between], frame[of_person])]))
                    same.append(present[-1] == k)
        probe = np.repeat(np.arange(len(probes)), np.array([len(one) for one in present], np.int64))
        return cls(probes, probe, _joined(present, np.int64), _joined(same, np.bool_))


def _joined(parts: Sequence[AnyArray], kind: type) -> AnyArray:
    return np.concatenate([np.zeros(0, kind), *parts])


@dataclass(frozen=True)
class _Pairs:
    """Sums over the rows of the person and of the probe of each pair (pair, d), their numbers, and the axes' spread."""

    person: Floats
    person_rows: Floats
    probe: Floats
    probe_rows: Floats
    spread: Floats

    @classmethod
    def of(cls, axes: Axes, value: Floats, people: Sequence[Ints], probes: _Probes) -> _Pairs:
        """Pairs by the rows of each person, and of each probe."""
        y, size = axes.of(value), len(axes.spread)
        parts = people, probes.rows
        sums = [np.array([y[rows].sum(axis=0) for rows in part]).reshape(len(part), size) for part in parts]
        numbers = [np.array([len(rows) for rows in part], float)[:, None] for part in parts]
        person, probe = probes.person, probes.probe
        return cls(sums[0][person], numbers[0][person], sums[1][probe], numbers[1][probe], axes.spread)

    def ratio(self, lasting: float) -> Floats:
        """Log-likelihood ratio of one person against two for each pair, nats."""
        both = evidence(
            (self.probe_rows + self.person_rows) / lasting, (self.probe + self.person) / lasting, self.spread
        )
        one = evidence(self.probe_rows / lasting, self.probe / lasting, self.spread)
        return np.asarray(both - one - evidence(self.person_rows / lasting, self.person / lasting, self.spread))


def _cost(ratio: Floats, same: Flags) -> float:
    """Mean cross-entropy of pairs that are one person and of pairs that are two, nats; ln 2 for no evidence."""
    one, two = ratio[same], ratio[~same]
    if not len(one) or not len(two):
        return float(np.log(2.0))
    return float(-(_log_probability(one).mean() + _log_probability(-two).mean()) / 2)


def _log_probability(ratio: Floats) -> Floats:
    """Log-probability of an answer of which some are wrong: single wrong ones do not count without bound."""
    right = 1.0 / (1.0 + np.exp(-np.clip(ratio, -50.0, 50.0)))
    return np.asarray(np.log(WRONG + (1.0 - 2.0 * WRONG) * right))


_AXIS_LIMIT = 4
"""Most axes."""
_TOTAL_SCATTER_WEIGHT = 0.1
"""Weight of the whole scatter in that within people: no axis is free of noise."""


@dataclass(frozen=True)
class Axes:
    """mean (k,), axis (k, d) of unit noise, and the spread among people along each, (d,)."""

    mean: Floats
    axis: Floats
    spread: Floats

    def of(self, value: Floats) -> Floats:
        """Appearance along the axes."""
        return np.asarray((value - self.mean) @ self.axis)


def discriminant_axes(value: Floats, people: Sequence[Ints]) -> Axes:
    """Axes of the greatest spread among people (rows of each, in the order of time) beside the scatter within them."""
    values = value[np.concatenate(people)]
    mean, size = values.mean(axis=0), value.shape[1]
    within, between = np.zeros((size, size)), np.zeros((size, size))
    for rows in people:
        centred = value[rows] - value[rows].mean(axis=0)
        within += centred.T @ centred / len(values)
        # Errors of the two halves are nearly independent, so no noise has to be subtracted.
        early, late = (part.mean(axis=0) - mean for part in np.array_split(value[rows], 2))
        between += (np.outer(early, late) + np.outer(late, early)) / 2 / len(people)
    whole = (values - mean).T @ (values - mean) / len(values)
    within = (1 - _TOTAL_SCATTER_WEIGHT) * within + _TOTAL_SCATTER_WEIGHT * whole
    within = within + 1e-9 * max(np.trace(whole), 1e-9) * np.eye(size)
    root = np.linalg.cholesky(np.linalg.inv(within))
    spread, turn = np.linalg.eigh(root.T @ between @ root)
    chosen = np.argsort(-spread, kind="stable")[:_AXIS_LIMIT]
    chosen = chosen[spread[chosen] > 0]
    return Axes(mean, root @ turn[:, chosen], spread[chosen])
