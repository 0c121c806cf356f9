"""Foot and head ends of people who stand free of others in one view's foreground (METHODS 1; KS09 4.2).

A walker's silhouette is long and thin; its principal axis points to the vertical vanishing point. What is cut by the
image's border, broken, near to something else or not long is passed over: a recording has plenty of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Ints, Singles

_SURE = 0.8
"""Likelihood from which a pixel counts."""
_LEAST_AREA, _LEAST_LENGTH = 1.5e-3, 0.10
"""Of a person, in shares of the image's area and height."""
_SLIM = 2.0
"""How much longer than wide (standard deviations) a person's silhouette is at least."""
_HEAD, _FEET = 0.06, 0.12
"""Shares of a silhouette's length that are its head's top and its feet."""
_LOST = 1.0
"""Pixels from the centre of a silhouette's last pixel to the body's end: half a pixel, and as much that pooling over
neighbours and a likelihood that must be sure take from a tip."""
_CRUMB = 0.03
"""Share of a silhouette's area up to which what lies beside it is dirt and no part that broke off."""


@dataclass(frozen=True)
class Ends:
    """Foot and head ends of one view's isolated people, in the order of their frames.

    Attributes
    ----------
    frame : int64 (n,)
        The stream's own frame.
    foot, head : float64 (n, 2)
        Pixels of the real image.
    """

    frame: Ints
    foot: Floats
    head: Floats

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def length(self) -> Floats:
        """Pixels from foot to head, float64 (n,)."""
        return np.asarray(np.hypot(*(self.foot - self.head).T))

    def of(self, rows: AnyArray) -> Ends:
        """Some of them, by index or flag."""
        return Ends(self.frame[rows], self.foot[rows], self.head[rows])


def join_ends(parts: list[tuple[int, Floats]]) -> Ends:
    """Ends of a view from (frame, people_ends of it) in order."""
    frame = np.repeat([k for k, _ in parts], [len(ends) for _, ends in parts]).astype(np.int64)
    ends = np.concatenate([np.zeros((0, 2, 2)), *(ends for _, ends in parts)])
    return Ends(frame, ends[:, 0], ends[:, 1])


def people_ends(likelihood: Singles) -> Floats:
    """Foot and head ends of the isolated people of one view and frame.

    Parameters
    ----------
    likelihood : float32 (v, u)
        Of foreground, 0..1.

    Returns
    -------
    float64 (n, 2, 2)
        Foot and head (u, v), pixels.
    """
    mask = cv2.medianBlur((likelihood > _SURE).astype(np.uint8), 5)
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    found = [_ends(label, stats, k) for k in range(1, count) if _may_be_person(stats, k, label.shape)]
    kept = [ends for ends in found if ends is not None]
    return np.array(kept).reshape(-1, 2, 2)


def _may_be_person(stats: AnyArray, k: int, shape: tuple[int, ...]) -> bool:
    """Whether a component is large enough, clear of the image's border, and alone."""
    left, top, width, height, area = stats[k]
    rows, columns = shape
    whole = left > 1 and top > 1 and left + width < columns - 1 and top + height < rows - 1
    if not whole or area < _LEAST_AREA * rows * columns or max(height, width) < _LEAST_LENGTH * rows:
        return False
    gap = max(3, round(0.08 * max(height, width)))
    others = stats[1:]
    near = (
        (others[:, 0] < left + width + gap)
        & (others[:, 0] + others[:, 2] > left - gap)
        & (others[:, 1] < top + height + gap)
        & (others[:, 1] + others[:, 3] > top - gap)
        & (others[:, 4] > _CRUMB * area)
    )
    return int(near.sum()) == 1


def _ends(label: AnyArray, stats: AnyArray, k: int) -> Floats | None:
    """Foot and head (2, 2) along the principal axis of component k; None where it is not slim."""
    left, top, width, height, _ = (int(number) for number in stats[k])
    inside: Bytes = (label[top : top + height, left : left + width] == k).astype(np.uint8)
    v, u = np.nonzero(inside)
    pixel = np.stack([u + left, v + top], -1).astype(float)
    centre = pixel.mean(axis=0)
    spread, axes = np.linalg.eigh(np.cov((pixel - centre).T))
    down = axes[:, 1] * np.sign(axes[1, 1])
    if spread[1] < _SLIM**2 * spread[0] or abs(down[1]) < 0.5:
        return None
    along, across = (pixel - centre) @ down, (pixel - centre) @ np.array([-down[1], down[0]])
    low, high = along.max(), along.min()
    length = low - high
    feet, head = across[along > low - _FEET * length], across[along < high + _HEAD * length]
    aside = np.array([(feet.max() + feet.min()) / 2, (head.max() + head.min()) / 2])
    reach = np.array([low + _LOST, high - _LOST])
    return np.asarray(centre + reach[:, None] * down + aside[:, None] * np.array([-down[1], down[0]]))
