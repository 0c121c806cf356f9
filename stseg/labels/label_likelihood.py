"""Whose body is the nearest at a pixel: the label likelihood p(l | S) of HW12 eqs 19 and 20.

Pillars of all true people are drawn far to near; a pixel shows the nearest that covers it. As in HW12 the order is that
of the mean places. People are drawn independently, so the share of draws in which j is the nearest is what j covers
times what nobody nearer does,

    p_j = c_j prod_(i nearer than j) (1 - c_i),      p_0 = prod_i (1 - c_i),

which is what drawing all of them together converges to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
from stseg.labels.body_masks import Patches


class LabelLikelihood(NamedTuple):
    """Whom each pixel of a window of the image shows, before it is looked at.

    Attributes
    ----------
    left, top
        Of the window in the image, pixels.
    nobody : float32 (v, u)
        p_0, 0..1; the window's size is that of this array.
    people
        p_j at the pixels of each person's rectangle; its edges are those of the image.
    """

    left: int
    top: int
    nobody: Singles
    people: Patches

    @property
    def window(self) -> tuple[slice, slice]:
        """The window as a part of the image."""
        rows, columns = self.nobody.shape
        return slice(self.top, self.top + rows), slice(self.left, self.left + columns)


def nearest(patches: Patches, distance: Floats) -> LabelLikelihood:
    """Shares of the nearest from the shares of cover; distance float64 (n,) of people from the camera, metres."""
    edges, seen = patches.edges, patches.edges[:, 2] > patches.edges[:, 0]
    left, top = edges[seen, :2].min(0, initial=np.iinfo(np.int64).max) if seen.any() else (0, 0)
    right, bottom = edges[:, 2:].max(0, initial=0)
    nobody = np.ones((bottom - top, right - left), np.float32)
    share = patches.share.copy()
    order = np.argsort(distance, kind="stable")
    _fill_nearest(order, edges, patches.first, int(left), int(top), share, nobody)
    return LabelLikelihood(int(left), int(top), nobody, Patches(edges, patches.first, share))


@kernel
def _fill_nearest(
    order: Ints, edges: Ints, first: Ints, left: int, top: int, share: Singles, nobody: Singles
) -> None:  # fmt: skip
    """Turn shares of cover into shares of the nearest; `order` is that of distance."""
    for j in order:
        i = first[j]
        for v in range(edges[j, 1] - top, edges[j, 3] - top):
            for u in range(edges[j, 0] - left, edges[j, 2] - left):
                covered = share[i]
                share[i] = covered * nobody[v, u]
                nobody[v, u] -= share[i]
                i += 1
    for v in range(nobody.shape[0]):
        for u in range(nobody.shape[1]):
            nobody[v, u] = max(nobody[v, u], np.float32(0.0))
