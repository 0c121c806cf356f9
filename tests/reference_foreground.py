"""Slow plain definitions of the foreground stage, written from the formulas and sharing no code with it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes, Floats, Singles
from stseg.config import MixtureConfig

UNIFORM = 256.0**-3


def mode_densities(x: Floats, mu: Floats, var: float, darkest: float) -> tuple[float, float]:
    """N(x; mu, var I) and D(x; mu, var) of `stseg.foreground.mixture`."""
    lit = math.exp(-((x - mu) @ (x - mu)) / (2 * var)) / (2 * math.pi * var) ** 1.5
    ratio = float(np.clip((x @ mu) / (mu @ mu), darkest, 1))
    residual = x - ratio * mu
    length = (1 - darkest) * float(np.linalg.norm(mu))
    along = 2 * (ratio - darkest) / (1 - darkest) / (length + math.sqrt(2 * math.pi * var))
    return lit, along * math.exp(-(residual @ residual) / (2 * var)) / (2 * math.pi * var)


def log_odds(
    image: Bytes, gain: Floats, mean: Singles, variance: Singles, weight: Singles, config: MixtureConfig
) -> Floats:
    """Log-odds of foreground (v, u), within 5 nats."""
    out = np.empty(image.shape[:2])
    for v, u in np.ndindex(*out.shape):
        lit, dimmed = 0.0, 0.0
        for k in np.flatnonzero(weight[v, u] >= config.share):
            mu = np.minimum(gain * mean[v, u, k].astype(float), 255.0)
            n, d = mode_densities(image[v, u].astype(float), mu, float(variance[v, u, k]), config.darkest)
            lit, dimmed = lit + float(weight[v, u, k]) * n, dimmed + float(weight[v, u, k]) * d
        explained = (1 - config.shadow) * lit + config.shadow * dimmed
        scene = (1 - config.unexplained) * explained + config.unexplained * UNIFORM
        person = (1 - config.mimicry) * UNIFORM + config.mimicry * dimmed
        odds = config.foreground * person / ((1 - config.foreground) * scene)
        out[v, u] = np.clip(math.log(odds), -5, 5)
    return out


def updated(
    image: Bytes,
    gain: Floats,
    likelihood: Singles,
    fast: float,
    slow: float,
    state: tuple[Singles, Singles, Singles],
    config: MixtureConfig,
) -> tuple[Floats, Floats, Floats]:
    """Mean, variance and weight after a frame."""
    mean, variance, weight = (part.astype(float) for part in state)
    for v, u in np.ndindex(*image.shape[:2]):
        x, w = image[v, u].astype(float), weight[v, u]
        residual = x - np.minimum(gain * mean[v, u], 255.0)
        mahalanobis = np.where(w > 0, (residual**2).sum(-1) / variance[v, u], np.inf)
        k = int(mahalanobis.argmin())
        if mahalanobis[k] <= config.match**2:
            rate = slow if w[k] < config.share else slow * likelihood[v, u] + fast * (1 - likelihood[v, u])
            w *= 1 - rate
            w[k] += rate
            step = min(rate / w[k], 1)
            mean[v, u, k] += step * residual[k] / gain
            variance[v, u, k] += step * ((residual[k] ** 2).mean() - variance[v, u, k])
            variance[v, u, k] = max(variance[v, u, k], config.minimum_sd**2)
        elif likelihood[v, u] >= 0.5 and w.min() < config.share:
            k = int(w.argmin())
            w *= 1 - slow
            w[k], variance[v, u, k], mean[v, u, k] = slow, config.initial_sd**2, x / gain
    return mean, variance, weight


def pooled(values: Floats, radius: int) -> Floats:
    """Logistic function of the mean over a square."""
    out = np.empty(values.shape)
    for v, u in np.ndindex(*values.shape):
        square = values[max(0, v - radius) : v + radius + 1, max(0, u - radius) : u + radius + 1]
        out[v, u] = 1 / (1 + math.exp(-square.mean()))
    return out


def commonest(frames: NDArray[np.uint8], reach: float) -> tuple[Floats, Floats]:
    """Mean and variance of the companions of the colour that has most, or first more than half, of them."""
    mean, variance = np.empty(frames.shape[1:]), np.empty(frames.shape[1:3])
    for v, u in np.ndindex(*variance.shape):
        colours = frames[:, v, u].astype(float)
        near = np.linalg.norm(colours[:, None] - colours[None], axis=-1) <= reach
        counts = near.sum(1)
        majority = np.flatnonzero(2 * counts > len(colours))
        companions = colours[near[majority[0] if len(majority) else counts.argmax()]]
        mean[v, u], variance[v, u] = companions.mean(0), companions.var(0).mean()
    return mean, variance


def body_map(boxes: Boxes, size: tuple[int, int], step: int) -> Floats:
    """Every map pixel asks every box."""
    width, height = size
    out = np.zeros((math.ceil(height / step), math.ceil(width / step)))
    for (j, i), _ in np.ndenumerate(out):
        u, v = i * step + (step - 1) / 2, j * step + (step - 1) / 2
        for (left, top, w, h), score in zip(boxes.pixel, boxes.score, strict=True):
            if w > 0 and h > 0 and left <= u <= left + w and top <= v <= top + h:
                across, down = 2 * (u - left) / w - 1, (v - top) / h
                trunk = (across**4 + ((down - 0.565) / 0.435) ** 4) ** 0.25
                head = math.hypot(across / 0.4, (down - 0.1) / 0.1)
                out[j, i] = max(out[j, i], score * float(np.clip((1 - min(trunk, head)) / 0.3, 0, 1)))
    return out
