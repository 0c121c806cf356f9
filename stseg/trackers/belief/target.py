"""A target: a star, its colour model in each view, and the time since its last detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.config import BeliefConfig
from stseg.trackers.belief.histogram import histograms
from stseg.trackers.belief.look import TargetLikelihood
from stseg.trackers.belief.particles import Motion, Particles, Prediction
from stseg.trackers.belief.star import Star
from stseg.trackers.belief.view import StarView

_WHOLE = 0.8
"""Share of a body that must be in sight for its colours to be learned."""
_IN_SIGHT = 0.5
"""Share of a body's box that must lie within an image for the view to be used."""


@dataclass
class Target:
    """A tracked person.

    Attributes
    ----------
    track
        Its number.
    star
        Where it is believed to be.
    height
        Metres.
    colours
        For each view float64 (part, bin), or None where it was never seen whole.
    found, missed
        Frames in which a detection was it, and those since the last of them.
    """

    track: int
    star: Star
    height: float
    colours: list[Floats | None]
    found: int = 1
    missed: int = 0

    @classmethod
    def at(
        cls, track: int, ground: Floats, covariance: Floats, height: float, views: int, count: int,
        speed_spread: float, lots: np.random.Generator,
    ) -> Target:  # fmt: skip
        """A birth at a place (2,) with a covariance (2, 2), any velocity, and no colour model."""
        place = lots.multivariate_normal(ground, covariance, count, method="cholesky")
        velocity = speed_spread * lots.standard_normal((count, 2))
        believed = Particles(place, velocity, np.full(count, 1 / count))
        return cls(track, Star(believed, (None,) * views, np.zeros(views)), height, [None] * views)

    def foretold(self, motion: Motion) -> Prediction:
        """Prediction of the ground for the next frame."""
        return Prediction.of(self.star.ground, np.eye(2), motion)

    def learn(
        self, views: Sequence[StarView], images: Sequence[Bytes | None], ground: Floats, nearer: Sequence[Floats],
        share: float,
    ) -> None:  # fmt: skip
        """Update the colour models at a known place (2,), from views with full visibility.

        `nearer` are, for each view, boxes of those in front of it; `share` is how much of a known colour is replaced.
        """
        for j, (view, image) in enumerate(zip(views, images, strict=True)):
            if image is None:
                continue
            colours, sight = histograms(image, view.boxes(ground[None], self.height), nearer[j])
            if sight[0].min() >= _WHOLE:
                known = self.colours[j]
                self.colours[j] = colours[0] if known is None else (1 - share) * known + share * colours[0]


def in_front(targets: Floats, heights: Floats, view: StarView) -> list[Floats]:
    """For each of several people the boxes (k, 4) of those in front of it that overlap its own, pixels.

    They stand at ground points (n, 2) and are of heights (n,), metres.
    """
    boxes = np.array(
        [view.boxes(place[None], height)[0] for place, height in zip(targets, heights, strict=True)]
    ).reshape(-1, 4)
    away = np.hypot(*(targets - view.eye).T) if len(targets) else np.zeros(0)
    low, high = boxes[:, :2], boxes[:, 2:]
    met = np.all((low[:, None] < high) & (low < high[:, None]), axis=2)
    return [boxes[met[k] & (away < away[k])] for k in range(len(targets))]


def looks(
    targets: Sequence[Target],
    views: Sequence[StarView],
    images: Sequence[Bytes | None],
    motion: Motion,
    config: BeliefConfig,
) -> list[list[TargetLikelihood | None]]:
    """Colour likelihoods of each target in each view of the next frame."""
    foretold = [target.foretold(motion) for target in targets]
    heights = np.array([target.height for target in targets])
    found: list[list[TargetLikelihood | None]] = [[] for _ in targets]
    for j, (view, image) in enumerate(zip(views, images, strict=True)):
        places = [t.star.place(j, view, coming) for t, coming in zip(targets, foretold, strict=True)]
        ground = np.array(places).reshape(-1, 2)
        nearer = in_front(ground, heights, view)
        for k, target in enumerate(targets):
            colours = target.colours[j]
            if image is None or colours is None or not view.shows(ground[k], target.height, _IN_SIGHT):
                found[k].append(None)
            else:
                found[k].append(TargetLikelihood(view, image, colours, target.height, nearer[k], config))
    return found
