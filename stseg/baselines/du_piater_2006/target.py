"""A target: a star and its colour models, which give p(z | x) of each view (Du and Piater 2006, eqs 8 to 11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.baselines.du_piater_2006.histogram import histograms
from stseg.baselines.du_piater_2006.particles import Motion, Particles, Prediction
from stseg.baselines.du_piater_2006.star import Star
from stseg.baselines.du_piater_2006.target_likelihood import TargetLikelihood
from stseg.baselines.du_piater_2006.view import StarView
from stseg.config import BeliefConfig

_VISIBLE = 0.8
"""Least visible share of every body part for its colours to be learned."""
_INSIDE = 0.5
"""Share of a body's box that must lie within an image for the view to be used."""


@dataclass
class Target:
    """A tracked person."""

    track: int
    """Its track id."""
    star: Star
    """Its beliefs on the ground and in the views."""
    height: float
    """Metres."""
    colours: list[Floats | None]
    """For each view float64 (part, bin), or None where the target was never fully visible."""
    found: int = 1
    missed: int = 0
    """Frames with a detection assigned to it, and frames since the last of them."""

    @classmethod
    def at(
        cls,
        track: int,
        ground: Floats,
        covariance: Floats,
        height: float,
        views: int,
        count: int,
        speed_spread: float,
        rng: np.random.Generator,
    ) -> Target:
        """A birth at a place (2,) with a covariance (2, 2), any velocity, and no colour model."""
        place = rng.multivariate_normal(ground, covariance, count, method="cholesky")
        velocity = speed_spread * rng.standard_normal((count, 2))
        belief = Particles(place, velocity, np.full(count, 1 / count))
        return cls(track, Star(belief, (None,) * views, np.zeros(views)), height, [None] * views)

    def prediction(self, motion: Motion) -> Prediction:
        """Prediction of the ground for the next frame."""
        return Prediction.of(self.star.ground, np.eye(2), motion)

    def learn(
        self,
        views: Sequence[StarView],
        images: Sequence[Bytes | None],
        ground: Floats,
        nearer: Sequence[Floats],
        share: float,
    ) -> None:
        """Update the colour models at a known place (2,), from views with full visibility.

        `nearer` are, for each view, boxes of people in front of the target; `share` is the learning rate.
        """
        for j, (view, image) in enumerate(zip(views, images, strict=True)):
            if image is None:
                continue
            colours, visibility = histograms(image, view.boxes(ground[None], self.height), nearer[j])
            if visibility[0].min() >= _VISIBLE:
                learned = self.colours[j]
                self.colours[j] = colours[0] if learned is None else (1 - share) * learned + share * colours[0]


def in_front(targets: Floats, heights: Floats, view: StarView) -> list[Floats]:
    """For each person the boxes (k, 4) of nearer people that overlap its own, pixels.

    People have ground points (n, 2) and heights (n,), metres.
    """
    boxes = np.array(
        [view.boxes(place[None], height)[0] for place, height in zip(targets, heights, strict=True)]
    ).reshape(-1, 4)
    distance = np.hypot(*(targets - view.centre).T) if len(targets) else np.zeros(0)
    low, high = boxes[:, :2], boxes[:, 2:]
    overlap = np.all((low[:, None] < high) & (low < high[:, None]), axis=2)
    return [boxes[overlap[k] & (distance < distance[k])] for k in range(len(targets))]


def target_likelihoods(
    targets: Sequence[Target],
    views: Sequence[StarView],
    images: Sequence[Bytes | None],
    motion: Motion,
    config: BeliefConfig,
) -> list[list[TargetLikelihood | None]]:
    """Colour likelihoods of each target in each view of the next frame."""
    predictions = [target.prediction(motion) for target in targets]
    heights = np.array([target.height for target in targets])
    found: list[list[TargetLikelihood | None]] = [[] for _ in targets]
    for j, (view, image) in enumerate(zip(views, images, strict=True)):
        places = [t.star.place(j, view, prediction) for t, prediction in zip(targets, predictions, strict=True)]
        ground = np.array(places).reshape(-1, 2)
        nearer = in_front(ground, heights, view)
        for k, target in enumerate(targets):
            colours = target.colours[j]
            if image is None or colours is None or not view.shows(ground[k], target.height, _INSIDE):
                found[k].append(None)
            else:
                found[k].append(TargetLikelihood(view, image, colours, target.height, nearer[k], config))
    return found
