"""An independent particle filter in each view (Isard and Blake, Condensation, 1998).

The ablation of Du and Piater 2006, figure 4.

No message passes; a view hears of a target once, when it begins to follow it. Where somebody asks for the ground, it is
the mean of what the views say, each as sure as its picture is fine there: the central fusion that the paper's section
5.2 speaks of.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.config import BeliefConfig
from stseg.trackers.belief.leaf import Leaf
from stseg.trackers.belief.look import TargetLikelihood
from stseg.trackers.belief.particles import Motion, Particles, Prediction
from stseg.trackers.belief.star import Star, grow


def condense(
    stars: Sequence[Star],
    looks: Sequence[Sequence[TargetLikelihood | None]],
    motion: Motion,
    config: BeliefConfig,
    lots: Sequence[np.random.Generator],
) -> list[Star]:
    """One frame of all targets without messages between views; parameters of `propagate`."""
    return [_alone(star, seen, motion, config, lot) for star, seen, lot in zip(stars, looks, lots, strict=True)]


def _alone(
    star: Star,
    looks: Sequence[TargetLikelihood | None],
    motion: Motion,
    config: BeliefConfig,
    lots: np.random.Generator,
) -> Star:
    foretold = Prediction.of(star.ground, np.eye(2), motion)
    leaves = grow(star, looks, foretold, config.particles)
    views: list[Particles | None] = []
    for leaf, own in zip(leaves, star.views, strict=True):
        if leaf:
            leaf.follow(lots)
            views.append(leaf.settled(np.ones(config.particles), lots))
        else:
            views.append(own and _unseen(own, motion))
    seeing = [(leaf, view) for leaf, view in zip(leaves, views, strict=True) if leaf and view]
    sight = np.array([float(leaf.seen.sum()) if leaf else 0.0 for leaf in leaves])
    ground = _fused(seeing) if seeing else foretold.settled(foretold.centre, foretold.weight, lots)
    return Star(ground, tuple(views), sight)


def _unseen(own: Particles, motion: Motion) -> Particles:
    """Whether a view cannot show the target at its own belief: no message corrects it here."""
    return Particles(own.place + motion.seconds * own.velocity, own.velocity, own.weight)


def _fused(seeing: Sequence[tuple[Leaf, Particles]]) -> Particles:
    """All views' particles on the ground; a view counts by how little of the ground a pixel of it covers."""
    place = np.concatenate([leaf.mapped for leaf, _ in seeing])
    velocity = np.concatenate(
        [np.einsum("nij,nj->ni", leaf.look.view.ground_slope(own.place), own.velocity) for leaf, own in seeing]
    )
    fine = [1 / np.sqrt(np.linalg.det(leaf.covariance).mean()) for leaf, _ in seeing]
    weight = np.concatenate([share * own.weight for share, (_, own) in zip(fine, seeing, strict=True)])
    return Particles(place, velocity, weight / weight.sum())
