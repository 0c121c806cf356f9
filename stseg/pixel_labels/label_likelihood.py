"""Label likelihood p(l | S): the nearest body at each pixel (Huang and Wang 2012, eqs 19 and 20).

Pillars of all people are drawn far to near; a pixel shows the nearest pillar that covers it. As in the paper the order
is that of the mean places. Pillars are drawn independently, so the share of draws in which j is visible is the share in
which j covers the pixel times that in which no nearer pillar does,

    p_j = c_j prod_(i nearer than j) (1 - c_i),      p_0 = prod_i (1 - c_i),

the limit of joint draws.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.kernels.accelerate import kernel
from stseg.pixel_labels.body_masks import Patches


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
