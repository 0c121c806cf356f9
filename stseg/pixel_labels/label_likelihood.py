"""Label likelihood p(l | S): the nearest body at each pixel (Huang and Wang 2012, eqs 19 and 20).

Pillars of all people are drawn far to near; a pixel shows the nearest pillar that covers it. As in the paper the order
is that of the mean places. Pillars are drawn independently, so the share of draws in which j is visible is the share in
which j covers the pixel times that in which no nearer pillar does,

    p_j = c_j prod_(i nearer than j) (1 - c_i),      p_0 = prod_i (1 - c_i),

the limit of joint draws.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from stseg.arrays import Floats, Ints, Singles
from stseg.bodies.outlines import Spans, outlines
from stseg.bodies.pillars import WIDTH, BodyTable
from stseg.config import BodyConfig, LabelConfig
from stseg.kernels.accelerate import kernel


class LabelLikelihood(NamedTuple):
    """Prior shares of the labels at the pixels of an image window.

    Attributes
    ----------
    left, top
        Corner of the window in the image, pixels.
    background : float32 (v, u)
        p_0, 0..1; has the size of the window.
    people
        p_j at the pixels of each person's rectangle, in image coordinates.
    """

    left: int
    top: int
    background: Singles
    people: Patches

    @property
    def window(self) -> tuple[slice, slice]:
        """Slices of the window in the image."""
        rows, columns = self.background.shape
        return slice(self.top, self.top + rows), slice(self.left, self.left + columns)


def visible_shares(patches: Patches, distance: Floats) -> LabelLikelihood:
    """Visible shares from coverage; distance float64 (n,) of people from the camera, metres."""
    edges, visible = patches.edges, patches.edges[:, 2] > patches.edges[:, 0]
    left, top = edges[visible, :2].min(0, initial=np.iinfo(np.int64).max) if visible.any() else (0, 0)
    right, bottom = edges[:, 2:].max(0, initial=0)
    background = np.ones((bottom - top, right - left), np.float32)
    share = patches.share.copy()
    order = np.argsort(distance, kind="stable")
    _fill_visible(order, edges, patches.first, int(left), int(top), share, background)
    return LabelLikelihood(int(left), int(top), background, Patches(edges, patches.first, share))


@kernel
def _fill_visible(
    order: Ints, edges: Ints, first: Ints, left: int, top: int, share: Singles, background: Singles
) -> None:  # fmt: skip
    """Turn coverage into visible shares, in place; `order` by distance."""
    for j in order:
        i = first[j]
        for v in range(edges[j, 1] - top, edges[j, 3] - top):
            for u in range(edges[j, 0] - left, edges[j, 2] - left):
                covered = share[i]
                share[i] = covered * background[v, u]
                background[v, u] -= share[i]
                i += 1
    for v in range(background.shape[0]):
        for u in range(background.shape[1]):
            background[v, u] = max(background[v, u], np.float32(0.0))


MARGIN = 0.15
"""Margin around the pillars in which pixels of the body may lie, as a share of their height in the image."""
_THINNEST = 0.3
"""Least width, as a share of the mean."""


class Patches(NamedTuple):
    """One value for each pixel of a rectangle around each person.

    Attributes
    ----------
    edges : int64 (n, 4)
        left, top, right, bottom, half open; all 0 for a person out of view.
    first : int64 (n + 1,)
        First value of each person; values are in row order.
    share : float32 (m,)
        0..1.
    """

    edges: Ints
    first: Ints
    share: Singles


def pillar_patches(table: BodyTable, people: PlacedPeople, config: LabelConfig, body: BodyConfig) -> Patches:
    """Share of each person's draws that cover each pixel of a view."""
    deviates, count = _deviates(config.samples), len(people)
    root_covariance = np.linalg.cholesky(people.covariance + config.position_noise**2 * np.eye(2))
    ground = people.ground[:, None] + np.einsum("nij,dj->ndi", root_covariance, deviates[:, :2])
    heights = people.height[:, None] + config.height_noise * deviates[:, 2]
    widths = (body.width_mean + body.width_spread * deviates[:, 3]).clip(_THINNEST * body.width_mean) / WIDTH
    size = table.size
    first, spans, _ = outlines(table, ground.reshape(-1, 2), heights.ravel(), 1, size[::-1], np.tile(widths, count))
    edges = np.zeros((count, 4), np.int64)
    _fill_edges(first, spans, config.samples, MARGIN, size[0], size[1], edges)
    begin = np.append(0, np.cumsum((edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])))
    share = np.zeros(begin[-1], np.float32)
    _fill_shares(first, spans, config.samples, edges, begin, share)
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
    """Fill edges (person, 4) with the rectangles around all draws of each person, margin included."""
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
    """Fill share with the share of each person's draws that cover each pixel of the rectangle."""
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


@dataclass(frozen=True)
class PlacedPeople:
    """People of one frame, in the order of their labels.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres.
    covariance : float64 (n, 2, 2)
        Covariance of each place, square metres.
    height : float64 (n,)
        Metres.
    track : int64 (n,)
        Ids.
    """

    ground: Floats
    covariance: Floats
    height: Floats
    track: Ints

    def __len__(self) -> int:
        return len(self.ground)
