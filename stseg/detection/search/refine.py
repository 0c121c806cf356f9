"""Refined places: the posterior of each person over a small patch of ground.

The prior is the predicted track, if the person continues one; the evidence is what is assigned to the person alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints, Shorts
from stseg.bodies.box_fit import add_own_fits
from stseg.bodies.views import BoxView, PixelView, TriedPillars
from stseg.detection.frame_evidence import FrameEvidence
from stseg.records.candidates import Candidates

_PATCH_SPACING = 0.08
"""Spacing of the patch, metres: a third of the offset of two lattice places."""
_AXIS = np.arange(-2, 3) * _PATCH_SPACING
_PATCH = np.stack(np.meshgrid(_AXIS, _AXIS), -1).reshape(-1, 2)
_HEIGHT_STEPS = 0.03 * np.arange(-3, 4)
"""Steps from a candidate's height, in shares of it: those of the search, 0.1 m, would attract all heights between."""
_HEIGHT_LIMIT = 4
"""Where pixels show the height afterwards (`body_sizes`), every other of more heights is enough here."""
_MINIMUM_BOX_LOG_LIKELIHOOD = -8.0
"""Least log-likelihood of a box in a person's posterior, nats: below it the assignment itself is in doubt."""


@dataclass(frozen=True)
class EvidenceAssignment:
    """Boxes and pixels assigned to each of some people."""

    box: Ints
    """int64 (view, person): the box of each; -1 for none, and in views with pixels."""
    pixels: Sequence[Shorts]
    """sequence of int16 (v, u), one a view: the number of the person that each raster pixel is assigned to, -1 for
    none: those are open to everyone. Not read for views with boxes."""
    number: Ints
    """int64 (person,): the number of each, by which pixels name them; others have numbers, too."""

    @classmethod
    def of_all(cls, box: Ints, pixels: Sequence[Shorts]) -> EvidenceAssignment:
        """The assignment to people who are numbered as they stand."""
        return cls(box, pixels, np.arange(box.shape[1]))


@dataclass(frozen=True)
class RefinedPlaces:
    """Marginal posteriors of people's places and heights; of places alone, heights are those given."""

    ground: Floats
    """float64 (n, 2): place, marginalised over height, metres."""
    covariance: Floats
    """float64 (n, 2, 2): covariance of the place, marginalised over height, square metres."""
    height: Floats
    """float64 (n,): marginalised over place, under the population prior, metres."""
    height_variance: Floats
    """float64 (n,): variance of the height, marginalised likewise, square metres."""


def refine_places_and_heights(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, track_index: Ints
) -> RefinedPlaces:
    """The posterior of each person's place and height, by the boxes and pixels assigned to each.

    `track_index` int64 (n,) is the predicted track that each person continues, -1 for births.
    """
    heights, patch = _tried_heights(pool, evidence), pool.ground[:, None] + _PATCH
    score, tracked = _scores(pool, evidence, assignment, heights), np.flatnonzero(track_index >= 0)
    score[tracked] += evidence.prior.predicted.place_log_density(track_index[tracked], patch[tracked])[:, None]
    return _posterior(score, patch, heights)


def _tried_heights(pool: Candidates, evidence: FrameEvidence) -> Floats:
    """Heights that are tried for each person, float64 (person, height), metres, rising."""
    if any(isinstance(view, BoxView) for view in evidence.views):
        return pool.height[:, None] * (1.0 + _HEIGHT_STEPS)
    heights = np.asarray(evidence.prior.body.heights)
    return np.tile(heights[::2] if len(heights) > _HEIGHT_LIMIT else heights, (len(pool), 1))


def refine_places(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, track_index: Ints
) -> RefinedPlaces:
    """The posterior of each person's place alone, by pixels, at its height in the pool; arguments as above."""
    patch = pool.ground[:, None] + _PATCH
    heights, widths = (np.repeat(size[:, None], len(_PATCH), 1) for size in (pool.height, pool.width))
    score = _pixel_scores(evidence, assignment, evidence.views[0].tried(patch, heights, widths))
    tracked = np.flatnonzero(track_index >= 0)
    score[tracked] += evidence.prior.predicted.place_log_density(track_index[tracked], patch[tracked])
    weight = np.exp(score - score.max(1, keepdims=True))
    weight /= weight.sum(1, keepdims=True)
    return RefinedPlaces(*_moments(weight, patch), pool.height, np.zeros(len(pool)))


def _scores(pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, heights: Floats) -> Floats:
    """Log-posterior of each person over heights and places of a patch as a birth, float64 (person, height, place)."""
    score = np.repeat(evidence.prior.log_height(heights)[..., None], len(_PATCH), 2)
    if len(evidence.rasters):
        patch, tall = pool.ground[:, None] + _PATCH, np.repeat(heights, len(_PATCH), 1)  # places are inner
        places, widths = np.tile(patch, (1, heights.shape[1], 1)), np.repeat(pool.width[:, None], tall.shape[1], 1)
        pillars = evidence.views[0].tried(places, tall, widths)
        score += _pixel_scores(evidence, assignment, pillars).reshape(score.shape)
    if len(pool) and any(isinstance(view, BoxView) for view in evidence.views):
        score += _box_scores(pool, evidence, assignment.box, heights)
    return score


def _box_scores(pool: Candidates, evidence: FrameEvidence, box: Ints, heights: Floats) -> Floats:
    """Its part by boxes, `box` int64 (view, person), nats: found once for those who keep their place and boxes."""
    names, known = [row.tobytes() for row in np.column_stack([pool.ground, heights, box.T])], evidence.box_scores
    new = [j for j, name in enumerate(names) if name not in known]
    patch, score = pool.ground[new, None] + _PATCH, np.zeros((len(new), heights.shape[1], len(_PATCH)))
    for view, observation, own_box in zip(evidence.views, evidence.observations, box, strict=True):
        if isinstance(view, BoxView) and observation is not None:
            boxes, least = view.boxes(observation), _MINIMUM_BOX_LOG_LIKELIHOOD
            add_own_fits(view.table, patch, heights[new], own_box[new], boxes, least, score)
    known.update(zip((names[j] for j in new), score, strict=True))
    return np.stack([known[name] for name in names])


def _pixel_scores(evidence: FrameEvidence, assignment: EvidenceAssignment, pillars: TriedPillars) -> Floats:
    """Log-likelihood of pillars in the views that deliver pixels, nats, float64 (person, pillar)."""
    score = np.zeros_like(pillars.height)
    pairs = zip(evidence.views, evidence.observations, assignment.pixels, strict=True)
    for view, observation, owner in pairs:
        if isinstance(view, PixelView) and observation is not None and len(score):
            sums, area = view.open_sums(observation.raster, owner, assignment.number, pillars)
            score += np.divide(sums, area, out=np.zeros_like(sums), where=area > 0)
    return score


def _posterior(score: Floats, patch: Floats, heights: Floats) -> RefinedPlaces:
    """Means and variances from scores (person, height, place) of patches (person, place, 2) and heights, metres."""
    weight = np.exp(score - score.max((1, 2), keepdims=True))
    total = weight.reshape(len(score), heights.shape[1] * patch.shape[1]).sum(1)[:, None]
    of_place, of_height = weight.sum(1) / total, weight.sum(2) / total
    height = (of_height * heights).sum(1)
    variance = (of_height * (heights - height[:, None]) ** 2).sum(1)
    return RefinedPlaces(*_moments(of_place, patch), height, variance)


def _moments(weight: Floats, patch: Floats) -> tuple[Floats, Floats]:
    """Means and covariances of places (person, place, 2) by their weights, with that of the spacing; metres."""
    ground = np.matmul(weight[:, None], patch)[:, 0]
    offset = patch - ground[:, None]
    covariance = np.matmul((offset * weight[..., None]).transpose(0, 2, 1), offset)
    return ground, covariance + np.eye(2) * _PATCH_SPACING**2 / 12
