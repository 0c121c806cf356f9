"""Two views of the same people: by which turn, shift and delay the paths in one become those in the other.

Who is who is not known and the clocks may differ: every path of one view is laid on every path of the other at every
delay (all delays at once, by correlation), and the best of them are judged by everybody at all times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Complexes, Floats, Ints

_LEAST_SECONDS, _LEAST_SPREAD = 1.5, 0.4
"""Of an overlap of two paths: its time, and the standard deviation of places in it, metres."""
_NOISE = 0.15
"""Metres by which places of one person differ between views at best."""
_GATE = 0.7
"""Metres within which two places may be of one person."""
_APART = 1.0
"""Metres between the two places of a hypothesis from two moments, at least."""
_PATHS_TRIED, _MOMENTS_TRIED = 60, 40
"""How many of the hypotheses of each kind are judged."""
_DRAWN, _ASKED = 1500, 300
"""Two moments drawn at each delay, and pairs of places by which each is judged at first."""
_ROUNDS = 4
_KEPT = 5


@dataclass(frozen=True)
class Walks:
    """The people of one view on a ground of its own.

    Attributes
    ----------
    frame : int64 (n,)
        The stream's own.
    place : complex128 (n,)
        x + iy, metres.
    path : int64 (n,)
        Who belongs together.
    """

    frame: Ints
    place: Complexes
    path: Ints


@dataclass(frozen=True)
class Alignment:
    """Where the people of view a are in view b: b(t + delay) = factor a(t) + shift.

    Attributes
    ----------
    delay
        Frames.
    factor, shift
        Complex: rotation and scale, and metres.
    support
        How many people and frames agree, in whole agreements.
    """

    delay: int
    factor: complex
    shift: complex
    support: float

    @property
    def inverse(self) -> Alignment:
        """From b to a."""
        return Alignment(-self.delay, 1 / self.factor, -self.shift / self.factor, self.support)

    def then(self, after: Alignment) -> Alignment:
        """From a by b to c."""
        shift = after.factor * self.shift + after.shift
        return Alignment(self.delay + after.delay, after.factor * self.factor, shift, after.support)


SAME = Alignment(0, 1 + 0j, 0j, 0.0)
"""Of a view with itself."""


def align(a: Walks, b: Walks, frame_rate: float, most_delay: int) -> list[Alignment]:
    """The few alignments of two views that most people agree with, the best first.

    Parameters
    ----------
    a, b
        The two views.
    frame_rate
        Frames per second.
    most_delay
        Frames by which one may be late.
    """
    tried = _from_paths(a, b, frame_rate, most_delay) + _from_moments(a, b, frame_rate, most_delay)
    judged = sorted((_refined(a, b, one) for one in tried), key=_less_support)
    best: list[Alignment] = []
    for one in judged:
        if all(_differ(one, other, frame_rate) for other in best):
            best.append(_at_best_delay(a, b, one, most_delay))
        if len(best) == _KEPT:
            break
    return sorted(best, key=_less_support)


def mirrored(walks: Walks) -> Walks:
    """The same people in a mirror."""
    return Walks(walks.frame, np.conj(walks.place), walks.path)


def _less_support(one: Alignment) -> float:
    return -one.support


def _differ(one: Alignment, other: Alignment, frame_rate: float) -> bool:
    """Whether two alignments say different things, and are not one that is still to be refined."""
    turned = abs(np.angle(one.factor / other.factor)) > 0.3
    return bool(turned or abs(one.delay - other.delay) > frame_rate or abs(one.shift - other.shift) > 1.5)


def _from_paths(a: Walks, b: Walks, frame_rate: float, most_delay: int) -> list[Alignment]:
    """The alignments of single paths that explain most."""
    least = max(4, round(_LEAST_SECONDS * frame_rate))
    first = min(int(a.frame.min(initial=0)), int(b.frame.min(initial=0)))
    span = max(int(a.frame.max(initial=0)), int(b.frame.max(initial=0))) - first + 1
    size = 1 << int(np.ceil(np.log2(span + most_delay + 1)))
    of_a, of_b = (_spectra(walks, first, size, least) for walks in (a, b))
    delays = np.arange(-most_delay, most_delay + 1)
    found: list[tuple[float, Alignment]] = []
    for one in of_a:
        for other in of_b:
            found += _best_delays(one, other, delays, least)
    found.sort(key=lambda pair: -pair[0])
    return [alignment for _, alignment in found[:_PATHS_TRIED]]


def _from_moments(a: Walks, b: Walks, frame_rate: float, most_delay: int) -> list[Alignment]:
    """The alignments by two people, each at a time of their own, that most others agree with.

    Delays are tried in steps of 0.3 s, in which nobody walks out of the gate.
    """
    step = max(1, round(0.3 * frame_rate))
    lots = np.random.default_rng(0)
    found: list[Alignment] = []
    for delay in range(-(most_delay // step) * step, most_delay + 1, step):
        found += _of_delay(a, b, delay, lots)
    return sorted(found, key=lambda one: -one.support)[:_MOMENTS_TRIED]


def _of_delay(a: Walks, b: Walks, delay: int, lots: np.random.Generator) -> list[Alignment]:
    of_a, of_b = _same_time(a, b, delay)
    known = np.isfinite(a.place[of_a]) & np.isfinite(b.place[of_b])
    x, y = a.place[of_a[known]], b.place[of_b[known]]
    if len(x) < 4:
        return []
    one, other = lots.integers(0, len(x), (2, 20 * _DRAWN))
    far_x, far_y = np.abs(x[one] - x[other]), np.abs(y[one] - y[other])
    alike = (far_x > _APART) & (np.abs(far_x - far_y) < _GATE / 2)
    one, other = one[alike][:_DRAWN], other[alike][:_DRAWN]
    factor = (y[one] - y[other]) / (x[one] - x[other])
    factor /= np.abs(factor)
    shift = (y[one] + y[other] - factor * (x[one] + x[other])) / 2
    asked = lots.permutation(len(x))[:_ASKED]
    away = np.abs(factor[:, None] * x[asked] + shift[:, None] - y[asked])
    support = np.maximum(0.0, 1 - (away / _GATE) ** 2).sum(axis=1) * len(x) / len(asked)
    best = np.argsort(-support)[:5]
    return [Alignment(delay, complex(factor[k]), complex(shift[k]), float(support[k])) for k in best]


def _spectra(walks: Walks, first: int, size: int, least: int) -> list[Complexes]:
    """Fourier transforms of presence, place and squared place of each path long enough, complex (3, size) each."""
    spectra = []
    for number in np.unique(walks.path):
        rows = np.flatnonzero((walks.path == number) & np.isfinite(walks.place))
        if len(rows) < least:
            continue
        signal = np.zeros((3, size), complex)
        at = walks.frame[rows] - first
        signal[0, at], signal[1, at], signal[2, at] = 1.0, walks.place[rows], np.abs(walks.place[rows]) ** 2
        spectra.append(np.fft.fft(signal))
    return spectra


def _best_delays(a: Complexes, b: Complexes, delays: Ints, least: int) -> list[tuple[float, Alignment]]:
    """Gain and alignment at the few best delays of two paths (Procrustes' solution at every delay)."""

    def over(x: Complexes, y: Complexes) -> Complexes:
        return np.asarray(np.fft.ifft(np.conj(x) * y)[delays])  # sum over t of conj(x(t)) y(t + delay)

    n = np.rint(over(a[0], b[0]).real)
    enough = n >= least
    n = np.maximum(n, 1)
    sum_a, sum_b = np.conj(over(a[1], b[0])), over(a[0], b[1])
    var_a = over(a[2], b[0]).real / n - np.abs(sum_a / n) ** 2
    var_b = over(a[0], b[2]).real / n - np.abs(sum_b / n) ** 2
    both = over(a[1], b[1]) / n - np.conj(sum_a / n) * (sum_b / n)
    enough &= (var_a > _LEAST_SPREAD**2) & (var_b > _LEAST_SPREAD**2)
    if not enough.any():
        return []
    left = np.maximum(var_a + var_b - 2 * np.abs(both), 0.0)
    gain = np.where(enough, n * np.log((var_a + var_b + _NOISE**2) / (left + _NOISE**2)), -np.inf)
    found = []
    for k in np.argsort(-gain)[:3]:
        if np.isfinite(gain[k]):
            factor = both[k] / np.abs(both[k])
            shift = (sum_b[k] - factor * sum_a[k]) / n[k]
            found.append((float(gain[k]), Alignment(int(delays[k]), complex(factor), complex(shift), 0.0)))
    return found


def _refined(a: Walks, b: Walks, one: Alignment) -> Alignment:
    """The alignment again from everybody who agrees with it, a few times."""
    factor, shift = one.factor, one.shift
    rows = _same_time(a, b, one.delay)
    best = Alignment(one.delay, factor, shift, _agreement(a, b, rows, factor, shift)[0])
    for _ in range(_ROUNDS):
        _, weight = _agreement(a, b, rows, factor, shift)
        if (weight > 0).sum() < 4 or np.ptp(a.frame[rows[0][weight > 0]]) < 2:
            break
        x, y = a.place[rows[0]], b.place[rows[1]]
        mean_x, mean_y = (np.sum(weight * z) / weight.sum() for z in (x, y))
        factor = np.sum(weight * np.conj(x - mean_x) * (y - mean_y)) / np.sum(weight * np.abs(x - mean_x) ** 2)
        # Two views of people of one height have one scale, up to what a single view knows of its lens.
        factor *= np.clip(np.abs(factor), 0.7, 1.4) / np.abs(factor)
        shift = mean_y - factor * mean_x
        support, _ = _agreement(a, b, rows, factor, shift)
        if support > best.support:
            best = Alignment(one.delay, complex(factor), complex(shift), support)
    return best


def _at_best_delay(a: Walks, b: Walks, one: Alignment, most_delay: int) -> Alignment:
    """The alignment at the delay near its own that most agree with."""
    best, step = one, 8
    while step:
        near = [best.delay + off for off in (-step, step) if abs(best.delay + off) <= most_delay]
        better = max((_refined(a, b, replace(best, delay=delay)) for delay in near), key=_has_support, default=best)
        if better.support > best.support:
            best = better
        else:
            step //= 2
    return best


def _has_support(one: Alignment) -> float:
    return one.support


def support(a: Walks, b: Walks, one: Alignment) -> float:
    """How many people and frames agree with an alignment, in whole agreements."""
    return _agreement(a, b, _same_time(a, b, one.delay), one.factor, one.shift)[0]


def _same_time(a: Walks, b: Walks, delay: int) -> tuple[Ints, Ints]:
    """All pairs of rows of the two views at one time."""
    begin = np.searchsorted(b.frame, a.frame + delay, "left")
    count = np.searchsorted(b.frame, a.frame + delay, "right") - begin
    of_a = np.repeat(np.arange(len(a.frame)), count)
    return of_a, np.repeat(begin - np.cumsum(count) + count, count) + np.arange(count.sum())


def _agreement(a: Walks, b: Walks, rows: tuple[Ints, Ints], factor: complex, shift: complex) -> tuple[float, Floats]:
    """How much of everybody agrees, each counted once in each view, and the weight of each pair of rows."""
    away = np.abs(factor * a.place[rows[0]] + shift - b.place[rows[1]])
    close = np.maximum(0.0, 1 - (np.where(np.isfinite(away), away, np.inf) / _GATE) ** 2)
    best_a, best_b = np.zeros(len(a.frame)), np.zeros(len(b.frame))
    np.maximum.at(best_a, rows[0], close)
    np.maximum.at(best_b, rows[1], close)
    mutual = close * (close == best_a[rows[0]]) * (close == best_b[rows[1]])
    return float(mutual.sum()), mutual
