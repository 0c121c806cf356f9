"""Kernels of the codebook: foreground log-odds of a frame, learning of the empty scene, adaptation."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Singles
from stseg.foreground.background.posterior import (
    EXPONENT_LIMIT,
    LOG_ODDS_LIMIT,
    Priors,
    bounded_log_odds,
    doubt_of,
    outshines,
)
from stseg.kernels.accelerate import kernel

_WHITE, _ZERO, _ONE, _HALF = np.float32(255), np.float32(0), np.float32(1), np.float32(0.5)
_TWO, _TINY, _EXPONENT_LIMIT = np.float32(2), np.float32(1e-6), np.float32(EXPONENT_LIMIT)
_OUTWARDS = np.float32(20)  # times faster than inwards do the bounds move


class Codewords(NamedTuple):
    """The codewords of all pixels of a view."""

    mean: Singles
    """float32 (v, u, K, 3): the colour v, grey levels BGR."""
    bounds: Singles
    """float32 (v, u, K, [low, high]): bounds of the brightness, relative to v."""
    frequency: Singles
    """float32 (v, u, K): turns; 0 is an empty place."""
    weight: Singles
    """float32 (v, u, K): the frequency of background, at most that of the memory, and 0 in the cache."""
    access: NDArray[np.int32]
    """int32 (v, u, K, [first, last]): turns, first 0 for what was learned before the first call of `likelihood`."""

    @classmethod
    def none(cls, shape: tuple[int, int, int]) -> Self:
        """Empty places (v, u, K)."""
        mean, bounds = np.zeros((*shape, 3), np.float32), np.ones((*shape, 2), np.float32)
        frequency, weight = np.zeros((2, *shape), np.float32)
        return cls(mean, bounds, frequency, weight, np.zeros((*shape, 2), np.int32))

    def rows(self, rows: slice) -> Codewords:
        """Those of some rows, as views of the arrays."""
        mean, bounds, frequency, weight, access = self
        return Codewords(mean[rows], bounds[rows], frequency[rows], weight[rows], access[rows])


class Tube(NamedTuple):
    """Constants of a codeword's density, of `stseg.config.CodebookConfig`."""

    highlight_prior: float
    brightest_highlight: float
    channel_sd: float


@kernel
def fill_codebook_log_odds(
    image: Bytes, gain: Singles, words: Codewords, priors: Priors, tube: Tube, log_odds: Singles
) -> None:
    """Fill `log_odds` (v, u) with the log-odds of foreground; densities as in `codebook`."""
    mean, bounds, _, weight, _ = words
    shadow, highlight, noise = priors.shadow_prior, tube.highlight_prior, tube.channel_sd
    lit_share = np.float32((1.0 - shadow - highlight) / (1.0 - shadow))
    high_share = np.float32(highlight / (1.0 - shadow))
    doubt, mimics = np.float32(doubt_of(priors)) / lit_share, np.float32(priors.shadow_confusion)
    half, area = np.float32(0.5 / noise**2), np.float32(2.0 * math.pi * noise**2)
    span, unknown = np.float32(math.sqrt(2.0 * math.pi) * noise), bounded_log_odds(0.0, 0.0, priors)
    deep, bright = np.float32(priors.darkest_shadow), np.float32(tube.brightest_highlight)
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            total = _ZERO
            for k in range(weight.shape[2]):
                total += weight[v, u, k]
            lit, dimmed = _ZERO, _ZERO
            certain = False
            for k in range(weight.shape[2]):
                if weight[v, u, k] == _ZERO:
                    continue
                ratio, off, length = _from_ray(v, u, k, image, gain, mean)
                low, high = max(bounds[v, u, k, 0], _TINY), max(bounds[v, u, k, 1], _TINY)
                under, over = max(high - ratio, _ZERO) * length, max(ratio - low, _ZERO) * length
                excess = max(low - ratio, ratio - high, _ZERO) * length
                flat, line = span + (high - low) * length, span + (_ONE - deep) * low * length
                if weight[v, u, k] == total and outshines(
                    _TWO * half * off,
                    _TWO * half * excess * excess,
                    area,
                    flat,
                    line,
                    _ONE,
                    doubt,
                    mimics / (_ONE + half * over * over),  # exp(-z) <= 1 / (1 + z)
                    np.float32(priors.uniform),
                ):
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
            log_odds[v, u] = bounded_log_odds(float(lit), float(dimmed), priors)


@kernel
def teach(
    image: Bytes, gain: Singles, now: int, reach: np.float32, longest: NDArray[np.int32], words: Codewords
) -> None:
    """Update the codewords with a frame of the empty scene, in place: all of it is background.

    With `now` counted from 1, `longest` (v, u, K) comes to hold the longest negative runs. The first codeword of a
    pixel stays; where all places are taken what is new replaces the least frequent of the others.
    """
    mean, bounds, frequency, weight, access = words
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            nearest, distance, nearest_ratio = -1, reach * reach, _ZERO
            rarest = min(1, weight.shape[2] - 1)
            for k in range(weight.shape[2]):
                if frequency[v, u, k] < frequency[v, u, rarest] and k > 0:
                    rarest = k
                if frequency[v, u, k] == _ZERO:
                    continue
                ratio, off, length = _from_ray(v, u, k, image, gain, mean)
                excess = max(bounds[v, u, k, 0] - ratio, ratio - bounds[v, u, k, 1], _ZERO) * length
                if off + excess * excess <= distance:
                    nearest, distance, nearest_ratio = k, off + excess * excess, ratio
            if nearest < 0:
                if frequency[v, u, 0] == _ZERO:
                    rarest = 0
                elif rarest == 0:
                    continue
                _begin(v, u, rarest, now, image, gain, words)
                weight[v, u, rarest] = _ONE
                longest[v, u, rarest] = 0
                continue
            longest[v, u, nearest] = max(longest[v, u, nearest], now - access[v, u, nearest, 1] - 1)
            access[v, u, nearest, 1] = now
            frequency[v, u, nearest] += _ONE
            weight[v, u, nearest] = frequency[v, u, nearest]
            bounds[v, u, nearest, 0] = min(bounds[v, u, nearest, 0], nearest_ratio)
            bounds[v, u, nearest, 1] = max(bounds[v, u, nearest, 1], nearest_ratio)
            _move(v, u, nearest, _ONE / frequency[v, u, nearest], image, gain, words)


@kernel
def follow(
    image: Bytes,
    gain: Singles,
    likelihood: Singles,
    now: int,
    reach: np.float32,
    rate: np.float32,
    times: tuple[int, int],
    words: Codewords,
) -> None:
    """Update the codewords with a frame that may show people, in place; turns `now`, and of absorption and absence."""
    mean, bounds, frequency, weight, access = words
    absorption, absence = times
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
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
                ratio, off, length = _from_ray(v, u, k, image, gain, mean)
                excess = max(bounds[v, u, k, 0] - ratio, ratio - bounds[v, u, k, 1], _ZERO) * length
                if off + excess * excess <= distance:
                    nearest, distance, nearest_ratio = k, off + excess * excess, ratio
            if nearest < 0:
                if foreground >= _HALF and place >= 0:  # else a shadow, noise among background, or no place to spare
                    _begin(v, u, place, now, image, gain, words)
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
            _move(v, u, nearest, step, image, gain, words)


@kernel
def _from_ray(
    v: int, u: int, k: int, image: Bytes, gain: Singles, mean: Singles
) -> tuple[np.float32, np.float32, np.float32]:
    """Brightness of a pixel relative to a codeword, its squared distance from the word's ray, the word's length."""
    x0, x1, x2 = np.float32(image[v, u, 0]), np.float32(image[v, u, 1]), np.float32(image[v, u, 2])
    m0 = min(gain[0] * mean[v, u, k, 0], _WHITE)
    m1 = min(gain[1] * mean[v, u, k, 1], _WHITE)
    m2 = min(gain[2] * mean[v, u, k, 2], _WHITE)
    squared = m0 * m0 + m1 * m1 + m2 * m2 + _TINY
    ratio = (x0 * m0 + x1 * m1 + x2 * m2) / squared
    d0, d1, d2 = x0 - ratio * m0, x1 - ratio * m1, x2 - ratio * m2
    return ratio, d0 * d0 + d1 * d1 + d2 * d2, np.sqrt(squared)


@kernel
def _begin(v: int, u: int, k: int, now: int, image: Bytes, gain: Singles, words: Codewords) -> None:
    """A new codeword of a pixel's colour, in the light that the model was learned in."""
    for c in range(3):
        words.mean[v, u, k, c] = np.float32(image[v, u, c]) / gain[c]
    words.bounds[v, u, k, 0] = words.bounds[v, u, k, 1] = words.frequency[v, u, k] = _ONE
    words.access[v, u, k, 0] = words.access[v, u, k, 1] = now


@kernel
def _move(v: int, u: int, k: int, step: np.float32, image: Bytes, gain: Singles, words: Codewords) -> None:
    """Move a codeword towards a pixel's colour; its bounds stay where they are in grey levels."""
    mean, bounds = words.mean, words.bounds
    before, after = _TINY, _TINY
    for c in range(3):
        before += mean[v, u, k, c] * mean[v, u, k, c]
        mean[v, u, k, c] += step * (np.float32(image[v, u, c]) - min(gain[c] * mean[v, u, k, c], _WHITE)) / gain[c]
        after += mean[v, u, k, c] * mean[v, u, k, c]
    scale = np.sqrt(before / after)
    bounds[v, u, k, 0] *= scale
    bounds[v, u, k, 1] *= scale
