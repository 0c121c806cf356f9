"""Where exactly a person stands: the posterior over a small patch of ground.

Its prior is where they were expected, if they were; its evidence is what is theirs alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.ghosts.boxes import fill_match
from stseg.ghosts.pool import Pool
from stseg.ghosts.prior import Prior
from stseg.ghosts.views import BoxView, PixelView, Sight, View

_REACH, _SPACING = 2, 0.08
_WORST = -8.0
"""A box never speaks more strongly against a place than this, nats: it may not be theirs after all."""


@dataclass(frozen=True)
class Own:
    """What belongs to one person in one view: a box (its index, -1 for none), or what of the raster is open to them.

    Open are the pixels whose owner (v, u) is the person or nobody, -1.
    """

    box: int
    owner: Ints
    person: int


def refine(
    pool: Pool,
    views: Sequence[View],
    sights: Sequence[Sight | None],
    own: Sequence[Sequence[Own]],
    prior: Prior,
    walker: Ints,
) -> tuple[Pool, Floats]:
    """Move each person to the mean of their posterior.

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
    Pool, float64 (n, 2, 2)
        The people moved, and the covariance of each place, square metres.
    """
    axis = np.arange(-_REACH, _REACH + 1) * _SPACING
    offset = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    ground, height, covariance = pool.ground.copy(), pool.height.copy(), np.zeros((len(pool), 2, 2))
    tried = np.asarray(prior.config.heights)
    for j in range(len(pool)):
        patch = pool.ground[j] + offset
        score = np.repeat(prior.tall(tried)[:, None], len(patch), 1)
        for view, sight, mine in zip(views, sights, own[j], strict=True):
            if sight is not None:
                score += _patch_score(view, sight, mine, patch, tried)
        if walker[j] >= 0:
            score += prior.expected.place(int(walker[j]), patch)
        weight = np.exp(score - score.max())
        height[j] = weight.sum(1) @ tried / weight.sum()
        place = weight.sum(0) / weight.sum()
        ground[j] = place @ patch
        spread = patch - ground[j]
        covariance[j] = (spread * place[:, None]).T @ spread + np.eye(2) * _SPACING**2 / 12
    return Pool(ground, height), covariance


def _patch_score(view: View, sight: Sight, mine: Own, patch: Floats, tried: Floats) -> Floats:
    """What one view says of a patch's pillars, nats, float64 (height, place)."""
    score = np.zeros((len(tried), len(patch)))
    if isinstance(view, BoxView) and mine.box >= 0:
        width, height = map(float, view.camera.size)
        edges, belief = sight.edges[mine.box : mine.box + 1], sight.belief[mine.box : mine.box + 1]
        match = np.empty((score.size, 1))
        bodies = view.table.boxes(patch, tried).reshape(-1, 4)
        fill_match(bodies, edges, belief, width, height, match)
        score = np.maximum(match, _WORST).reshape(score.shape)
    if isinstance(view, PixelView):
        everywhere = np.tile(patch, (len(tried), 1))
        first, spans, area = view.outlines(everywhere, np.repeat(tried, len(patch)))
        score = view.mean_open(sight.raster, mine.owner, mine.person, first, spans, area).reshape(score.shape)
    return score


def owned(person: int, boxes: Ints, pixels: Ints) -> Own:
    """What of a view belongs to a person: the box assigned, or the pixels of nobody else."""
    theirs = np.flatnonzero(boxes == person)
    return Own(int(theirs[0]) if len(theirs) else -1, pixels, person)
