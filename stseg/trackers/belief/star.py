"""Belief propagation on a target's star graph, the ground and a leaf for each view (Du and Piater 2006, section 3.1).

The graph is a tree, on which two rounds would do; with particles a few more bring them to where the belief is. A
round passes messages up, from the views to the ground (eq. 8), and down (eq. 9):

    m_0j(g) = sum_m a_jm psi_j(g, x_jm)                  a_jm ~ p_j(z | x_jm) prior_j(x_jm) / q_j(x_jm)
    m_j0(x) = sum_n c_jn psi_j(g_n, x)                   c_jn ~ prior_0(g_n) / q_0(g_n) e(g_n) prod_(l != j) m_0l(g_n)

with q the density that particles were drawn from, half from their own prior and half from the other side's messages of
the round before, and e the messages of other targets (`exclusion`). Beliefs are (eqs 10, 11)

    b_j(x_jm) ~ a_jm m_j0(x_jm)                          b_0(g_n) ~ prior_0(g_n) / q_0(g_n) e(g_n) prod_l m_0l(g_n)

The view's own prior is in its belief, as it is in its message; the paper's eq. 10 leaves it out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.config import BeliefConfig
from stseg.trackers.belief.exclusion import exclusion
from stseg.trackers.belief.leaf import Leaf, arrival
from stseg.trackers.belief.look import TargetLikelihood
from stseg.trackers.belief.particles import Motion, Particles, Prediction, systematic
from stseg.trackers.belief.potential import Outlier, Tie
from stseg.trackers.belief.view import StarView

LEAST_ROUNDS = 2
"""Rounds after which every node has received messages from every other."""


@dataclass(frozen=True)
class Star:
    """One target's beliefs in one frame.

    Attributes
    ----------
    ground
        Metres.
    views
        Ideal pixels; None where a view does not follow the target.
    sight : float64 (view,)
        How surely each view sees it, 0..1.
    """

    ground: Particles
    views: tuple[Particles | None, ...]
    sight: Floats

    def place(self, j: int, view: StarView, foretold: Prediction) -> Floats:
        """Prediction of view j if it has one, else of the ground, metres, float64 (2,)."""
        own = self.views[j]
        if own is None:
            return foretold.mean
        next_pixel = own.mean + foretold.motion.seconds * own.weight @ own.velocity
        return np.asarray(view.to_ground(next_pixel[None])[0])


class Rounds:
    """The messages of one target in one frame.

    Parameters
    ----------
    star
        The frame before.
    looks
        What each view shows; None where it cannot show the target, which is a flat message.
    motion, config
        How people walk, and the constants.
    lots
        Where chance comes from.
    """

    def __init__(
        self,
        star: Star,
        looks: Sequence[TargetLikelihood | None],
        motion: Motion,
        config: BeliefConfig,
        lots: np.random.Generator,
    ) -> None:
        self.config, self.lots, self.done = config, lots, 0
        self.prior = Prediction.of(star.ground, np.eye(2), motion)
        self.outlier = Outlier(config.outlier_rate, self.prior.mean, config.outlier_spread)
        self.leaves = grow(star, looks, self.prior, config.particles)
        self.ground = self.prior.draw(config.particles, lots)
        self.weight = np.full(config.particles, 1 / config.particles)
        self.to_ground, self.to_view = self._silence(), self._silence()
        self.ties: list[Tie | None] = []

    def _silence(self) -> list[Floats]:
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
                leaf.follow_message(self.ground, rest, self.lots)
            elif leaf:
                leaf.follow(self.lots)
        self.ground, told = self._drawn()
        self.ties = [leaf.tie(self.ground, self.outlier) if leaf else None for leaf in self.leaves]
        alone = self._importance(told) * exclusion(self.ground, others, self.config.minimum_distance)
        self.to_ground = [
            tie.to_ground(leaf.seen) if leaf and tie else np.full(len(self.ground), self.outlier.flat)
            for leaf, tie in zip(self.leaves, self.ties, strict=True)
        ]
        self.to_view = [self._product(alone, j) for j in range(len(self.leaves))]
        self.weight = self._product(alone, -1)
        self.done += 1
        return float(np.hypot(*(self.belief.mean - before)))

    def _drawn(self) -> tuple[Floats, int]:
        """Ground particles, the last of them where views send them, and how many those are."""
        count, seen = self.config.particles, [leaf.seen if leaf else np.zeros(0) for leaf in self.leaves]
        told = count // 2 if sum(float(s.sum()) for s in seen) > 0 else 0
        parts = [self.prior.draw(count - told, self.lots)]
        if told:
            chosen = systematic(np.concatenate(seen), told, self.lots.random())
            starts = np.cumsum([0, *(len(s) for s in seen)])
            for leaf, start, stop in zip(self.leaves, starts[:-1], starts[1:], strict=True):
                own = chosen[(chosen >= start) & (chosen < stop)] - start
                if leaf and len(own):
                    parts.append(leaf.draw_ground(own, self.lots))
        return np.concatenate(parts), told

    def _importance(self, told: int) -> Floats:
        """How much likelier the prior makes each ground particle than the way it was drawn, float64 (n,)."""
        prior, share = self.prior.density(self.ground), told / self.config.particles
        if not told:
            return np.ones(len(prior))
        pairs = [(tie, leaf.seen) for leaf, tie in zip(self.leaves, self.ties, strict=True) if leaf and tie]
        sent = sum(tie.inlier @ seen for tie, seen in pairs) / sum(float(seen.sum()) for _, seen in pairs)
        return np.asarray(prior / ((1 - share) * prior + share * sent))

    def _product(self, alone: Floats, without: int) -> Floats:
        """Weights of the ground's particles by all messages but one view's; their sum is 1."""
        kept = [message for j, message in enumerate(self.to_ground) if j != without]
        log = np.log(np.maximum(alone, 1e-300)) + sum(np.log(message) for message in kept)
        weight = np.exp(log - log.max())
        return np.asarray(weight / weight.sum())

    def settled(self) -> Star:
        """The beliefs of the frame."""
        views, sight = [], np.zeros(len(self.leaves))
        for j, (leaf, tie, rest) in enumerate(zip(self.leaves, self.ties, self.to_view, strict=True)):
            views.append(leaf.settled(tie.to_view(rest), self.lots) if leaf and tie else None)
            if leaf and tie:
                through = (1 - self.outlier.share) * (self.weight @ (tie.inlier @ leaf.seen))
                sight[j] = through / (self.weight @ self.to_ground[j])
        return Star(self.prior.settled(self.ground, self.weight, self.lots), tuple(views), sight)


def grow(star: Star, looks: Sequence[TargetLikelihood | None], ground: Prediction, count: int) -> list[Leaf | None]:
    """Leaves of the views in which the target can be visible."""
    leaves: list[Leaf | None] = []
    for j, (look, particles) in enumerate(zip(looks, star.views, strict=True)):
        if look is None:
            leaves.append(None)
            continue
        place = star.place(j, look.view, ground)
        prior = Prediction.of(particles or arrival(look.view, ground), look.view.pixel_slope(place), ground.motion)
        leaves.append(Leaf(look, prior, place, count))
    return leaves


def propagate(
    stars: Sequence[Star],
    looks: Sequence[Sequence[TargetLikelihood | None]],
    motion: Motion,
    config: BeliefConfig,
    lots: Sequence[np.random.Generator],
) -> list[Star]:
    """One frame of all targets: rounds until each one's ground moves by less than `config.settled`.

    In a round every target hears where the others believed to be in the round before, so their order does not matter.
    """
    targets = [Rounds(star, seen, motion, config, lot) for star, seen, lot in zip(stars, looks, lots, strict=True)]
    open_still = list(range(len(targets)))
    for done in range(1, config.iterations + 1):
        heard = [target.belief for target in targets]
        moved = [targets[k].advance([*heard[:k], *heard[k + 1 :]]) for k in open_still]
        if done >= LEAST_ROUNDS:
            open_still = [k for k, way in zip(open_still, moved, strict=True) if way > config.convergence_distance]
        if not open_still:
            break
    return [target.settled() for target in targets]
