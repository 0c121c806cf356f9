"""Where exactly a person stands: the posterior over a small patch of ground.

Its prior is where they were expected, if they were; its evidence is what is theirs alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.ghosts.boxes import fill_match
from stseg.ghosts.own import WORST, Own
from stseg.ghosts.pool import Pool
from stseg.ghosts.prior import Prior
from stseg.ghosts.views import BoxView, PixelView, Sight, View

_REACH, _SPACING = 2, 0.08


@dataclass(frozen=True)
class Places:
    """Where people stand and how tall they are, as far as both hang together.

    Attributes
    ----------
    ground, covariance : float64 (n, 2), (n, 2, 2)
        Whatever the height; metres, square metres.
    height, height_variance : float64 (n,)
        Wherever near, anybody's height the prior; metres, square metres.
    """

    ground: Floats
    covariance: Floats
    height: Floats
    height_variance: Floats


def refine(
    pool: Pool,
    views: Sequence[View],
    sights: Sequence[Sight | None],
    own: Sequence[Sequence[Own]],
    prior: Prior,
    walker: Ints,
) -> Places:
    """The posterior of each person's place and height.

    Parameters
    ----------
    pool
        The people.
    own
        For each person and view what is theirs.
    prior
        The frame's prior.
    walker : int64 (n,)
        Whom of those expected each person is, -1 for newcomers.

    Returns
    -------
    Places
        Means and variances.
    """
    axis = np.arange(-_REACH, _REACH + 1) * _SPACING
    offset = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    found = Places(pool.ground.copy(), np.zeros((len(pool), 2, 2)), pool.height.copy(), np.zeros(len(pool)))
    tried = np.asarray(prior.config.heights)
    for j in range(len(pool)):
        patch = pool.ground[j] + offset
        score = np.repeat(prior.tall(tried)[:, None], len(patch), 1)
        for view, sight, mine in zip(views, sights, own[j], strict=True):
            if sight is not None:
                score += _patch_score(view, sight, mine, patch, tried, float(pool.width[j]))
        if walker[j] >= 0:
            score += prior.expected.place(int(walker[j]), patch)
        weight = np.exp(score - score.max())
        place, tall = weight.sum(0) / weight.sum(), weight.sum(1) / weight.sum()
        found.ground[j], found.height[j] = place @ patch, tall @ tried
        spread = patch - found.ground[j]
        found.covariance[j] = (spread * place[:, None]).T @ spread + np.eye(2) * _SPACING**2 / 12
        found.height_variance[j] = tall @ (tried - found.height[j]) ** 2
    return found


def _patch_score(view: View, sight: Sight, mine: Own, patch: Floats, tried: Floats, width: float) -> Floats:
    """What one view says of a patch's pillars, nats, float64 (height, place)."""
    score = np.zeros((len(tried), len(patch)))
    everywhere, tall = np.tile(patch, (len(tried), 1)), np.repeat(tried, len(patch))
    wide = np.full(len(tall), width)
    if isinstance(view, BoxView) and mine.box >= 0:
        columns, rows = map(float, view.camera.size)
        edges, belief = sight.edges[mine.box : mine.box + 1], sight.belief[mine.box : mine.box + 1]
        match = np.empty((score.size, 1))
        fill_match(view.table.boxes_of(everywhere, tall), edges, belief, columns, rows, match)
        score = np.maximum(match, WORST).reshape(score.shape)
    if isinstance(view, PixelView):
        sums, area = view.open_sums(sight.raster, mine.pixels, everywhere, tall, wide)
        score = np.divide(sums, area, out=np.zeros_like(sums), where=area > 0).reshape(score.shape)
    return score
