"""Belief propagation on a target's star graph, the ground and a leaf for each view (Du and Piater 2006, section 3.1).

The graph is a tree, on which two rounds would do; further rounds move the particles to where the belief is. A
round passes messages up, from the views to the ground (eq. 8), and down (eq. 9):

    m_0j(g) = sum_m a_jm psi_j(g, x_jm)                  a_jm ~ p_j(z | x_jm) prior_j(x_jm) / q_j(x_jm)
    m_j0(x) = sum_n c_jn psi_j(g_n, x)                   c_jn ~ prior_0(g_n) / q_0(g_n) e(g_n) prod_(l != j) m_0l(g_n)

with q the proposal density, half the node's own prior and half the messages from the other side in the round before,
and e the messages of other targets (`exclusion`). Beliefs are (eqs 10, 11)

    b_j(x_jm) ~ a_jm m_j0(x_jm)                          b_0(g_n) ~ prior_0(g_n) / q_0(g_n) e(g_n) prod_l m_0l(g_n)

The view's own prior is in its belief, as it is in its message; the paper's eq. 10 leaves it out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.baselines.du_piater_2006.exclusion import exclusion
from stseg.baselines.du_piater_2006.leaf import Leaf, arrival
from stseg.baselines.du_piater_2006.particles import Motion, Particles, Prediction, systematic
from stseg.baselines.du_piater_2006.potential import Outlier, Potential
from stseg.baselines.du_piater_2006.target_likelihood import TargetLikelihood
from stseg.baselines.du_piater_2006.view import StarView
from stseg.config import BeliefConfig

LEAST_ROUNDS = 2
"""Rounds after which every node has received messages from every other."""


@dataclass(frozen=True)
class Star:
    """One target's beliefs in one frame."""

    ground: Particles
    """Metres."""
    views: tuple[Particles | None, ...]
    """Ideal pixels; None where a view does not follow the target."""
    visibility: Floats
    """float64 (view,): probability that each view sees it."""

    def place(self, j: int, view: StarView, prediction: Prediction) -> Floats:
        """Place predicted by view j if it follows the target, else by the ground, metres, float64 (2,)."""
        particles = self.views[j]
        if particles is None:
            return prediction.mean
        next_pixel = particles.mean + prediction.motion.seconds * particles.weight @ particles.velocity
        return np.asarray(view.to_ground(next_pixel[None])[0])


class Rounds:
    """The messages of one target in one frame.

    Parameters
    ----------
    star
        Beliefs of the frame before.
    likelihoods
        Colour likelihood in each view; None where it cannot show the target, which is a flat message.
    motion, config
        Motion model, and the constants.
    rng
        Random numbers.
    """

    def __init__(
        self,
        star: Star,
        likelihoods: Sequence[TargetLikelihood | None],
        motion: Motion,
        config: BeliefConfig,
        rng: np.random.Generator,
    ) -> None:
        self.config, self.rng, self.done = config, rng, 0
        self.prior = Prediction.of(star.ground, np.eye(2), motion)
        self.outlier = Outlier(config.outlier_rate, self.prior.mean, config.outlier_spread)
        self.leaves = grow(star, likelihoods, self.prior, config.particles)
        self.ground = self.prior.draw(config.particles, rng)
        self.weight = np.full(config.particles, 1 / config.particles)
        self.to_ground, self.to_view = self._flat_messages(), self._flat_messages()
        self.potentials: list[Potential | None] = []

    def _flat_messages(self) -> list[Floats]:
        return [np.ones(self.config.particles) for _ in self.leaves]

    @property
    def belief(self) -> Particles:
        """The current belief of the ground, without velocities."""
        return Particles(self.ground, np.zeros_like(self.ground), self.weight)

    def advance(self, others: Sequence[Particles]) -> float:
        """One round of messages, given the particles of other targets; returns the shift of the mean, metres."""
        before = self.belief.mean
        for leaf, rest in zip(self.leaves, self.to_view, strict=True):
            if leaf and self.done:
                leaf.follow_message(self.ground, rest, self.rng)
            elif leaf:
                leaf.follow(self.rng)
        self.ground, proposed = self._drawn()
        self.potentials = [leaf.potential(self.ground, self.outlier) if leaf else None for leaf in self.leaves]
        alone = self._importance(proposed) * exclusion(self.ground, others, self.config.minimum_distance)
        self.to_ground = [
            potential.to_ground(leaf.visible_belief)
            if leaf and potential
            else np.full(len(self.ground), self.outlier.flat)
            for leaf, potential in zip(self.leaves, self.potentials, strict=True)
        ]
        self.to_view = [self._product(alone, j) for j in range(len(self.leaves))]
        self.weight = self._product(alone, -1)
        self.done += 1
        return float(np.hypot(*(self.belief.mean - before)))

    def _drawn(self) -> tuple[Floats, int]:
        """Ground particles, the last of them drawn from the views' messages, and the number of those."""
        count, beliefs = self.config.particles, [leaf.visible_belief if leaf else np.zeros(0) for leaf in self.leaves]
        proposed = count // 2 if sum(float(s.sum()) for s in beliefs) > 0 else 0
        parts = [self.prior.draw(count - proposed, self.rng)]
        if proposed:
            chosen = systematic(np.concatenate(beliefs), proposed, self.rng.random())
            starts = np.cumsum([0, *(len(s) for s in beliefs)])
            for leaf, start, stop in zip(self.leaves, starts[:-1], starts[1:], strict=True):
                drawn = chosen[(chosen >= start) & (chosen < stop)] - start
                if leaf and len(drawn):
                    parts.append(leaf.draw_ground(drawn, self.rng))
        return np.concatenate(parts), proposed

    def _importance(self, proposed: int) -> Floats:
        """Importance weight of each ground particle: prior over proposal density, float64 (n,)."""
        prior, share = self.prior.density(self.ground), proposed / self.config.particles
        if not proposed:
            return np.ones(len(prior))
        pairs = [
            (psi, leaf.visible_belief) for leaf, psi in zip(self.leaves, self.potentials, strict=True) if leaf and psi
        ]
        message = sum(psi.inlier @ belief for psi, belief in pairs) / sum(float(belief.sum()) for _, belief in pairs)
        return np.asarray(prior / ((1 - share) * prior + share * message))

    def _product(self, alone: Floats, without: int) -> Floats:
        """Weights of the ground particles by all messages but that of view `without` (-1: by all); their sum is 1."""
        kept = [message for j, message in enumerate(self.to_ground) if j != without]
        log = np.log(np.maximum(alone, 1e-300)) + sum(np.log(message) for message in kept)
        weight = np.exp(log - log.max())
        return np.asarray(weight / weight.sum())

    def settled(self) -> Star:
        """The beliefs of the frame."""
        views, visibility = [], np.zeros(len(self.leaves))
        for j, (leaf, potential, rest) in enumerate(zip(self.leaves, self.potentials, self.to_view, strict=True)):
            views.append(leaf.settled(potential.to_view(rest), self.rng) if leaf and potential else None)
            if leaf and potential:
                visible = (1 - self.outlier.share) * (self.weight @ (potential.inlier @ leaf.visible_belief))
                visibility[j] = visible / (self.weight @ self.to_ground[j])
        return Star(self.prior.settled(self.ground, self.weight, self.rng), tuple(views), visibility)


def grow(
    star: Star, likelihoods: Sequence[TargetLikelihood | None], ground: Prediction, count: int
) -> list[Leaf | None]:
    """Leaves of the views in which the target can be visible."""
    leaves: list[Leaf | None] = []
    for j, (likelihood, particles) in enumerate(zip(likelihoods, star.views, strict=True)):
        if likelihood is None:
            leaves.append(None)
            continue
        place = star.place(j, likelihood.view, ground)
        prior = Prediction.of(
            particles or arrival(likelihood.view, ground), likelihood.view.pixel_slope(place), ground.motion
        )
        leaves.append(Leaf(likelihood, prior, place, count))
    return leaves


def propagate(
    stars: Sequence[Star],
    likelihoods: Sequence[Sequence[TargetLikelihood | None]],
    motion: Motion,
    config: BeliefConfig,
    rngs: Sequence[np.random.Generator],
) -> list[Star]:
    """One frame of all targets: rounds until the mean of each moves by less than `config.convergence_distance`.

    A round uses the other targets' beliefs of the round before, so the order of targets does not matter.
    """
    targets = [
        Rounds(star, likelihood, motion, config, rng)
        for star, likelihood, rng in zip(stars, likelihoods, rngs, strict=True)
    ]
    unconverged = list(range(len(targets)))
    for done in range(1, config.iterations + 1):
        beliefs = [target.belief for target in targets]
        shifts = [targets[k].advance([*beliefs[:k], *beliefs[k + 1 :]]) for k in unconverged]
        if done >= LEAST_ROUNDS:
            unconverged = [
                k for k, shift in zip(unconverged, shifts, strict=True) if shift > config.convergence_distance
            ]
        if not unconverged:
            break
    return [target.settled() for target in targets]
