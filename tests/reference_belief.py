"""Belief propagation by definition: one particle, one pixel at a time, without the fast code's ideas."""

import colorsys

import numpy as np
from scipy.stats import multivariate_normal

from stseg.arrays import Bytes, Floats


def potential(ground: Floats, mapped: Floats, covariance: Floats, share: float, mean: Floats, spread: float) -> float:
    """psi of one ground particle and one of a view (DP06 eq. 12)."""
    stray = multivariate_normal.pdf(ground, mean, spread**2)
    return float(share * stray + (1 - share) * multivariate_normal.pdf(ground, mapped, covariance))


def exclusion(ground: Floats, place: Floats, weight: Floats, apart: float) -> float:
    """e(g) of one ground point and one other target."""
    met = [w * np.exp(-(np.linalg.norm(ground - h) ** 2) / (2 * apart**2)) for h, w in zip(place, weight, strict=True)]
    return float(1 - sum(met))


def hsv_bin(colour: tuple[float, float, float]) -> int:
    """Bin of blue, green, red, 0..1 (Perez et al. 2002)."""
    blue, green, red = colour
    hue, saturation, value = colorsys.rgb_to_hsv(red, green, blue)
    if saturation > 0.1 and value > 0.2:
        return min(int(hue * 10), 9) * 10 + min(int(saturation * 10), 9)
    return 100 + min(int(value * 10), 9)


def histogram(
    image: Bytes, box: Floats, nearer: Floats, points: Floats, parts: int, bins: Bytes
) -> tuple[Floats, Floats]:
    """Colours (part, bin) of a box and the share of each part that is seen (part,)."""
    colours, asked, seen = np.zeros((parts, 110)), np.zeros(parts), np.zeros(parts)
    for share in points:
        place = box[:2] + share * (box[2:] - box[:2])
        part = int(share[1] * parts)
        asked[part] += 1
        u, v = (int(np.floor(x + 0.5)) for x in place)
        inside = 0 <= u < image.shape[1] and 0 <= v < image.shape[0]
        middles, halves = (nearer[:, :2] + nearer[:, 2:]) / 2, (nearer[:, 2:] - nearer[:, :2]) / 2
        if inside and not (((place - middles) / halves) ** 2).sum(1).min(initial=2.0) <= 1:
            seen[part] += 1
            colours[part, bins[tuple(image[v, u] // 8)]] += 1
    return colours / np.maximum(seen, 1)[:, None], seen / asked
