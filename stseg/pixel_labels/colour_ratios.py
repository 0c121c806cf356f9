"""Log-ratio of colours of overlapping bodies at a pixel, by the clothes of each track (`appearance`).

    p(c | j, s) = (1 - e) N(c; mu_js, S_js) + e / 256^3
    a_j         = log p(c | j, s) - log [ sum_i p_i p(c | i, s) / sum_i p_i ]

with p_i the prior share of person i at the pixel (HW12 eq. 19). Huang and Wang have no such term.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Bytes, Ints, Singles
from stseg.kernels.accelerate import kernel
from stseg.pixel_labels.appearance import Appearance, BodyRows, slice_of
from stseg.pixel_labels.body_masks import Patches
from stseg.pixel_labels.label_likelihood import LabelLikelihood

_OUTLIERS = 0.1
"""e: share of a slice's pixels with other colours: hands, bags, ground between the legs."""
_UNIFORM = 256.0**-3


def colour_log_ratios(
    appearance: Appearance, likelihood: LabelLikelihood, rows: BodyRows, track: Ints, image: Bytes
) -> Singles:
    """Log-ratio of a pixel's colour for a person to that for the mean of all who may cover it.

    Parameters
    ----------
    appearance
        Colours of the view's tracks.
    likelihood
        Prior shares of the frame's people.
    rows
        Their rows.
    track : int64 (n,)
        Their ids.
    image : uint8 (v, u, 3)
        Colours of the window.

    Returns
    -------
    float32 (m,)
        Nats, at the pixels of each person's rectangle; 0 where no other person may be.
    """
    place = np.searchsorted(appearance.track, track)
    density, ratio = np.zeros((2, len(likelihood.people.share)), np.float32)
    total, weight = (np.zeros(likelihood.background.shape, np.float32) for _ in range(2))
    people, corner = likelihood.people, (likelihood.left, likelihood.top)
    _fill_densities(people, corner, rows, place, image, appearance, density)
    _add_mixture(people, corner, density, total, weight)
    _fill_log_ratios(people, corner, density, total, weight, ratio)
    return ratio


@kernel
def _fill_densities(
    people: Patches,
    corner: tuple[int, int],
    rows: BodyRows,
    place: Ints,
    image: Bytes,
    appearance: Appearance,
    density: Singles,
) -> None:
    """Fill p(c | j, s) / 256^-3 at the pixels that a person may cover."""
    for j in range(len(people.edges)):
        i, t = people.first[j], place[j]
        for v in range(people.edges[j, 1], people.edges[j, 3]):
            s = slice_of(v, rows.head[j], rows.feet[j])
            peak = appearance.peak[t, s] * (1.0 - _OUTLIERS) / _UNIFORM
            for u in range(people.edges[j, 0], people.edges[j, 2]):
                if people.share[i] > 0:
                    square = 0.0
                    for a in range(3):
                        off_a = float(image[v - corner[1], u - corner[0], a]) - appearance.mean[t, s, a]
                        for b in range(3):
                            off_b = float(image[v - corner[1], u - corner[0], b]) - appearance.mean[t, s, b]
                            square += off_a * off_b * appearance.precision[t, s, a, b]
                    density[i] = peak * np.exp(-0.5 * square) + _OUTLIERS
                i += 1


@kernel
def _add_mixture(people: Patches, corner: tuple[int, int], density: Singles, total: Singles, weight: Singles) -> None:
    """Add densities times shares, and shares, of all people to each pixel of the window (v, u)."""
    left, top = corner
    for j in range(len(people.edges)):
        i = people.first[j]
        for v in range(people.edges[j, 1] - top, people.edges[j, 3] - top):
            for u in range(people.edges[j, 0] - left, people.edges[j, 2] - left):
                total[v, u] += people.share[i] * density[i]
                weight[v, u] += people.share[i]
                i += 1


@kernel
def _fill_log_ratios(
    people: Patches, corner: tuple[int, int], density: Singles, total: Singles, weight: Singles, ratio: Singles
) -> None:
    """Fill the logarithm of each density's ratio to the mean by shares, nats."""
    left, top = corner
    for j in range(len(people.edges)):
        i = people.first[j]
        for v in range(people.edges[j, 1] - top, people.edges[j, 3] - top):
            for u in range(people.edges[j, 0] - left, people.edges[j, 2] - left):
                if people.share[i] > 0:
                    ratio[i] = np.log(density[i] * weight[v, u] / total[v, u])
                i += 1
