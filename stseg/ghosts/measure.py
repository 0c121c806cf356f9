"""How tall and how wide people are, by HW12's refinement (eqs 25 to 28; METHODS 8).

E step: the sizes of one person on a lattice around those of people in general, heights first, then widths. Over all
that the lattice's pillars cover, the person's own pixels speak for a pillar inside it and against it outside,
background speaks against it inside, other people's pixels say nothing (they may hide anything). A pixel that is
foreground with probability o is o their own and 1 - o background. Less what is the same for all pillars R of the
lattice, one view says of each

    looks * sum_R (2 o OWN + (1 - o) BACKGROUND) / area of a body of mean size     nats,

the weights those of `ghosts.views`.

HW12 averages over R, which never rewards a pillar for covering more of the person. Its weight of the background is lost
in the scan; here it is what makes a pixel that is half foreground say nothing, so that edges lie where people's do.
Of who is seen in boxes alone the height is found with the place (`ghosts.refine`), and no width: arms and strides are
what a box's sides tell of. M step: the frame is searched again with the sizes found (`ghosts.explain`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Singles
from stseg.config import GhostConfig
from stseg.ghosts.own import Own
from stseg.ghosts.pool import Pool
from stseg.ghosts.refine import Places
from stseg.ghosts.sizes import Sizes
from stseg.ghosts.views import PixelView, Sight, View

_WITHIN = 3.0
"""How far the lattice goes, standard deviations of people's sizes."""
_STEPS = 13


def measure(
    places: Places,
    width: Floats,
    views: Sequence[View],
    sights: Sequence[Sight | None],
    own: Sequence[Sequence[Own]],
    config: GhostConfig,
) -> Sizes:
    """The E step: posteriors of people's sizes after one frame, anybody's sizes the prior.

    Parameters
    ----------
    places
        Where they stand, and the heights that hang together with it: all that is known of who is seen in boxes alone.
    width : float64 (n,)
        So far, metres.
    own
        For each person and view what is theirs.
    """
    found = Sizes.of_anybody(len(width), config)
    steps = np.linspace(-_WITHIN, _WITHIN, _STEPS)
    heights, widths = config.height_mean + config.height_spread * steps, config.width_mean + config.width_spread * steps
    for j in range(len(width)):
        told = [
            _Told(view, sight.label_values, mine.pixels)
            for view, sight, mine in zip(views, sights, own[j], strict=True)
            if isinstance(view, PixelView) and sight is not None
        ]
        place, one = np.tile(places.ground[j], (_STEPS, 1)), np.ones(_STEPS)
        if not told:
            found.height[j], found.height_variance[j] = places.height[j], places.height_variance[j]
            continue
        score = _score(Pool(place, heights, width[j] * one), told)
        found.height[j], found.height_variance[j] = _posterior(heights, score, steps)
        score = _score(Pool(place, found.height[j] * one, widths), told)
        found.width[j], found.width_variance[j] = _posterior(widths, score, steps)
    return found


class _Told(NamedTuple):
    """What one view shows of one person: the label values (v, u), and which pixels are open to them."""

    view: PixelView
    values: Singles
    open_pixels: Flags


def _posterior(lattice: Floats, score: Floats, steps: Floats) -> tuple[float, float]:
    """Mean and variance of one size on the lattice, from what the views say of it, nats."""
    score = score - 0.5 * steps**2
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    mean = float(weight @ lattice)
    return mean, float(weight @ (lattice - mean) ** 2)


def _score(fits: Pool, told: Sequence[_Told]) -> Floats:
    """What all views say of one person's pillars, nats, float64 (pillar,)."""
    score = np.zeros(len(fits))
    for view, values, open_pixels in told:
        sums, area = view.open_sums(values, open_pixels, fits.ground, fits.height, fits.width)
        score += sums / max(area.mean(), 1.0)
    return score
