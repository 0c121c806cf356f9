"""An independent particle filter in each view: Du and Piater 2006, eqs 10, 11 without messages (figure 4).

The filter is Isard and Blake's (Condensation, 1998).

Views exchange no messages; a view is initialised from the ground once, when it begins to follow a target. The ground
belief is the views' particles, each view weighted by its resolution on the ground there: the central fusion of the
paper's section 5.2.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.baselines.du_piater_2006.leaf import Leaf
from stseg.baselines.du_piater_2006.particles import Motion, Particles, Prediction
from stseg.baselines.du_piater_2006.star import Star, grow
from stseg.baselines.du_piater_2006.target_likelihood import TargetLikelihood
from stseg.config import BeliefConfig


def condense(
    stars: Sequence[Star],
    likelihoods: Sequence[Sequence[TargetLikelihood | None]],
    motion: Motion,
    config: BeliefConfig,
    rngs: Sequence[np.random.Generator],
) -> list[Star]:
    """One frame of all targets without messages between views; parameters of `propagate`."""
    return [
        _alone(star, likelihood, motion, config, rng)
        for star, likelihood, rng in zip(stars, likelihoods, rngs, strict=True)
    ]


def _alone(
    star: Star,
    likelihoods: Sequence[TargetLikelihood | None],
    motion: Motion,
    config: BeliefConfig,
    rng: np.random.Generator,
) -> Star:
    prediction = Prediction.of(star.ground, np.eye(2), motion)
    leaves = grow(star, likelihoods, prediction, config.particles)
    views: list[Particles | None] = []
    for leaf, particles in zip(leaves, star.views, strict=True):
        if leaf:
            leaf.follow(rng)
            views.append(leaf.settled(np.ones(config.particles), rng))
        else:
            views.append(particles and replace(particles, place=particles.place + motion.seconds * particles.velocity))
    seeing = [(leaf, view) for leaf, view in zip(leaves, views, strict=True) if leaf and view]
    visibility = np.array([float(leaf.visible_belief.sum()) if leaf else 0.0 for leaf in leaves])
    ground = _fused(seeing) if seeing else prediction.settled(prediction.centre, prediction.weight, rng)
    return Star(ground, tuple(views), visibility)


def _fused(seeing: Sequence[tuple[Leaf, Particles]]) -> Particles:
    """All views' particles on the ground, each view weighted by the inverse of the ground area of a pixel."""
    place = np.concatenate([leaf.mapped for leaf, _ in seeing])
    velocity = np.concatenate(
        [
            np.einsum("nij,nj->ni", leaf.likelihood.view.ground_slope(particles.place), particles.velocity)
            for leaf, particles in seeing
        ]
    )
    resolution = [1 / np.sqrt(np.linalg.det(leaf.covariance).mean()) for leaf, _ in seeing]
    weight = np.concatenate(
        [share * particles.weight for share, (_, particles) in zip(resolution, seeing, strict=True)]
    )
    return Particles(place, velocity, weight / weight.sum())
