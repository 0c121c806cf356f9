"""Appearance of tracks: colours of each slice of a body, learned from pixels that show the track alone.

A body is cut into slices of equal height. The colours of a track j in slice s of a view are Gaussian, N(mu_js, S_js).
Mean and covariance are learned from pixels that the pillar of j alone covers. They are shrunk to those of all tracks in
the slice, so that a slice that was hardly seen says nothing. Views are apart: cameras differ in gain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Singles
from stseg.kernels.accelerate import kernel
from stseg.pixel_labels.label_likelihood import LabelLikelihood, PersonPatches

SLICES = 6
"""Slices of a body: about head, chest, belly, thighs, shins and feet."""
_VISIBLE_SHARE = 0.9
"""Visible share from which a pixel counts as the person's when colours are learned."""
_NOISE = 4.0
"""Noise of a sensor, grey levels (standard deviation)."""
_PIXELS = 100.0
"""Pixels as which the colours of all tracks count in those of one."""


class ViewAppearance(NamedTuple):
    """Colours of tracks in one view."""

    track: Ints
    """int64 (n,): ids, ascending."""
    mean: Floats
    """float64 (n, SLICES, 3): mu, grey levels."""
    precision: Floats
    """float64 (n, SLICES, 3, 3): inverse of S."""
    peak: Floats
    """float64 (n, SLICES): density at the mean, per grey level cubed."""


class BodyRows(NamedTuple):
    """Image rows of head and feet of each person, float64 (n,), pixels; they may lie outside the image."""

    head: Floats
    feet: Floats


class ColourSums(NamedTuple):
    """Sums over pixels, from which an appearance is learned."""

    track: Ints
    """int64 (n,): ids, ascending."""
    pixels: Floats
    """float64 (n, SLICES): number of pixels."""
    first: Floats
    """float64 (n, SLICES, 3): sums of colours."""
    second: Floats
    """float64 (n, SLICES, 3, 3): sums of their outer products."""

    @classmethod
    def of(cls, track: Ints) -> ColourSums:
        """Empty sums of some tracks."""
        n = len(track)
        return cls(track, np.zeros((n, SLICES)), np.zeros((n, SLICES, 3)), np.zeros((n, SLICES, 3, 3)))

    def add(self, likelihood: LabelLikelihood, rows: BodyRows, track: Ints, image: Bytes) -> None:
        """Add the pixels of a frame that one person surely covers; image uint8 (v, u, 3) is the window's."""
        place = np.searchsorted(self.track, track)
        people, corner = likelihood.people, (likelihood.left, likelihood.top)
        _add_colours(people, corner, rows, place, image, self)

    def appearance(self) -> ViewAppearance:
        """Means and covariances, shrunk to those of all tracks."""
        count, first, second = (
            sums + _PIXELS * _mean_of_all(sums, self.pixels) for sums in (self.pixels, self.first, self.second)
        )
        mean = first / count[..., None]
        covariance = second / count[..., None, None] - mean[..., :, None] * mean[..., None, :] + _NOISE**2 * np.eye(3)
        peak = np.asarray(1 / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance)), float)
        precision = np.asarray(np.linalg.inv(covariance), float)
        return ViewAppearance(self.track, mean, precision, peak)


def _mean_of_all(sums: Floats, count: Floats) -> Floats:
    """Sums of each slice over all tracks, for one pixel; grey of any brightness where no pixel was seen."""
    pixels = count.sum(0).reshape(SLICES, *(1,) * (sums.ndim - 2))
    unseen = _unseen(sums.shape[2:])
    return np.where(pixels > 0, sums.sum(0) / np.maximum(pixels, 1.0), unseen)


def _unseen(shape: tuple[int, ...]) -> Floats:
    """Sums for one pixel of any colour: its number, its mean, and the mean of its outer product."""
    middle, variance = 127.5, 256**2 / 12
    sums = (np.ones(()), np.full(3, middle), middle**2 + variance * np.eye(3))
    return np.asarray(sums[len(shape)])


@kernel
def slice_of(v: float, head: float, feet: float) -> int:
    """Slice of an image row between those of head and feet, pixels; 0 for the head's."""
    if feet <= head:
        return 0
    return int(min(max(SLICES * (v + 0.5 - head) / (feet - head), 0.0), SLICES - 1.0))


@kernel
def _add_colours(
    people: PersonPatches, corner: tuple[int, int], rows: BodyRows, place: Ints, image: Bytes, sums: ColourSums
) -> None:
    """Add colours of pixels that are surely the person's."""
    edges, share = people.edges, people.share
    for j in range(len(edges)):
        i, t = people.first[j], place[j]
        for v in range(edges[j, 1], edges[j, 3]):
            s = slice_of(v, rows.head[j], rows.feet[j])
            for u in range(edges[j, 0], edges[j, 2]):
                if share[i] >= _VISIBLE_SHARE:
                    sums.pixels[t, s] += 1.0
                    for a in range(3):
                        colour = float(image[v - corner[1], u - corner[0], a])
                        sums.first[t, s, a] += colour
                        for b in range(3):
                            sums.second[t, s, a, b] += colour * float(image[v - corner[1], u - corner[0], b])
                i += 1


_OUTLIERS = 0.1
"""e: share of a slice's pixels with other colours: hands, bags, ground between the legs."""
_UNIFORM = 256.0**-3


def colour_log_ratios(
    appearance: ViewAppearance, likelihood: LabelLikelihood, rows: BodyRows, track: Ints, image: Bytes
) -> Singles:
    """Log-ratio of a pixel's colour for a person to that for the mean of all who may cover it.

    float32 (m,), nats, at the pixels of each person's rectangle; 0 where no other person may be. `appearance` holds the
    colours of the view's tracks, `likelihood` the prior shares of the frame's people, `rows` and `track` int64 (n,)
    their rows and ids, and `image` uint8 (v, u, 3) the colours of the window.
    """
    place = np.searchsorted(appearance.track, track)
    density, ratio = np.zeros((2, len(likelihood.people.share)), np.float32)
    total, weight = (np.zeros(likelihood.background.shape, np.float32) for _ in range(2))
    people, corner = likelihood.people, (likelihood.left, likelihood.top)
    _fill_densities(people, corner, rows, place, image, appearance, density)
    for here, values in people.rectangles(corner):
        shape = total[here].shape
        total[here] += (people.share[values] * density[values]).reshape(shape)
        weight[here] += people.share[values].reshape(shape)
    _fill_log_ratios(people, corner, density, total, weight, ratio)
    return ratio


@kernel
def _fill_densities(
    people: PersonPatches,
    corner: tuple[int, int],
    rows: BodyRows,
    place: Ints,
    image: Bytes,
    appearance: ViewAppearance,
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
def _fill_log_ratios(
    people: PersonPatches, corner: tuple[int, int], density: Singles, total: Singles, weight: Singles, ratio: Singles
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
