"""Feet and heads of isolated upright people in one view's foreground (Khan and Shah 2009, section 4.2).

A pedestrian's silhouette is elongated; its principal axis points to the vertical vanishing point. Silhouettes that the
border cuts, that are broken, near another or not elongated are skipped: a recording has plenty of others.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Ints, Singles

SILHOUETTE_LIKELIHOOD = 0.8
"""Foreground likelihood of a silhouette's pixels, at least."""
_MIN_AREA, _MIN_LENGTH = 1.5e-3, 0.10
"""Least area and length of a person, shares of the image's area and height."""
_MIN_ELONGATION = 2.0
"""Least ratio of length to width (standard deviations) of a silhouette."""
_HEAD_SHARE, _FEET_SHARE = 0.06, 0.12
"""Shares of a silhouette's length taken as the top of the head and the feet."""
_EROSION = 1.0
"""Distance from the centre of a silhouette's last pixel to the end of the body, pixels: half a pixel, and as much again
lost to pooling over neighbours and to the high likelihood threshold."""
_HEAD_BAND, _HEAD_WIDTH, _HEAD_SPREAD = np.array([0.03, 0.10]), 0.11, 0.011
"""Part of the length in which a head is measured; the mean width of heads there and its standard deviation, in lengths:
0.155 m by 0.197 m and a centimetre of hair, seen from all sides."""
_EXCESS_SPREAD, _MOST_EXCESS = 1.5, 5.0
"""Standard deviation of how far masks reach beyond bodies, and the most that is believed, pixels."""
_SPECK = 9
"""Pixels of a component below which it is noise."""
_BRIDGE = (7, 3)
"""Height and width of what joins fragments, pixels: narrow silhouettes break at necks and ankles, which a median filter
would take away."""
_CLEARANCE, _MIN_CLEARANCE = 0.03, 5
"""Free space around an isolated silhouette, share of its length, and at least so many pixels."""
_NOISE_AREA = 0.03
"""Greatest area of a component that counts as noise rather than a fragment, share of the silhouette's area."""


@dataclass(frozen=True)
class Endpoints:
    """Feet and heads of one view's isolated people, in order of frame."""

    frame: Ints
    """int64 (n,): the stream's own frame."""
    foot: Floats
    head: Floats
    """float64 (n, 2) each: pixels of the real image."""

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def length(self) -> Floats:
        """Pixels from foot to head, float64 (n,)."""
        return np.asarray(np.hypot(*(self.foot - self.head).T))

    def of(self, rows: AnyArray) -> Endpoints:
        """A subset, by index or mask."""
        return Endpoints(self.frame[rows], self.foot[rows], self.head[rows])


def concatenate_endpoints(parts: list[tuple[int, Floats]]) -> Endpoints:
    """Endpoints of a view from (frame, `upright_endpoints` of it) in order."""
    frame = np.repeat([k for k, _ in parts], [len(endpoints) for _, endpoints in parts]).astype(np.int64)
    endpoints = np.concatenate([np.zeros((0, 2, 2)), *(endpoints for _, endpoints in parts)])
    return Endpoints(frame, endpoints[:, 0], endpoints[:, 1])


def upright_endpoints(likelihood: Singles) -> Floats:
    """Foot and head (u, v) of the isolated upright people of one view and frame, pixels, float64 (n, 2, 2).

    `likelihood` float32 (v, u) is that of foreground, 0..1.
    """
    _, label, stats, _ = cv2.connectedComponentsWithStats((likelihood > SILHOUETTE_LIKELIHOOD).astype(np.uint8))
    large = stats[:, 4] >= _SPECK
    large[0] = False
    mask = cv2.morphologyEx(large[label].astype(np.uint8), cv2.MORPH_CLOSE, np.ones(_BRIDGE, np.uint8))
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask)
    found = [_endpoints(label, stats, k) for k in range(1, count) if _may_be_person(stats, k, label.shape)]
    kept = [endpoints for endpoints in found if endpoints is not None]
    return np.array(kept).reshape(-1, 2, 2)


def _may_be_person(stats: AnyArray, k: int, shape: tuple[int, ...]) -> bool:
    """Whether a component is large enough, clear of the border, and isolated."""
    left, top, width, height, area = stats[k]
    rows, columns = shape
    whole = left > 1 and top > 1 and left + width < columns - 1 and top + height < rows - 1
    if not whole or area < _MIN_AREA * rows * columns or max(height, width) < _MIN_LENGTH * rows:
        return False
    gap = max(_MIN_CLEARANCE, round(_CLEARANCE * max(height, width)))
    others = stats[1:]
    neighbours = (
        (others[:, 0] < left + width + gap)
        & (others[:, 0] + others[:, 2] > left - gap)
        & (others[:, 1] < top + height + gap)
        & (others[:, 1] + others[:, 3] > top - gap)
        & (others[:, 4] > _NOISE_AREA * area)
    )
    return int(neighbours.sum()) == 1


def _endpoints(label: AnyArray, stats: AnyArray, k: int) -> Floats | None:
    """Foot and head (2, 2) along the principal axis of component k; None where it is not elongated."""
    left, top, width, height, _ = (int(number) for number in stats[k])
    inside: Bytes = (label[top : top + height, left : left + width] == k).astype(np.uint8)
    v, u = np.nonzero(inside)
    pixel = np.stack([u + left, v + top], -1).astype(float)
    centre = pixel.mean(axis=0)
    spread, axes = np.linalg.eigh(np.cov((pixel - centre).T))
    down = axes[:, 1] * np.sign(axes[1, 1])
    if spread[1] < _MIN_ELONGATION**2 * spread[0] or abs(down[1]) < 0.5:
        return None
    along, across = (pixel - centre) @ down, (pixel - centre) @ np.array([-down[1], down[0]])
    lowest, high = along.max(), along.min()
    length = lowest - high
    feet, head = across[along > lowest - _FEET_SHARE * length], across[along < high + _HEAD_SHARE * length]
    offset_across = np.array([(feet.max() + feet.min()) / 2, (head.max() + head.min()) / 2])
    inward = _EROSION - _excess(along - high, length)
    extent = np.array([lowest + inward, high - inward])
    return np.asarray(centre + extent[:, None] * down + offset_across[:, None] * np.array([-down[1], down[0]]))


def _excess(below: Floats, length: float) -> float:
    """Pixels by which a silhouette reaches beyond its body on all sides, by its head's width; negative if eroded."""
    begin, end = length * _HEAD_BAND
    width = np.count_nonzero((below >= begin) & (below < end)) / (end - begin)
    share = 1 / (1 + (_HEAD_SPREAD / 2 * length / _EXCESS_SPREAD) ** 2)
    return float(share * np.clip((width - _HEAD_WIDTH * length) / 2, -_MOST_EXCESS, _MOST_EXCESS))
