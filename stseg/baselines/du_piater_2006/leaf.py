"""A leaf of the star: one view's particles in one frame, and its message (Du and Piater 2006, eqs 8 to 11)."""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.baselines.du_piater_2006.particles import Motion, Particles, Prediction, systematic
from stseg.baselines.du_piater_2006.potential import Outlier, Potential
from stseg.baselines.du_piater_2006.target_likelihood import TargetLikelihood
from stseg.baselines.du_piater_2006.view import StarView


class Leaf:
    """One view of one target while a frame's messages pass.

    Parameters
    ----------
    likelihood
        Colour likelihood of the target in the view.
    prior
        Prediction from the view's own particles of the frame before, ideal pixels.
    place : float64 (2,)
        Predicted ground point of the target, metres: the scale of its foot noise in pixels follows from it.
    count
        Number of particles.
    """

    def __init__(self, likelihood: TargetLikelihood, prior: Prediction, place: Floats, count: int) -> None:
        self.likelihood, self.prior, self.count = likelihood, prior, count
        box = likelihood.view.boxes(place[None], likelihood.height)[0]
        tall = box[3] - box[1]
        self.noise = likelihood.config.foot_noise * float(tall if np.isfinite(tall) else likelihood.view.camera.size[1])
        self.place = self.mapped = np.zeros((0, 2))
        """float64 (m, 2): the particles, ideal pixels."""
        self.covariance = np.zeros((0, 2, 2))
        """float64 (m, 2), (m, 2, 2): the same on the ground, metres, square metres."""
        self.belief = self.visible_belief = np.zeros(0)
        """float64 (m,): weights of the belief before any message, whose sum is 1; and the part of each for a visible
        target."""

    def follow(self, rng: np.random.Generator) -> None:
        """Draw the particles from the view's own prediction."""
        self._weigh(self.prior.draw(self.count, rng), np.ones(self.count))

    def follow_message(self, ground: Floats, weight: Floats, rng: np.random.Generator) -> None:
        """Draw half of the particles from the prediction, half from the message of the ground.

        The ground has particles (n, 2) with weights (n,). Importance weights are prior over proposal density.
        """
        proposed = self.count // 2
        pixel = self.likelihood.view.to_pixel(ground)
        chosen = systematic(weight, proposed, rng.random())
        drawn = pixel[chosen] + self.noise * rng.standard_normal((proposed, 2))
        place = np.concatenate([self.prior.draw(self.count - proposed, rng), drawn])
        still = Motion(1.0, self.noise, 0.0)
        message = Prediction(pixel, np.zeros_like(pixel), weight / weight.sum(), np.eye(2), still).density(place)
        prior = self.prior.density(place)
        share = proposed / self.count
        self._weigh(place, prior / ((1 - share) * prior + share * message))

    def _weigh(self, place: Floats, importance: Floats) -> None:
        view = self.likelihood.view
        self.place, self.mapped = place, view.to_ground(place)
        slope = self.noise * view.ground_slope(place)
        self.covariance = slope @ slope.transpose(0, 2, 1)
        visible, share = self.likelihood.likelihood(self.mapped)
        total = float(importance @ (visible + self.likelihood.hidden))
        self.belief = importance * (visible + self.likelihood.hidden) / total
        self.visible_belief = importance * visible * share / total

    def potential(self, ground: Floats, outlier: Outlier) -> Potential:
        """The potential between ground particles (n, 2) and this view's."""
        return Potential.of(ground, self.mapped, self.covariance, outlier)

    def draw_ground(self, chosen: Ints, rng: np.random.Generator) -> Floats:
        """Ground points drawn around the particles of these indices (k,), float64 (k, 2)."""
        deviation = self.noise * rng.standard_normal((len(chosen), 2))
        slope = self.likelihood.view.ground_slope(self.place[chosen])
        return np.asarray(self.mapped[chosen] + np.einsum("kij,kj->ki", slope, deviation))

    def settled(self, message: Floats, rng: np.random.Generator) -> Particles:
        """The belief after a message (m,) from the ground (Du and Piater 2006, equation 10)."""
        weight = self.belief * message
        return self.prior.settled(self.place, weight / weight.sum(), rng)


def arrival(view: StarView, ground: Prediction) -> Particles:
    """Particles in a view that begins to follow the target, from the ground's prediction.

    They are of the frame before, as those of other views are.
    """
    earlier = ground.centre - ground.motion.seconds * ground.velocity
    slope = view.pixel_slope(ground.mean)
    return Particles(view.to_pixel(earlier), ground.velocity @ slope.T, ground.weight)
