"""Alignment of two views by rotation, shift and delay of their people's places.

Identities and clock offsets are unknown: at every delay two people of one view are tried as two of the other, and the
best hypotheses are verified on all people and frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from stseg.arrays import Complexes, Floats, Ints

_GATE = 0.7
"""Agreement gate, metres."""
_BASELINE = 1.0
"""Least distance of the two points of a two-point hypothesis, metres."""
_HYPOTHESES = 40
"""Number of hypotheses that are verified."""
_SAMPLES, _SCORED_PAIRS = 1500, 300
"""Two-point samples at each delay, and point pairs in their first scoring."""
_ROUNDS = 4
_MAX_ALIGNMENTS = 5


@dataclass(frozen=True)
class ViewPlaces:
    """Ground points of one view's people, on a ground of its own."""

    frame: Ints
    """int64 (n,): frame of the stream."""
    place: Complexes
    """complex128 (n,): ground point x + iy, metres."""


@dataclass(frozen=True)
class Alignment:
    """Similarity and delay between two views: b(t + delay) = factor a(t) + shift."""

    delay: int
    """Frames."""
    factor: complex
    shift: complex
    """Complex: rotation and scale, and metres."""
    support: float
    """Number of agreeing people and frames, weighted by closeness."""

    @property
    def inverse(self) -> Alignment:
        """The alignment from b to a."""
        return Alignment(-self.delay, 1 / self.factor, -self.shift / self.factor, self.support)

    def then(self, after: Alignment) -> Alignment:
        """Composition: from a by b to c."""
        shift = after.factor * self.shift + after.shift
        return Alignment(self.delay + after.delay, after.factor * self.factor, shift, after.support)


IDENTITY = Alignment(0, 1 + 0j, 0j, 0.0)
"""Identity."""


def align(a: ViewPlaces, b: ViewPlaces, frame_rate: float, most_delay: int) -> list[Alignment]:
    """The few best supported alignments of two views by at most so many frames of delay, the best first."""
    tried = _hypotheses(a, b, frame_rate, most_delay)
    judged = sorted((_refined(a, b, one) for one in tried), key=lambda one: -one.support)
    best: list[Alignment] = []
    for one in judged:
        if all(_differ(one, other, frame_rate) for other in best):
            best.append(_at_best_delay(a, b, one, most_delay))
        if len(best) == _MAX_ALIGNMENTS:
            break
    return sorted(best, key=lambda one: -one.support)


def mirrored(places: ViewPlaces) -> ViewPlaces:
    """The places mirrored."""
    return ViewPlaces(places.frame, np.conj(places.place))


def _differ(one: Alignment, other: Alignment, frame_rate: float) -> bool:
    """Whether two alignments differ by more than refinement would."""
    turned = abs(np.angle(one.factor / other.factor)) > 0.3
    return bool(turned or abs(one.delay - other.delay) > frame_rate or abs(one.shift - other.shift) > 1.5)


def _hypotheses(a: ViewPlaces, b: ViewPlaces, frame_rate: float, most_delay: int) -> list[Alignment]:
    """Hypotheses from two point pairs, each at a time of its own, the best supported first.

    Delays are tried in steps of 0.3 s, within which no person leaves the gate.
    """
    step = max(1, round(0.3 * frame_rate))
    rng = np.random.default_rng(0)
    found: list[Alignment] = []
    for delay in range(-(most_delay // step) * step, most_delay + 1, step):
        found += _at_delay(a, b, delay, rng)
    return sorted(found, key=lambda one: -one.support)[:_HYPOTHESES]


def _at_delay(a: ViewPlaces, b: ViewPlaces, delay: int, rng: np.random.Generator) -> list[Alignment]:
    of_a, of_b = _same_time(a, b, delay)
    finite = np.isfinite(a.place[of_a]) & np.isfinite(b.place[of_b])
    x, y = a.place[of_a[finite]], b.place[of_b[finite]]
    if len(x) < 4:
        return []
    one, other = rng.integers(0, len(x), (2, 20 * _SAMPLES))
    far_x, far_y = np.abs(x[one] - x[other]), np.abs(y[one] - y[other])
    distant = (far_x > _BASELINE) & (np.abs(far_x - far_y) < _GATE / 2)
    one, other = one[distant][:_SAMPLES], other[distant][:_SAMPLES]
    factor = (y[one] - y[other]) / (x[one] - x[other])
    factor /= np.abs(factor)
    shift = (y[one] + y[other] - factor * (x[one] + x[other])) / 2
    sample = rng.permutation(len(x))[:_SCORED_PAIRS]
    away = np.abs(factor[:, None] * x[sample] + shift[:, None] - y[sample])
    support = np.maximum(0.0, 1 - (away / _GATE) ** 2).sum(axis=1) * len(x) / len(sample)
    best = np.argsort(-support)[:5]
    return [Alignment(delay, complex(factor[k]), complex(shift[k]), float(support[k])) for k in best]


def _refined(a: ViewPlaces, b: ViewPlaces, one: Alignment) -> Alignment:
    """Iteratively reweighted refinement from all agreeing pairs."""
    factor, shift = one.factor, one.shift
    rows = _same_time(a, b, one.delay)
    best = Alignment(one.delay, factor, shift, _agreement(a, b, rows, factor, shift)[0])
    for _ in range(_ROUNDS):
        _, weight = _agreement(a, b, rows, factor, shift)
        of_a, of_b, weight = rows[0][weight > 0], rows[1][weight > 0], weight[weight > 0]  # beyond the horizon is none
        x, y = a.place[of_a], b.place[of_b]
        if len(x) < 4 or np.ptp(a.frame[of_a]) < 2 or len(np.unique(x)) < 2:
            break
        mean_x, mean_y = (np.sum(weight * z) / weight.sum() for z in (x, y))
        factor = np.sum(weight * np.conj(x - mean_x) * (y - mean_y)) / np.sum(weight * np.abs(x - mean_x) ** 2)
        # Two views of people of one height have one scale, up to what a single view knows of its lens.
        factor *= np.clip(np.abs(factor), 0.7, 1.4) / np.abs(factor)
        shift = mean_y - factor * mean_x
        support, _ = _agreement(a, b, rows, factor, shift)
        if support > best.support:
            best = Alignment(one.delay, complex(factor), complex(shift), support)
    return best


def _at_best_delay(a: ViewPlaces, b: ViewPlaces, one: Alignment, most_delay: int) -> Alignment:
    """Local search over the delay."""
    best, step = one, 8
    while step:
        delays = [best.delay + off for off in (-step, step) if abs(best.delay + off) <= most_delay]
        refined = (_refined(a, b, replace(best, delay=delay)) for delay in delays)
        better = max(refined, key=attrgetter("support"), default=best)
        if better.support > best.support:
            best = better
        else:
            step //= 2
    return best


def support(a: ViewPlaces, b: ViewPlaces, one: Alignment) -> float:
    """Support of an alignment: number of agreeing people and frames, weighted by closeness."""
    return _agreement(a, b, _same_time(a, b, one.delay), one.factor, one.shift)[0]


def _same_time(a: ViewPlaces, b: ViewPlaces, delay: int) -> tuple[Ints, Ints]:
    """All pairs of rows of the two views in common frames."""
    begin = np.searchsorted(b.frame, a.frame + delay, "left")
    count = np.searchsorted(b.frame, a.frame + delay, "right") - begin
    of_a = np.repeat(np.arange(len(a.frame)), count)
    return of_a, np.repeat(begin - np.cumsum(count) + count, count) + np.arange(count.sum())


def _agreement(
    a: ViewPlaces, b: ViewPlaces, rows: tuple[Ints, Ints], factor: complex, shift: complex
) -> tuple[float, Floats]:
    """Support with each row counted once (mutual best matches), and the weight of each pair of rows."""
    away = np.abs(factor * a.place[rows[0]] + shift - b.place[rows[1]])
    close = np.maximum(0.0, 1 - (np.where(np.isfinite(away), away, np.inf) / _GATE) ** 2)
    best_a, best_b = np.zeros(len(a.frame)), np.zeros(len(b.frame))
    np.maximum.at(best_a, rows[0], close)
    np.maximum.at(best_b, rows[1], close)
    mutual = close * (close == best_a[rows[0]]) * (close == best_b[rows[1]])
    return float(mutual.sum()), mutual
