"""A leaf of the star: one view's particles in one frame."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.trackers.belief.look import TargetLikelihood
from stseg.trackers.belief.particles import Motion, Particles, Prediction, systematic
from stseg.trackers.belief.potential import Outlier, Tie
from stseg.trackers.belief.view import StarView


class Leaf:
    """One view of one target while a frame's messages pass.

    Parameters
    ----------
    look
        What the view shows.
    prior
        What the view's own particles of the frame before foretell, ideal pixels.
    place : float64 (2,)
        Where on the ground the target is about, metres.
    count
        Number of particles.

    Attributes
    ----------
    place : float64 (m, 2)
        The particles, ideal pixels.
    mapped, covariance : float64 (m, 2), (m, 2, 2)
        The same on the ground, metres, square metres.
    belief, seen : float64 (m,)
        Weights of the belief before any message, whose sum is 1; and the part of each in which the view sees it.
    """

    def __init__(self, look: TargetLikelihood, prior: Prediction, place: Floats, count: int) -> None:
        self.look, self.prior, self.count = look, prior, count
        box = look.view.boxes(place[None], look.height)[0]
        tall = box[3] - box[1]
        self.noise = look.config.foot_noise * float(tall if np.isfinite(tall) else look.view.camera.size[1])
        self.place = self.mapped = np.zeros((0, 2))
        self.covariance = np.zeros((0, 2, 2))
        self.belief = self.seen = np.zeros(0)

    def follow(self, lots: np.random.Generator) -> None:
        """Particles drawn from the view's own prediction."""
        self._weigh(self.prior.draw(self.count, lots), np.ones(self.count))

    def follow_message(self, ground: Floats, weight: Floats, lots: np.random.Generator) -> None:
        """Half of the particles there, half where the ground's message sends them: its particles (n, 2) and weights.

        Each then counts by how much likelier the prior makes it than this way to draw it did.
        """
        told = self.count // 2
        pixel = self.look.view.to_pixel(ground)
        chosen = systematic(weight, told, lots.random())
        sent = pixel[chosen] + self.noise * lots.standard_normal((told, 2))
        place = np.concatenate([self.prior.draw(self.count - told, lots), sent])
        still = Motion(1.0, self.noise, 0.0)
        message = Prediction(pixel, np.zeros_like(pixel), weight / weight.sum(), np.eye(2), still).density(place)
        prior = self.prior.density(place)
        share = told / self.count
        self._weigh(place, prior / ((1 - share) * prior + share * message))

    def _weigh(self, place: Floats, importance: Floats) -> None:
        view = self.look.view
        self.place, self.mapped = place, view.to_ground(place)
        slope = self.noise * view.ground_slope(place)
        self.covariance = slope @ slope.transpose(0, 2, 1)
        likelihood, share = self.look.likelihood(self.mapped)
        total = float(importance @ (likelihood + self.look.hidden))
        self.belief = importance * (likelihood + self.look.hidden) / total
        self.seen = importance * likelihood * share / total

    def tie(self, ground: Floats, outlier: Outlier) -> Tie:
        """Its potential with ground particles (n, 2)."""
        return Tie.of(ground, self.mapped, self.covariance, outlier)

    def draw_ground(self, chosen: Ints, lots: np.random.Generator) -> Floats:
        """Ground points of the particles of these indices (k,), float64 (k, 2)."""
        off = self.noise * lots.standard_normal((len(chosen), 2))
        slope = self.look.view.ground_slope(self.place[chosen])
        return np.asarray(self.mapped[chosen] + np.einsum("kij,kj->ki", slope, off))

    def settled(self, message: Floats, lots: np.random.Generator) -> Particles:
        """The belief after a message (m,) from the ground (Du and Piater 2006, equation 10)."""
        weight = self.belief * message
        return self.prior.settled(self.place, weight / weight.sum(), lots)


def arrival(view: StarView, ground: Prediction) -> Particles:
    """Particles in a view that did not follow the target until now, from what the ground foretells.

    They stand a frame earlier, as those of other views do.
    """
    earlier = ground.centre - ground.motion.seconds * ground.velocity
    slope = view.pixel_slope(ground.mean)
    return Particles(view.to_pixel(earlier), ground.velocity @ slope.T, ground.weight)
