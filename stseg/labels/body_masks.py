"""How likely each pixel lies inside each person's body: pillars drawn from what is known of place, height and width.

The draws are the same for everybody and every frame: points of Roberts' additive recurrence in four dimensions (the
generalised golden ratio), turned into normal deviates. They fill the space more evenly than lots do, and repeat.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
from stseg.config import LabelConfig
from stseg.geometry.bodies import SILHOUETTE, BodyTable
from stseg.labels.placed_people import PlacedPeople
from stseg.model.outlines import Spans, outlines

MARGIN = 0.15
"""How far around the pillars a body's pixels may lie, as a share of the pillars' height in the image."""
_THINNEST = 0.3
"""Widths are held above this share of the mean."""
_MEAN_WIDTH = 2 * float(np.trapezoid(SILHOUETTE[:, 1], SILHOUETTE[:, 0]))
"""Of the silhouette over its height, metres."""


class Patches(NamedTuple):
    """A number for each pixel of a rectangle around each person.

    Attributes
    ----------
    edges : int64 (n, 4)
        left, top, right, bottom of the rectangles, half open; all 0 for a person whom the view does not see.
    first : int64 (n + 1,)
        Where each person's numbers begin, row by row.
    share : float32 (m,)
        0..1.
    """

    edges: Ints
    first: Ints
    share: Singles


def pillar_patches(table: BodyTable, standing: PlacedPeople, config: LabelConfig) -> Patches:
    """The share of each person's drawn pillars that cover each pixel of a view."""
    deviates, people = _deviates(config.draws), len(standing)
    wide = np.linalg.cholesky(standing.covariance + config.place_spread**2 * np.eye(2))
    ground = standing.ground[:, None] + np.einsum("nij,dj->ndi", wide, deviates[:, :2])
    heights = standing.height[:, None] + config.height_spread * deviates[:, 2]
    widths = (config.width + config.width_spread * deviates[:, 3]).clip(_THINNEST * config.width) / _MEAN_WIDTH
    size = table.size
    first, spans, _ = outlines(table, ground.reshape(-1, 2), heights.ravel(), 1, size[::-1], np.tile(widths, people))
    edges = np.zeros((people, 4), np.int64)
    _fill_edges(first, spans, config.draws, MARGIN, size[0], size[1], edges)
    begin = np.append(0, np.cumsum((edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])))
    share = np.zeros(begin[-1], np.float32)
    _fill_shares(first, spans, config.draws, edges, begin, share)
    return Patches(edges, begin, share)


@lru_cache(maxsize=8)
def _deviates(draws: int) -> Floats:
    """Normal deviates, float64 (draws, 4)."""
    golden = 2.0
    for _ in range(64):
        golden = (1 + golden) ** (1 / 5)
    steps = golden ** -np.arange(1.0, 5.0)
    return np.asarray(ndtri((0.5 + np.arange(draws)[:, None] * steps) % 1.0))


@kernel
def _fill_edges(first: Ints, spans: Spans, draws: int, margin: float, width: int, height: int, edges: Ints) -> None:
    """Fill edges (person, 4) with the rectangles around all draws of each, and the margin around them."""
    for j in range(len(edges)):
        left, top, right, bottom = width, height, 0, 0
        for d in range(j * draws, (j + 1) * draws):
            for k in range(spans.shape[1]):
                if first[d] >= 0 and spans[d, k, 1] > spans[d, k, 0]:
                    left, right = min(left, int(spans[d, k, 0])), max(right, int(spans[d, k, 1]))
                    top, bottom = min(top, int(first[d]) + k), max(bottom, int(first[d]) + k + 1)
        if right > left:
            around = int(np.ceil(margin * (bottom - top)))
            edges[j, 0], edges[j, 1] = max(left - around, 0), max(top - around, 0)
            edges[j, 2], edges[j, 3] = min(right + around, width), min(bottom + around, height)


@kernel
def _fill_shares(first: Ints, spans: Spans, draws: int, edges: Ints, begin: Ints, share: Singles) -> None:
    """Fill share with how many of each person's draws cover each pixel of their rectangle."""
    one = np.float32(1.0 / draws)
    for j in range(len(edges)):
        left, columns = edges[j, 0], edges[j, 2] - edges[j, 0]
        for d in range(j * draws, (j + 1) * draws):
            if first[d] < 0:
                continue
            for k in range(spans.shape[1]):
                line = begin[j] + (first[d] + k - edges[j, 1]) * columns - left
                for u in range(spans[d, k, 0], spans[d, k, 1]):
                    share[line + u] += one
