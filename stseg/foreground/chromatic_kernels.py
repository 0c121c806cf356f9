"""The two passes of the chromatic mixture over a frame: what shows foreground, and what is learned from it."""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Bytes, Floats, Singles
from stseg.foreground.posterior import CERTAIN, FAR, bounded_log_odds, doubt_of, surely_background

_WHITE, _ONE, _HALF, _TINY = np.float32(255), np.float32(1), np.float32(0.5), np.float32(1e-6)


@kernel
def evaluate(
    image: Bytes,
    gain: Floats,
    mean: Singles,
    variance: Singles,
    weight: Singles,
    share: float,
    foreground: float,
    unexplained: float,
    shadow: float,
    darkest: float,
    mimicry: float,
    log_odds: Singles,
) -> None:
    """Fill `log_odds` (v, u) with the log-odds of foreground; densities as in `stseg.foreground.chromatic`."""
    sure, reach, mimics = np.float32(1.0 - share), np.float32(1.0 - darkest), np.float32(mimicry)
    doubt = np.float32(doubt_of(foreground, unexplained, shadow))
    g0, g1, g2 = gain[0], gain[1], gain[2]
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x0, x1, x2 = float(image[v, u, 0]), float(image[v, u, 1]), float(image[v, u, 2])
            lit, dimmed = 0.0, 0.0
            certain = False
            for k in range(weight.shape[2]):
                w = float(weight[v, u, k])
                if w < share:
                    continue
                m0 = min(g0 * mean[v, u, k, 0], 255.0)
                m1 = min(g1 * mean[v, u, k, 1], 255.0)
                m2 = min(g2 * mean[v, u, k, 2], 255.0)
                if weight[v, u, k] > sure and surely_background(
                    np.float32(x0 - m0), np.float32(x1 - m1), np.float32(x2 - m2), np.float32(m0), np.float32(m1),
                    np.float32(m2), variance[v, u, k, 0], variance[v, u, k, 1], weight[v, u, k], reach, doubt, mimics,
                ):  # fmt: skip
                    certain = True
                    break
                brightness = m0 * m0 + m1 * m1 + m2 * m2 + 1e-9
                ratio = (x0 * m0 + x1 * m1 + x2 * m2) / brightness
                off = (x0 - ratio * m0) ** 2 + (x1 - ratio * m1) ** 2 + (x2 - ratio * m2) ** 2
                across = off / (2.0 * variance[v, u, k, 0])
                if across > FAR:
                    continue
                area = 2.0 * math.pi * variance[v, u, k, 0]
                span = math.sqrt(2.0 * math.pi * variance[v, u, k, 1])
                line = span + (1.0 - darkest) * math.sqrt(brightness)
                decay = brightness / (2.0 * variance[v, u, k, 1])
                lit += w * math.exp(-across - decay * (ratio - 1.0) ** 2) / (area * span)
                if ratio > darkest:
                    slope = 2.0 * (min(ratio, 1.0) - darkest) / (1.0 - darkest)
                    over = max(ratio - 1.0, 0.0)
                    dimmed += w * slope * math.exp(-across - decay * over**2) / (area * line)
            if certain:
                log_odds[v, u] = -CERTAIN
                continue
            log_odds[v, u] = bounded_log_odds(lit, dimmed, foreground, unexplained, shadow, mimicry)


@kernel
def update(
    image: Bytes,
    gain: Singles,
    likelihood: Singles,
    fast: np.float32,
    slow: np.float32,
    share: np.float32,
    match: np.float32,
    chromatic_sd: np.float32,
    minimum_sd: np.float32,
    initial_sd: np.float32,
    mean: Singles,
    variance: Singles,
    weight: Singles,
) -> None:
    """Teach the modes one frame, in place, in single precision; the rules are those in `stseg.foreground.mixture`."""
    g0, g1, g2 = gain[0], gain[1], gain[2]
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x0, x1, x2 = np.float32(image[v, u, 0]), np.float32(image[v, u, 1]), np.float32(image[v, u, 2])
            chance = likelihood[v, u]
            nearest, distance, across, along = -1, match * match, np.float32(0), np.float32(0)
            for k in range(weight.shape[2]):
                if weight[v, u, k] > 0:
                    m0 = min(g0 * mean[v, u, k, 0], _WHITE)
                    m1 = min(g1 * mean[v, u, k, 1], _WHITE)
                    m2 = min(g2 * mean[v, u, k, 2], _WHITE)
                    d0, d1, d2 = x0 - m0, x1 - m1, x2 - m2
                    inner = d0 * m0 + d1 * m1 + d2 * m2
                    brighter = inner * inner / (m0 * m0 + m1 * m1 + m2 * m2 + _TINY)
                    off = max(d0 * d0 + d1 * d1 + d2 * d2 - brighter, np.float32(0))
                    length = off / variance[v, u, k, 0] + brighter / variance[v, u, k, 1]
                    if length <= distance:
                        nearest, distance, across, along = k, length, off, brighter
            if nearest < 0:
                weakest = weight[v, u].argmin()
                if chance < _HALF or weight[v, u, weakest] >= share:
                    continue  # a shadow, noise among background, or no mode to spare for what is new
                for k in range(weight.shape[2]):
                    weight[v, u, k] *= _ONE - slow
                weight[v, u, weakest] = slow
                variance[v, u, weakest, 0] = variance[v, u, weakest, 1] = initial_sd * initial_sd
                mean[v, u, weakest, 0], mean[v, u, weakest, 1], mean[v, u, weakest, 2] = x0 / g0, x1 / g1, x2 / g2
                continue
            rate = slow
            if weight[v, u, nearest] >= share:
                rate = slow * chance + fast * (_ONE - chance)
            for k in range(weight.shape[2]):
                weight[v, u, k] *= _ONE - rate
            weight[v, u, nearest] += rate
            step = min(rate / weight[v, u, nearest], _ONE)
            mean[v, u, nearest, 0] += step * (x0 - min(g0 * mean[v, u, nearest, 0], _WHITE)) / g0
            mean[v, u, nearest, 1] += step * (x1 - min(g1 * mean[v, u, nearest, 1], _WHITE)) / g1
            mean[v, u, nearest, 2] += step * (x2 - min(g2 * mean[v, u, nearest, 2], _WHITE)) / g2
            off = variance[v, u, nearest, 0] + step * (_HALF * across - variance[v, u, nearest, 0])
            brighter = variance[v, u, nearest, 1] + step * (along - variance[v, u, nearest, 1])
            variance[v, u, nearest, 0] = max(off, chromatic_sd * chromatic_sd)
            variance[v, u, nearest, 1] = max(brighter, minimum_sd * minimum_sd)
