"""Appearance as evidence of identity: how much features and colours tell is learned from the recording.

A row's appearance is the mean over the views that see its person apart, less each camera's offset (a gain, where the
numbers are logarithms of colours). It is whitened by its scatter within people and turned to the axes along which
people differ most: probabilistic linear discriminant analysis (Ioffe 2006). Each axis is then one more size of the
person (`stseg.tracking.identities.size_model`). It is learned twice: first from isolated tracklets, each a person of
its own, then from the identities that are found with it, for looks outlast tracklets. Where identities err, the
appearance of people seems to change, and weighs less.

Appearance lasts: a turned back stays turned for seconds, a place in the light for longer. So frames are not
independent, and how many of them make one independent observation is learned where it matters. Axes are learned from
one half of each person's time; then each tracklet of the other half is compared with the person's first half, and with
those of the people who are there at the same time. Under the true number of frames an observation the log-likelihood
ratios of these pairs are most probable (Bruemmer and du Preez 2006); it is no less than differences within tracklets
say. Where none is better than chance, appearance says nothing and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows, Singles
from stseg.tracking.identities.size_model import SizeModel, SizePrior, frame_errors, measured_tracklets

_AXES = 4
"""Most axes."""
_LEAST_FRAMES = 8
"""Least frames of half a person's time."""
_LEAST_PROBE = 4
"""Least frames of a tracklet that is compared."""
_LEAST_PEOPLE, _MOST_PEOPLE = 3, 1000
"""Least and most people."""
_TOGETHER = 50
"""People who come one after the other, of whom all are taken or none: tracklets are compared with who is there."""
_PRIOR = 0.1
"""Weight of the whole scatter in that within people: no axis is free of noise."""
_LASTING = 2.0 ** np.arange(0, 13)
"""Numbers of frames that make one independent observation, of which one is chosen."""
_UNIT = SizePrior(1.0, 1.0)
"""Of an axis of unit noise."""
_WRONG = 0.1
"""Share of wrong answers: identities are exchanged, and tracks slip from one person to another."""
_LEAST_GAIN = 0.05
"""Least gain of a pair's mean log-probability that is no chance, nats."""


@dataclass(frozen=True)
class LearnedAppearance:
    """Appearance along a few axes.

    Attributes
    ----------
    value : float64 (n, axis)
        Of each row, nan where unknown.
    model
        Statistics of each axis.
    colours
        The last of the axes: those of colours; None where colours say nothing.
    """

    value: Floats
    model: SizeModel
    colours: Axes | None = None

    @classmethod
    def nothing(cls, rows: int) -> LearnedAppearance:
        """Appearance that says nothing of some rows."""
        return cls(np.zeros((rows, 0)), SizeModel.joined([]))


@dataclass(frozen=True)
class Axes:
    """mean (k,), axis (k, d) of unit noise, and the spread among people along each, (d,)."""

    mean: Floats
    axis: Floats
    spread: Floats

    def of(self, value: Floats) -> Floats:
        """Appearance along the axes."""
        return np.asarray((value - self.mean) @ self.axis)


def learn_appearance(
    trajectory: Rows, appearance: Rows, tracklets: Sequence[Ints], person: Ints, frame_rate: float
) -> LearnedAppearance:
    """Learn how much the appearance of a recording's people tells of identity.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
    appearance : APPEARANCE (l,)
    tracklets
        Rows of each isolated tracklet, in the order of time.
    person : int64 (n,)
        Who each row is thought to be; some may be wrong.
    frame_rate
        Frames per second.
    """
    found = []
    for name in ("features", "colours"):
        value = row_means(trajectory, appearance, name)
        halves = _halves(trajectory["frame"], person, np.isfinite(value[:, 0]))
        found.append(_learned(value, trajectory["frame"], tracklets, person, halves, frame_rate))
    value = np.concatenate([one.value for one in found], axis=1)
    return LearnedAppearance(value, SizeModel.joined([one.model for one in found]), found[-1].colours)


def row_means(trajectory: Rows, appearance: Rows, name: str) -> Floats:
    """Mean over views of each row's appearance, less the cameras' offsets, float64 (n, k); nan where unknown."""
    known = appearance[np.isfinite(appearance[name]).all(axis=1)]
    value, view = known[name].astype(np.float64), known["view"].astype(np.int64)
    detection, number, row = _rows_of(trajectory, known)
    mean = np.full((len(trajectory), value.shape[1]), np.nan)
    if len(value):
        value = value - _offsets(value, view, detection)[view]
        total = np.stack([np.bincount(detection, own, len(number)) for own in value.T], axis=1)
        mean[row[row >= 0]] = (total / number[:, None])[row >= 0]
    return mean


def _rows_of(trajectory: Rows, known: Rows) -> tuple[Ints, Ints, Ints]:
    """Detection of each appearance row, appearance rows of each detection, trajectory row of each, -1 for none."""
    key = [("frame", "<i8"), ("x", "<f8"), ("y", "<f8")]
    seen = np.zeros(len(known), key)
    placed = np.zeros(len(trajectory), key)
    for name, raw in (("frame", "frame"), ("x", "raw_x"), ("y", "raw_y")):
        seen[name], placed[name] = known[name], trajectory[raw]
    detections, detection, number = np.unique(seen, return_inverse=True, return_counts=True)
    order = np.argsort(placed, kind="stable")
    at = np.searchsorted(placed[order], detections).clip(max=max(len(placed) - 1, 0))
    row = np.where(placed[order][at] == detections, order[at], -1) if len(placed) else np.full(len(detections), -1)
    return detection.reshape(-1), number, row


def _offsets(value: Floats, view: Ints, detection: Ints) -> Floats:
    """Offset of each camera (view, k), least squares over people that several cameras see at once; their sum is 0."""
    views = int(view.max()) + 1
    inside = np.zeros((int(detection.max()) + 1, views))
    inside[detection, view] = 1.0
    number = inside.sum(axis=1)
    normal = np.diag(inside.sum(axis=0)) - (inside / number[:, None]).T @ inside
    mean = np.stack([np.bincount(detection, own) for own in value.T], axis=1) / number[:, None]
    right = np.stack([np.bincount(view, own, views) for own in (value - mean[detection]).T], axis=1)
    return np.asarray(np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ right)


def _halves(frame: Ints, person: Ints, known: Flags) -> list[tuple[Ints, Ints]]:
    """Rows of the first and the second half of the time of each person who has enough of both.

    Of more than `_MOST_PEOPLE`, who come one after the other are taken together, and the next left out.
    """
    rows = np.flatnonzero(known)
    rows = rows[np.lexsort((frame[rows], person[rows]))]
    people = np.split(rows, np.flatnonzero(np.diff(person[rows])) + 1)
    long = [own for own in people if len(own) // 2 >= _LEAST_FRAMES]
    long.sort(key=lambda own: (int(frame[own[0]]), int(person[own[0]])))
    share = -(-len(long) // _MOST_PEOPLE)
    kept = [own for k, own in enumerate(long) if k // _TOGETHER % share == 0]
    return [(own[: len(own) // 2], own[len(own) // 2 :]) for own in kept]


def _learned(
    value: Floats, frame: Ints, tracklets: Sequence[Ints], person: Ints, halves: Sequence[tuple[Ints, Ints]],
    frame_rate: float,
) -> LearnedAppearance:  # fmt: skip
    nothing = LearnedAppearance.nothing(len(value))
    if len(halves) < _LEAST_PEOPLE:
        return nothing
    lasting = _lasting(value, frame, tracklets, person, halves)
    if not np.isfinite(lasting):
        return nothing
    # Halves count as people of their own: who was exchanged between them must not seem to vary.
    axes = _discriminant_axes(value, [rows for half in halves for rows in half])
    number, along = len(axes.spread), axes.of(value)
    # Where all pairs are far apart, they do not say how long errors last, but differences within tracklets do.
    known = measured_tracklets(value[:, 0], tracklets)
    errors = [frame_errors(one, frame, known, _UNIT, frame_rate) for one in along.T]
    seconds = np.array([max(lasting / frame_rate, noise * alike) for noise, alike in errors])
    # An observation may be of a person in front: under a share of such errors none says more than this against one.
    most_against = np.full(number, -np.log(_WRONG) / max(number, 1))
    model = SizeModel(np.zeros(number), np.ones(number), seconds, axes.spread, most_against)
    return LearnedAppearance(along, model, axes)


def _discriminant_axes(value: Floats, people: Sequence[Ints]) -> Axes:
    """Axes of the greatest spread among people (rows of each, in the order of time) beside the scatter within them."""
    every = value[np.concatenate(people)]
    mean, size = every.mean(axis=0), value.shape[1]
    within, between = np.zeros((size, size)), np.zeros((size, size))
    for rows in people:
        centred = value[rows] - value[rows].mean(axis=0)
        within += centred.T @ centred / len(every)
        # Errors of the two halves are nearly independent, so no noise has to be subtracted.
        early, late = (part.mean(axis=0) - mean for part in np.array_split(value[rows], 2))
        between += (np.outer(early, late) + np.outer(late, early)) / 2 / len(people)
    whole = (every - mean).T @ (every - mean) / len(every)
    within = (1 - _PRIOR) * within + _PRIOR * whole + 1e-9 * max(np.trace(whole), 1e-9) * np.eye(size)
    root = np.linalg.cholesky(np.linalg.inv(within))
    spread, turn = np.linalg.eigh(root.T @ between @ root)
    chosen = np.argsort(-spread, kind="stable")[:_AXES]
    chosen = chosen[spread[chosen] > 0]
    return Axes(mean, root @ turn[:, chosen], spread[chosen])


def _lasting(
    value: Floats, frame: Ints, tracklets: Sequence[Ints], person: Ints, halves: Sequence[tuple[Ints, Ints]]
) -> float:
    """Frames of one independent observation: with this number the pairs of a person and a tracklet are most probable.

    Infinite where no number is better than chance.
    """
    cost = np.zeros(len(_LASTING))
    for side in range(2):
        known = [half[side] for half in halves]
        axes = _discriminant_axes(value, known)
        probes, same = _probes(frame, tracklets, person, [half[1 - side] for half in halves])
        evidence = _Pairs.of(axes, value, known, probes)
        cost += [_cost(evidence.ratio(lasting), same) / 2 for lasting in _LASTING.tolist()]
    best = int(np.argmin(cost))
    return float(_LASTING[best]) if cost[best] < np.log(2.0) - _LEAST_GAIN else np.inf


def _probes(frame: Ints, tracklets: Sequence[Ints], person: Ints, people: Sequence[Ints]) -> tuple[list[Ints], Singles]:
    """Parts of tracklets that belong to one person's rows, and of each and every person: 1 same, -1 other, 0 unknown.

    Others are those who are there at the same time.
    """
    owner = np.full(len(person), -1)
    for k, rows in enumerate(people):
        owner[rows] = k
    probes, same = [], []
    for rows in tracklets:
        mine = rows[owner[rows] >= 0]
        for k in np.unique(owner[mine]).tolist():
            own = mine[owner[mine] == k]
            if len(own) >= _LEAST_PROBE:
                there = np.unique(owner[np.isin(frame, frame[own])])
                answer = np.zeros(len(people), np.float32)
                answer[there[there >= 0]] = -1.0
                answer[k] = 1.0
                probes.append(own)
                same.append(answer)
    return probes, np.array(same, np.float32).reshape(-1, len(people))


@dataclass(frozen=True)
class _Pairs:
    """Sums over the rows of people (person, d) and of probes (probe, d), their numbers, and the spread of the axes."""

    person: Floats
    person_rows: Floats
    probe: Floats
    probe_rows: Floats
    spread: Floats

    @classmethod
    def of(cls, axes: Axes, value: Floats, people: Sequence[Ints], probes: Sequence[Ints]) -> _Pairs:
        """Of rows of each person and probe."""
        y, size = axes.of(value), len(axes.spread)
        sums = [np.array([y[rows].sum(axis=0) for rows in part]).reshape(-1, size) for part in (people, probes)]
        numbers = [np.array([len(rows) for rows in part], float)[:, None] for part in (people, probes)]
        return cls(sums[0], numbers[0], sums[1], numbers[1], axes.spread)

    def ratio(self, lasting: float) -> Floats:
        """Log-likelihood ratio of one person against two for each probe and person (probe, person), nats."""
        number, total = self.probe_rows[:, None] + self.person_rows, self.probe[:, None] + self.person
        both = _marginal(number / lasting, total / lasting, self.spread)
        one = _marginal(self.probe_rows / lasting, self.probe / lasting, self.spread)
        return np.asarray(
            both - one[:, None] - _marginal(self.person_rows / lasting, self.person / lasting, self.spread)
        )


def _marginal(precision: Floats, information: Floats, spread: Floats) -> Floats:
    """Log-likelihood ratio of observations of one person against the population's mean, nats, over the last axis."""
    total = 1.0 + precision * spread
    return np.asarray((0.5 * (spread * information**2 / total - np.log(total))).sum(axis=-1))


def _cost(evidence: Floats, same: Singles) -> float:
    """Mean cross-entropy of pairs that are one person and of pairs that are two, nats; ln 2 for no evidence."""
    one, two = evidence[same > 0], evidence[same < 0]
    if not len(one) or not len(two):
        return float(np.log(2.0))
    return float(-(_log_probability(one).mean() + _log_probability(-two).mean()) / 2)


def _log_probability(evidence: Floats) -> Floats:
    """Log-probability of an answer of which some are wrong: single wrong ones do not count without bound."""
    right = 1.0 / (1.0 + np.exp(-np.clip(evidence, -50.0, 50.0)))
    return np.asarray(np.log(_WRONG + (1.0 - 2.0 * _WRONG) * right))
