"""Label likelihood p(l | S): the nearest body at each pixel (Huang and Wang 2012, eqs 19 and 20).

Pillars of all people are drawn far to near; a pixel shows the nearest pillar that covers it. As in the paper the order
is that of the mean places. Pillars are drawn independently, so the share of draws in which j is visible is the share in
which j covers the pixel times that in which no nearer pillar does,

    p_j = c_j prod_(i nearer than j) (1 - c_i),      p_0 = prod_i (1 - c_i),

the limit of joint draws.

The coverage c_j is the share of pillars, drawn by place, height and width, that cover a pixel. Draws are the same for
all people and frames: Roberts' additive recurrence in four dimensions (generalised golden ratio), transformed to normal
deviates. Such quasi-random points converge faster than random ones, and repeat.
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

_PILLAR_MARGIN = 0.15
"""Margin around the pillars in which pixels of the body may lie, as a share of their height in the image."""
_THINNEST = 0.3
"""Least width, as a share of the mean."""


class PersonPatches(NamedTuple):
    """One value for each pixel of a rectangle around each person."""

    edges: Ints
    """int64 (n, 4): left, top, right, bottom, half open; all 0 for a person out of view."""
    first: Ints
    """int64 (n + 1,): first value of each person; values are in row order."""
    share: Singles
    """float32 (m,): 0..1."""

    def rectangles(self, corner: tuple[int, int] = (0, 0)) -> list[tuple[tuple[slice, slice], slice]]:
        """Rows and columns of each person's rectangle in a window with a corner (u, v), and the place of its values."""
        edges = (self.edges - np.tile(corner, 2)).tolist()
        ends = zip(self.first[:-1].tolist(), self.first[1:].tolist(), strict=True)
        return [
            ((slice(top, bottom), slice(left, right)), slice(*values))
            for (left, top, right, bottom), values in zip(edges, ends, strict=True)
        ]


def pillar_patches(table: BodyTable, people: PlacedPeople, config: LabelConfig, body: BodyConfig) -> PersonPatches:
    """Share of each person's draws that cover each pixel of a view."""
    deviates, count = _deviates(config.samples), len(people)
    root_covariance = np.linalg.cholesky(people.covariance + config.position_noise**2 * np.eye(2))
    ground = people.ground[:, None] + np.einsum("nij,dj->ndi", root_covariance, deviates[:, :2])
    heights = people.height[:, None] + config.height_noise * deviates[:, 2]
    widths = (body.width_mean + body.width_spread * deviates[:, 3]).clip(_THINNEST * body.width_mean) / WIDTH
    size = table.size
    first, spans, _ = outlines(table, ground.reshape(-1, 2), heights.ravel(), 1, size[::-1], np.tile(widths, count))
    edges = _edges(first, spans, config.samples, size)
    begin = np.append(0, np.cumsum((edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])))
    share = np.zeros(begin[-1], np.float32)
    _fill_shares(first, spans, config.samples, edges, begin, share)
    return PersonPatches(edges, begin, share)


@lru_cache(maxsize=8)
def _deviates(draws: int) -> Floats:
    """Normal deviates, float64 (draws, 4)."""
    golden = 2.0
    for _ in range(64):
        golden = (1 + golden) ** (1 / 5)
    steps = golden ** -np.arange(1.0, 5.0)
    return np.asarray(ndtri((0.5 + np.arange(draws)[:, None] * steps) % 1.0))


def _edges(first: Ints, spans: Spans, draws: int, size: tuple[int, int]) -> Ints:
    """The rectangles around all draws of each person, margin included, within an image of a size; int64 (person, 4)."""
    drawn = (first[:, None] >= 0) & (spans[..., 1] > spans[..., 0])
    row = first[:, None] + np.arange(spans.shape[1])
    low = np.stack([np.where(drawn, spans[..., 0], size[0]), np.where(drawn, row, size[1])], -1)
    high = np.stack([np.where(drawn, spans[..., 1], 0), np.where(drawn, row + 1, 0)], -1)
    of_person = len(first) // draws, draws * spans.shape[1], 2
    low, high = low.reshape(of_person).min(1), high.reshape(of_person).max(1)
    around = np.ceil(_PILLAR_MARGIN * (high - low)[:, 1:]).astype(np.int64)
    edges = np.concatenate([np.maximum(low - around, 0), np.minimum(high + around, size)], 1).astype(np.int64)
    edges[high[:, 0] <= low[:, 0]] = 0
    return edges


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
    """People of one frame, in the order of their labels."""

    ground: Floats
    """float64 (n, 2): metres."""
    covariance: Floats
    """float64 (n, 2, 2): covariance of each place, square metres."""
    height: Floats
    """float64 (n,): metres."""
    track: Ints
    """int64 (n,): ids."""

    def __len__(self) -> int:
        return len(self.ground)


class LabelLikelihood(NamedTuple):
    """Prior shares of the labels at the pixels of an image window."""

    left: int
    """Corner of the window in the image."""
    top: int
    """Pixels."""
    background: Singles
    """float32 (v, u): p_0, 0..1; has the size of the window."""
    people: PersonPatches
    """p_j at the pixels of each person's rectangle, in image coordinates."""

    @property
    def window(self) -> tuple[slice, slice]:
        """Slices of the window in the image."""
        rows, columns = self.background.shape
        return slice(self.top, self.top + rows), slice(self.left, self.left + columns)


def visible_shares(patches: PersonPatches, distance: Floats) -> LabelLikelihood:
    """Visible shares from coverage; distance float64 (n,) of people from the camera, metres."""
    edges, visible = patches.edges, patches.edges[:, 2] > patches.edges[:, 0]
    left, top = edges[visible, :2].min(0, initial=np.iinfo(np.int64).max) if visible.any() else (0, 0)
    right, bottom = edges[:, 2:].max(0, initial=0)
    background = np.ones((bottom - top, right - left), np.float32)
    share = patches.share.copy()
    rectangles = patches.rectangles((int(left), int(top)))
    for j in np.argsort(distance, kind="stable"):
        here, values = rectangles[j]
        visible_share = share[values].reshape(background[here].shape) * background[here]
        background[here] -= visible_share
        share[values] = visible_share.ravel()
    np.maximum(background, 0, out=background)
    return LabelLikelihood(int(left), int(top), background, PersonPatches(edges, patches.first, share))
