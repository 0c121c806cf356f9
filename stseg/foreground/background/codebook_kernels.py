"""Kernels of the codebook: foreground log-odds of a frame, learning of the empty scene, adaptation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.foreground.background.posterior import EXPONENT_LIMIT, LOG_ODDS_LIMIT, bounded_log_odds, doubt_of, outshines
from stseg.kernels.accelerate import kernel

_WHITE, _ZERO, _ONE, _HALF = np.float32(255), np.float32(0), np.float32(1), np.float32(0.5)
_TWO, _TINY, _EXPONENT_LIMIT = np.float32(2), np.float32(1e-6), np.float32(EXPONENT_LIMIT)
_OUTWARDS = np.float32(20)  # times faster than inwards do the bounds move


@kernel
def evaluate(
    image: Bytes,
    gain: Floats,
    mean: Singles,
    bounds: Singles,
    weight: Singles,
    foreground: float,
    unexplained: float,
    shadow: float,
    highlight: float,
    darkest: float,
    brightest: float,
    mimicry: float,
    noise: float,
    log_odds: Singles,
) -> None:
    """Fill `log_odds` (v, u) with the log-odds of foreground; densities as in `codebook`."""
    lit_share = np.float32((1.0 - shadow - highlight) / (1.0 - shadow))
    high_share = np.float32(highlight / (1.0 - shadow))
    doubt, mimics = np.float32(doubt_of(foreground, unexplained, shadow)) / lit_share, np.float32(mimicry)
    half, area = np.float32(0.5 / noise**2), np.float32(2.0 * math.pi * noise**2)
    span, deep, bright = np.float32(math.sqrt(2.0 * math.pi) * noise), np.float32(darkest), np.float32(brightest)
    unknown = bounded_log_odds(0.0, 0.0, foreground, unexplained, shadow, mimicry)
    g0, g1, g2 = np.float32(gain[0]), np.float32(gain[1]), np.float32(gain[2])
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x0, x1, x2 = np.float32(image[v, u, 0]), np.float32(image[v, u, 1]), np.float32(image[v, u, 2])
            total = _ZERO
            for k in range(weight.shape[2]):
                total += weight[v, u, k]
            lit, dimmed = _ZERO, _ZERO
            certain = False
            for k in range(weight.shape[2]):
                if weight[v, u, k] == _ZERO:
                    continue
                m0 = min(g0 * mean[v, u, k, 0], _WHITE)
                m1 = min(g1 * mean[v, u, k, 1], _WHITE)
                m2 = min(g2 * mean[v, u, k, 2], _WHITE)
                ratio, off, length = from_ray(x0, x1, x2, m0, m1, m2)
                low, high = max(bounds[v, u, k, 0], _TINY), max(bounds[v, u, k, 1], _TINY)
                under, over = max(high - ratio, _ZERO) * length, max(ratio - low, _ZERO) * length
                excess = max(low - ratio, ratio - high, _ZERO) * length
                flat, line = span + (high - low) * length, span + (_ONE - deep) * low * length
                if weight[v, u, k] == total and outshines(
                    _TWO * half * off, _TWO * half * excess * excess, area, flat, line, _ONE, doubt,
                    mimics / (_ONE + half * over * over),  # exp(-z) <= 1 / (1 + z)
                ):  # fmt: skip
                    certain = True
                    break
                across = half * off
                if across > _EXPONENT_LIMIT:
                    continue
                density = weight[v, u, k] / (total * area)
                lit += lit_share * density * math.exp(-across - half * excess * excess) / flat
                slope = _TWO * min((ratio - deep * low) / ((_ONE - deep) * low), _ONE)
                if slope > _ZERO:
                    dimmed += density * slope * math.exp(-across - half * over * over) / line
                slope = _TWO * min((bright * high - ratio) / ((bright - _ONE) * high), _ONE)
                if slope > _ZERO:
                    decay = math.exp(-across - half * under * under)
                    lit += high_share * density * slope * decay / (span + (bright - _ONE) * high * length)
            if certain:
                log_odds[v, u] = -LOG_ODDS_LIMIT
                continue
            if lit + dimmed == _ZERO:
                log_odds[v, u] = unknown
                continue
            log_odds[v, u] = bounded_log_odds(float(lit), float(dimmed), foreground, unexplained, shadow, mimicry)


@kernel
def teach(
    image: Bytes,
    gain: Singles,
    now: int,
    reach: np.float32,
    longest: NDArray[np.int32],
    mean: Singles,
    bounds: Singles,
    frequency: Singles,
    weight: Singles,
    access: NDArray[np.int32],
) -> None:
    """Update the codewords with a frame of the empty scene, in place: all of it is background.

    With `now` counted from 1, `longest` (v, u, K) comes to hold the longest negative runs. The first codeword of a
    pixel stays; where all places are taken what is new replaces the least frequent of the others.
    """
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x0, x1, x2 = np.float32(image[v, u, 0]), np.float32(image[v, u, 1]), np.float32(image[v, u, 2])
            nearest, distance, nearest_ratio = -1, reach * reach, _ZERO
            rarest = min(1, weight.shape[2] - 1)
            for k in range(weight.shape[2]):
                if frequency[v, u, k] < frequency[v, u, rarest] and k > 0:
                    rarest = k
                if frequency[v, u, k] == _ZERO:
                    continue
                m0 = min(gain[0] * mean[v, u, k, 0], _WHITE)
                m1 = min(gain[1] * mean[v, u, k, 1], _WHITE)
                m2 = min(gain[2] * mean[v, u, k, 2], _WHITE)
                ratio, off, length = from_ray(x0, x1, x2, m0, m1, m2)
                excess = max(bounds[v, u, k, 0] - ratio, ratio - bounds[v, u, k, 1], _ZERO) * length
                if off + excess * excess <= distance:
                    nearest, distance, nearest_ratio = k, off + excess * excess, ratio
            if nearest < 0:
                if frequency[v, u, 0] == _ZERO:
                    rarest = 0
                elif rarest == 0:
                    continue
                _begin(v, u, rarest, now, x0 / gain[0], x1 / gain[1], x2 / gain[2], mean, bounds, frequency, access)
                weight[v, u, rarest] = _ONE
                longest[v, u, rarest] = 0
                continue
            longest[v, u, nearest] = max(longest[v, u, nearest], now - access[v, u, nearest, 1] - 1)
            access[v, u, nearest, 1] = now
            frequency[v, u, nearest] += _ONE
            weight[v, u, nearest] = frequency[v, u, nearest]
            bounds[v, u, nearest, 0] = min(bounds[v, u, nearest, 0], nearest_ratio)
            bounds[v, u, nearest, 1] = max(bounds[v, u, nearest, 1], nearest_ratio)
            _move(v, u, nearest, _ONE / frequency[v, u, nearest], x0, x1, x2, gain, mean, bounds)


@kernel
def settle(
    frames: int,
    allowed: int,
    longest: NDArray[np.int32],
    frequency: Singles,
    weight: Singles,
    access: NDArray[np.int32],
) -> None:
    """After initialisation among people, keep the first codewords and those with an allowed longest negative run.

    A run goes on from the last frame to the first (Kim et al. 2005, section 2.1).
    """
    for v in range(weight.shape[0]):
        for u in range(weight.shape[1]):
            for k in range(weight.shape[2]):
                around = frames - access[v, u, k, 1] + access[v, u, k, 0] - 1
                if k > 0 and max(longest[v, u, k], around) > allowed:
                    frequency[v, u, k] = weight[v, u, k] = _ZERO
                access[v, u, k, 0] = access[v, u, k, 1] = 0


@kernel
def follow(
    image: Bytes,
    gain: Singles,
    likelihood: Singles,
    now: int,
    reach: np.float32,
    rate: np.float32,
    absorption: int,
    absence: int,
    mean: Singles,
    bounds: Singles,
    frequency: Singles,
    weight: Singles,
    access: NDArray[np.int32],
) -> None:
    """Update the codewords with a frame that may show people, in place; `now`, `absorption` and `absence` in turns."""
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x0, x1, x2 = np.float32(image[v, u, 0]), np.float32(image[v, u, 1]), np.float32(image[v, u, 2])
            foreground = likelihood[v, u]
            nearest, distance, nearest_ratio = -1, reach * reach, _ZERO
            place, oldest = -1, now
            for k in range(weight.shape[2]):
                if frequency[v, u, k] > _ZERO and access[v, u, k, 0] > 0:
                    allowed = absence if weight[v, u, k] == _ZERO else absorption
                    if now - access[v, u, k, 1] > allowed:
                        frequency[v, u, k] = weight[v, u, k] = _ZERO
                if frequency[v, u, k] == _ZERO:
                    if oldest >= 0:
                        place, oldest = k, -1
                    continue
                if weight[v, u, k] == _ZERO and access[v, u, k, 1] < oldest:
                    place, oldest = k, access[v, u, k, 1]
                m0 = min(gain[0] * mean[v, u, k, 0], _WHITE)
                m1 = min(gain[1] * mean[v, u, k, 1], _WHITE)
                m2 = min(gain[2] * mean[v, u, k, 2], _WHITE)
                ratio, off, length = from_ray(x0, x1, x2, m0, m1, m2)
                excess = max(bounds[v, u, k, 0] - ratio, ratio - bounds[v, u, k, 1], _ZERO) * length
                if off + excess * excess <= distance:
                    nearest, distance, nearest_ratio = k, off + excess * excess, ratio
            if nearest < 0:
                if foreground >= _HALF and place >= 0:  # else a shadow, noise among background, or no place to spare
                    _begin(v, u, place, now, x0 / gain[0], x1 / gain[1], x2 / gain[2], mean, bounds, frequency, access)
                continue
            access[v, u, nearest, 1] = now
            frequency[v, u, nearest] += _ONE
            if weight[v, u, nearest] > _ZERO:
                step = max(rate, _ONE / weight[v, u, nearest]) * (_ONE - foreground)
                if weight[v, u, nearest] * rate < _ONE:
                    weight[v, u, nearest] += _ONE - foreground
            else:
                step = max(rate, _ONE / frequency[v, u, nearest])
                age = now - access[v, u, nearest, 0]
                if age >= absorption and frequency[v, u, nearest] >= _HALF * age:
                    weight[v, u, nearest] = min(frequency[v, u, nearest], _ONE / rate)
            low, high = bounds[v, u, nearest, 0], bounds[v, u, nearest, 1]
            fast = min(_OUTWARDS * step, _ONE)
            bounds[v, u, nearest, 0] += (fast if nearest_ratio < low else step) * (nearest_ratio - low)
            bounds[v, u, nearest, 1] += (fast if nearest_ratio > high else step) * (nearest_ratio - high)
            _move(v, u, nearest, step, x0, x1, x2, gain, mean, bounds)


@kernel
def from_ray(
    x0: np.float32, x1: np.float32, x2: np.float32, m0: np.float32, m1: np.float32, m2: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Brightness of a colour relative to another, its squared distance from the other's ray, the other's length."""
    squared = m0 * m0 + m1 * m1 + m2 * m2 + _TINY
    ratio = (x0 * m0 + x1 * m1 + x2 * m2) / squared
    d0, d1, d2 = x0 - ratio * m0, x1 - ratio * m1, x2 - ratio * m2
    return ratio, d0 * d0 + d1 * d1 + d2 * d2, np.sqrt(squared)


@kernel
def _begin(
    v: int,
    u: int,
    k: int,
    now: int,
    x0: np.float32,
    x1: np.float32,
    x2: np.float32,
    mean: Singles,
    bounds: Singles,
    frequency: Singles,
    access: NDArray[np.int32],
) -> None:
    """A new codeword of this colour, in the light that the model was learned in."""
    mean[v, u, k, 0], mean[v, u, k, 1], mean[v, u, k, 2] = x0, x1, x2
    bounds[v, u, k, 0] = bounds[v, u, k, 1] = frequency[v, u, k] = _ONE
    access[v, u, k, 0] = access[v, u, k, 1] = now


@kernel
def _move(
    v: int,
    u: int,
    k: int,
    step: np.float32,
    x0: np.float32,
    x1: np.float32,
    x2: np.float32,
    gain: Singles,
    mean: Singles,
    bounds: Singles,
) -> None:
    """Move a codeword towards a colour; its bounds stay where they are in grey levels."""
    before, after = _TINY, _TINY
    for c in range(3):
        x = x0 if c == 0 else (x1 if c == 1 else x2)
        before += mean[v, u, k, c] * mean[v, u, k, c]
        mean[v, u, k, c] += step * (x - min(gain[c] * mean[v, u, k, c], _WHITE)) / gain[c]
        after += mean[v, u, k, c] * mean[v, u, k, c]
    scale = np.sqrt(before / after)
    bounds[v, u, k, 0] *= scale
    bounds[v, u, k, 1] *= scale
