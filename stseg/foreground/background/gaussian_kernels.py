"""Kernels of the Gaussian mixtures: foreground log-odds of a frame, and the adaptation to it.

The state of a view is one array `modes` float32 (mode, plane, v, u): for each mode of a pixel its mean (three planes,
BGR), its variance (one plane if it is isotropic; two, across and along the ray of its chromaticity), and its weight.
The strongest mode comes first. So whatever is done to all pixels runs over contiguous memory, several pixels at a time
and from one row to the next: the state of all views is larger than a processor's cache, and memory that is read in
order is there in time. Pixels that need branches are treated one by one.
"""

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Labels, Singles
from stseg.foreground.background.posterior import (
    EXPONENT_LIMIT,
    LOG_ODDS_LIMIT,
    Priors,
    bounded_log_odds,
    doubt_of,
)
from stseg.kernels.accelerate import part, wide_kernel

MEAN, VARIANCE = 0, 3
"""Planes of a mode; its weight is the last."""

_WHITE, _ZERO, _ONE, _TWO, _HALF = (np.float32(value) for value in (255, 0, 1, 2, 0.5))
_TINY, _SIXTEENTH, _TWO_PI = np.float32(1e-6), np.float32(1 / 16), np.float32(2 * math.pi)
_SHORTEST = np.float32(1 / math.sqrt(3))  # no colour is shorter than this share of the sum of its channels
_EXPONENT_LIMIT = np.float32(EXPONENT_LIMIT)
_THIRD, _NEVER = np.float32(1 / 3), np.float32(np.inf)


class Adaptation(NamedTuple):
    """Learning rates of background and of what moved in, and constants; standard deviations in grey levels."""

    fast: np.float32
    slow: np.float32
    background_weight: np.float32
    match_distance: np.float32
    initial_sd: np.float32
    least_across_sd: np.float32
    least_along_sd: np.float32


@wide_kernel
def fill_mixture_log_odds(
    image: Bytes, gain: Singles, modes: Singles, background_weight: float, priors: Priors, log_odds: Singles
) -> None:
    """Fill `log_odds` (v, u) with the foreground log-odds; densities as in `mixture`."""
    rows, columns = log_odds.shape
    colour, margin = np.empty((3, columns), np.float32), np.empty(columns, np.float32)
    least = np.float32(-LOG_ODDS_LIMIT)
    none = bounded_log_odds(0.0, 0.0, priors)
    for v in range(rows):
        _fill_colour(image[v], colour)
        row = log_odds[v]
        _fill_margin(colour, gain, modes, v, background_weight, priors, margin)
        for u in range(columns):
            row[u] = least
        for u in range(columns):
            if margin[u] > _ZERO:
                continue
            lit, dimmed = _densities(v, u, colour, gain, modes, background_weight, priors)
            row[u] = none
            if lit + dimmed > _ZERO:
                row[u] = bounded_log_odds(float(lit), float(dimmed), priors)


@wide_kernel
def _fill_colour(row: Bytes, colour: Singles) -> None:
    """Fill colour (3, u) from a row of an image, uint8 (u, 3)."""
    values = row.reshape(-1)
    blue, green, red = colour[0], colour[1], colour[2]
    for u in range(len(row)):
        blue[u] = values[3 * u]
    for u in range(len(row)):
        green[u] = values[3 * u + 1]
    for u in range(len(row)):
        red[u] = values[3 * u + 2]


@wide_kernel
def _fill_margin(
    colour: Singles, gain: Singles, modes: Singles, v: int, background_weight: float, priors: Priors, margin: Singles
) -> None:
    """Fill margin (u,) of row v: above 0 where the first mode alone puts the log-odds at their lower bound.

    A sufficient condition, found without exponentials and true of most pixels: exp(-z) >= (1 - z / 8)^8 bounds the
    densities of background and of people on both sides.
    """
    mode, planes = modes[0], modes.shape[1]
    blue, green, red, spread = mode[0, v], mode[1, v], mode[2, v], mode[VARIANCE, v]
    lengthwise, weights = mode[planes - 2, v], mode[planes - 1, v]
    g0, g1, g2 = gain[0], gain[1], gain[2]
    sure, reach = np.float32(1.0 - background_weight), np.float32(1.0 - priors.darkest_shadow)
    confusion, uniform = np.float32(priors.shadow_confusion), np.float32(priors.uniform)
    doubt = np.float32(doubt_of(priors))
    for u in range(colour.shape[1]):
        m0, m1, m2 = g0 * blue[u], g1 * green[u], g2 * red[u]
        m0 = m0 if m0 < _WHITE else _WHITE
        m1 = m1 if m1 < _WHITE else _WHITE
        m2 = m2 if m2 < _WHITE else _WHITE
        weight = weights[u]
        d0, d1, d2 = colour[0, u] - m0, colour[1, u] - m1, colour[2, u] - m2
        inner = d0 * m0 + d1 * m1 + d2 * m2
        along = inner * inner / (m0 * m0 + m1 * m1 + m2 * m2 + _TINY)
        across = (d0 * d0 + d1 * d1 + d2 * d2 - along) / spread[u]
        along = along / lengthwise[u]
        area, span = _TWO_PI * spread[u], np.sqrt(_TWO_PI * lengthwise[u])
        line = span + reach * _SHORTEST * (m0 + m1 + m2)
        closeness = _ONE - _SIXTEENTH * (across + along)
        closeness = closeness if closeness > _ZERO else _ZERO
        level = _ONE - _SIXTEENTH * along
        level = level if level > _ZERO else _ZERO
        closeness, level = closeness * closeness, level * level
        closeness, level = closeness * closeness, level * level
        closeness, level = closeness * closeness, level * level
        person = uniform * area * line * level + _TWO * confusion * weight * closeness
        excess = weight * closeness * level * line - doubt * span * person
        margin[u] = excess if weight > sure else _ZERO


@part
def _densities(
    v: int, u: int, colour: Singles, gain: Singles, modes: Singles, background_weight: float, priors: Priors
) -> tuple[np.float32, np.float32]:
    """Densities of pixel (v, u)'s colour under the background modes: lit, and in shadow."""
    x0, x1, x2 = colour[0, u], colour[1, u], colour[2, u]
    weight_plane, along_plane = modes.shape[1] - 1, modes.shape[1] - 2
    darkest = np.float32(priors.darkest_shadow)
    lit, dimmed = _ZERO, _ZERO
    for k in range(modes.shape[0]):
        weight = modes[k, weight_plane, v, u]
        if weight < background_weight:
            continue
        m0 = min(gain[0] * modes[k, 0, v, u], _WHITE)
        m1 = min(gain[1] * modes[k, 1, v, u], _WHITE)
        m2 = min(gain[2] * modes[k, 2, v, u], _WHITE)
        brightness = m0 * m0 + m1 * m1 + m2 * m2 + _TINY
        ratio = (x0 * m0 + x1 * m1 + x2 * m2) / brightness
        d0, d1, d2 = x0 - ratio * m0, x1 - ratio * m1, x2 - ratio * m2
        across = _HALF * (d0 * d0 + d1 * d1 + d2 * d2) / modes[k, VARIANCE, v, u]
        if across > _EXPONENT_LIMIT:
            continue
        decay = _HALF * brightness / modes[k, along_plane, v, u]
        area, span = _TWO_PI * modes[k, VARIANCE, v, u], np.sqrt(_TWO_PI * modes[k, along_plane, v, u])
        along = decay * (ratio - _ONE) * (ratio - _ONE)
        if across + along < _EXPONENT_LIMIT:
            lit += weight * np.exp(-across - along) / (area * span)
        if ratio > darkest:
            slope = _TWO * (min(ratio, _ONE) - darkest) / (_ONE - darkest)
            outside = along if ratio > _ONE else _ZERO
            line = span + (_ONE - darkest) * np.sqrt(brightness)
            dimmed += weight * slope * np.exp(-across - outside) / (area * line)
    return lit, dimmed


@wide_kernel
def adapt_mixture(
    image: Bytes, gain: Singles, likelihood: Singles, adaptation: Adaptation, first: int, step: int, modes: Singles
) -> None:
    """Adapt the modes of every `step`-th row from `first` on to a frame, in place; rules of `mixture`.

    Parameters
    ----------
    image : uint8 (v, u, 3)
    gain : float32 (3,)
    likelihood : float32 (v, u)
        Probability that each pixel shows a person.
    modes : float32 (mode, plane, v, u)
    """
    columns, count, planes = image.shape[1], modes.shape[0], modes.shape[1]
    colour, offset = np.empty((3, columns), np.float32), np.empty((count, 2, columns), np.float32)
    nearest, rate = np.empty(columns, np.int32), np.empty(columns, np.float32)
    for v in range(first, image.shape[0], step):
        _fill_colour(image[v], colour)
        used = _used(modes, v)
        for k in range(used):
            _fill_along(colour, gain, modes[k], v, offset[k, 1])
            _fill_across(colour, gain, modes[k], v, offset[k, 1], offset[k, 0])
        _match(offset, modes[:used], v, adaptation.match_distance, nearest)
        rate[:] = _ZERO
        for k in range(used):
            _fill_rate(nearest, np.int32(k), modes[k, planes - 1, v], likelihood[v], adaptation, rate)
        for k in range(used):
            _adapt(colour, gain, nearest, np.int32(k), offset[k], rate, adaptation, modes[k], v)
        for u in range(columns):
            if nearest[u] < 0 and likelihood[v, u] >= _HALF:
                _begin(v, u, colour, gain, adaptation, modes)


# Loops that write one array and read at most eight become vector code: beyond that the compiler does not prove that the
# arrays are apart.


@wide_kernel
def _fill_along(colour: Singles, gain: Singles, mode: Singles, v: int, along: Singles) -> None:
    """Fill along (u,): squared distance of row v from a mode along the ray of its chromaticity, grey levels."""
    g0, g1, g2 = gain[0], gain[1], gain[2]
    blue, green, red = mode[0, v], mode[1, v], mode[2, v]
    for u in range(len(along)):
        m0, m1, m2 = g0 * blue[u], g1 * green[u], g2 * red[u]
        m0 = m0 if m0 < _WHITE else _WHITE
        m1 = m1 if m1 < _WHITE else _WHITE
        m2 = m2 if m2 < _WHITE else _WHITE
        inner = (colour[0, u] - m0) * m0 + (colour[1, u] - m1) * m1 + (colour[2, u] - m2) * m2
        along[u] = inner * inner / (m0 * m0 + m1 * m1 + m2 * m2 + _TINY)


@wide_kernel
def _fill_across(colour: Singles, gain: Singles, mode: Singles, v: int, along: Singles, across: Singles) -> None:
    """Fill across (u,): the rest of the squared distance."""
    g0, g1, g2 = gain[0], gain[1], gain[2]
    blue, green, red = mode[0, v], mode[1, v], mode[2, v]
    for u in range(len(across)):
        m0, m1, m2 = g0 * blue[u], g1 * green[u], g2 * red[u]
        m0 = m0 if m0 < _WHITE else _WHITE
        m1 = m1 if m1 < _WHITE else _WHITE
        m2 = m2 if m2 < _WHITE else _WHITE
        d0, d1, d2 = colour[0, u] - m0, colour[1, u] - m1, colour[2, u] - m2
        rest = d0 * d0 + d1 * d1 + d2 * d2 - along[u]
        across[u] = rest if rest > _ZERO else _ZERO


@wide_kernel
def _used(modes: Singles, v: int) -> int:
    """Number of the modes of row v in use, up to the last that has any weight."""
    for k in range(modes.shape[0] - 1, 0, -1):
        weight, highest = modes[k, modes.shape[1] - 1, v], _ZERO
        for u in range(len(weight)):
            highest = weight[u] if weight[u] > highest else highest
        if highest > _ZERO:
            return k + 1
    return 1


@wide_kernel
def _match(offset: Singles, modes: Singles, v: int, match_distance: np.float32, nearest: Labels) -> None:
    """Fill nearest (u,) of row v with the mode of least Mahalanobis distance within `match_distance`, -1 for none."""
    count, planes, _, columns = modes.shape
    best, length = np.empty(columns, np.float32), np.empty(columns, np.float32)
    best[:], nearest[:] = match_distance * match_distance, -1
    for k in range(count):
        across, along, index = offset[k, 0], offset[k, 1], np.int32(k)
        spread, lengthwise, weight = modes[k, VARIANCE, v], modes[k, planes - 2, v], modes[k, planes - 1, v]
        for u in range(columns):
            distance = across[u] / spread[u] + along[u] / lengthwise[u]
            length[u] = distance if weight[u] > _ZERO else _NEVER
        for u in range(columns):
            nearest[u] = index if length[u] <= best[u] else nearest[u]
        for u in range(columns):
            best[u] = length[u] if length[u] <= best[u] else best[u]


@wide_kernel
def _fill_rate(
    nearest: Labels, index: np.int32, weight: Singles, likelihood: Singles, adaptation: Adaptation, rate: Singles
) -> None:
    """Set rate (u,) where the nearest mode is `index`, of weight (u,)."""
    fast, slow = adaptation.fast, adaptation.slow
    for u in range(len(rate)):
        pace = slow * likelihood[u] + fast * (_ONE - likelihood[u])
        pace = pace if weight[u] >= adaptation.background_weight else slow
        rate[u] = pace if nearest[u] == index else rate[u]


@wide_kernel
def _adapt(
    colour: Singles,
    gain: Singles,
    nearest: Labels,
    index: np.int32,
    offset: Singles,
    rate: Singles,
    adaptation: Adaptation,
    mode: Singles,
    v: int,
) -> None:
    """Move mode `index` (plane, v, u) towards the colours of row v that it matches; elsewhere its weight falls."""
    planes, _, columns = mode.shape
    pace, weight = np.empty(columns, np.float32), mode[planes - 1, v]
    for u in range(columns):
        weight[u] = weight[u] * (_ONE - rate[u]) + (rate[u] if nearest[u] == index else _ZERO)
    for u in range(columns):
        share = rate[u] / (weight[u] if weight[u] > _ZERO else _ONE)
        share = share if share < _ONE else _ONE
        pace[u] = share if nearest[u] == index else _ZERO
    for c in range(3):
        mean, colours = mode[c, v], colour[c]
        for u in range(columns):
            value = gain[c] * mean[u]
            value = value if value < _WHITE else _WHITE
            mean[u] += pace[u] * (colours[u] - value) / gain[c]
    if planes == VARIANCE + 2:
        _spread(offset[0], offset[1], _THIRD, _THIRD, pace, adaptation.least_across_sd, mode[VARIANCE, v])
    else:
        _spread(offset[0], offset[1], _HALF, _ZERO, pace, adaptation.least_across_sd, mode[VARIANCE, v])
        _spread(offset[0], offset[1], _ZERO, _ONE, pace, adaptation.least_along_sd, mode[VARIANCE + 1, v])


@wide_kernel
def _spread(
    across: Singles,
    along: Singles,
    across_share: np.float32,
    along_share: np.float32,
    pace: Singles,
    least_sd: np.float32,
    variance: Singles,
) -> None:
    """Move variance (u,) towards shares of the squared distances, where pace (u,) is above 0."""
    least = least_sd * least_sd
    for u in range(len(variance)):
        moved = variance[u] + pace[u] * (across_share * across[u] + along_share * along[u] - variance[u])
        moved = moved if moved > least else least
        variance[u] = moved if pace[u] > _ZERO else variance[u]


@wide_kernel
def _begin(v: int, u: int, colour: Singles, gain: Singles, adaptation: Adaptation, modes: Singles) -> None:
    """Put a new mode of pixel (v, u)'s colour in the place of the weakest, unless all are background."""
    planes = modes.shape[1]
    weakest = 0
    for k in range(modes.shape[0]):
        if modes[k, planes - 1, v, u] < modes[weakest, planes - 1, v, u]:
            weakest = k
    if modes[weakest, planes - 1, v, u] >= adaptation.background_weight:
        return
    for k in range(modes.shape[0]):
        modes[k, planes - 1, v, u] *= _ONE - adaptation.slow
    for c in range(3):
        modes[weakest, c, v, u] = colour[c, u] / gain[c]
    for c in range(VARIANCE, planes - 1):
        modes[weakest, c, v, u] = adaptation.initial_sd * adaptation.initial_sd
    modes[weakest, planes - 1, v, u] = adaptation.slow


@wide_kernel
def put_strongest_first(first: int, step: int, modes: Singles) -> None:
    """Exchange modes (mode, plane, v, u) of every `step`-th row so that none is stronger than the first."""
    count, planes, rows, columns = modes.shape
    for v in range(first, rows, step):
        for k in range(1, count):
            weight, strongest = modes[k, planes - 1, v], modes[0, planes - 1, v]
            higher = 0
            for u in range(columns):
                higher += 1 if weight[u] > strongest[u] else 0
            if higher == 0:
                continue
            for u in range(columns):
                if weight[u] > strongest[u]:
                    for c in range(planes):
                        weaker = modes[0, c, v, u]
                        modes[0, c, v, u] = modes[k, c, v, u]
                        modes[k, c, v, u] = weaker
