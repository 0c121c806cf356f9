"""Refined places: the posterior of each person over a patch of ground.

The prior is the predicted track, if the person continues one; the evidence is what is assigned to the person alone. A
patch bounds the covariance, so it is widened where it does not hold the posterior: one view places a body along a ray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints, Shorts
from stseg.bodies.box_fit import add_own_fits
from stseg.bodies.views import BoxView, PixelView, TriedPillars
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.search.place_patches import PLACES, Patches
from stseg.records.candidates import Candidates

_WIDENINGS = 4
"""Times that a patch is widened at most: 1.3 m to either side, as one view needs."""
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

    def at(self, chosen: Ints) -> EvidenceAssignment:
        """That to the chosen, int64 (k,)."""
        return EvidenceAssignment(self.box[:, chosen], self.pixels, self.number[chosen])


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

    def with_others(self, chosen: Ints, others: RefinedPlaces) -> RefinedPlaces:
        """With those of the chosen, int64 (k,), replaced by others."""
        changed = {name: getattr(self, name).copy() for name in self.__dataclass_fields__}
        for name, values in changed.items():
            values[chosen] = getattr(others, name)
        return RefinedPlaces(**changed)


def refine_places_and_heights(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, track_index: Ints
) -> RefinedPlaces:
    """The posterior of each person's place and height, by the boxes and pixels assigned to each.

    `track_index` int64 (n,) is the predicted track that each person continues, -1 for births. Boxes of few views place
    a person along their rays, farther than the first patch reaches: it would bound the covariance.
    """
    patches = Patches.around(pool.ground)
    places = _places_and_heights(pool, evidence, assignment, track_index, patches)
    for _ in range(_WIDENINGS if any(isinstance(view, BoxView) for view in evidence.views) else 0):
        wide = np.flatnonzero(patches.is_narrow(places.covariance))
        if not len(wide):
            break
        wider = patches.at(wide).widened(places.covariance[wide])
        others = _places_and_heights(pool.at(wide), evidence, assignment.at(wide), track_index[wide], wider)
        places, patches = places.with_others(wide, others), patches.with_others(wide, wider)
    return places


def _places_and_heights(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, track_index: Ints, patches: Patches
) -> RefinedPlaces:
    heights, patch = _tried_heights(pool, evidence), patches.ground
    score, tracked = _scores(pool, evidence, assignment, heights, patch), np.flatnonzero(track_index >= 0)
    score[tracked] += evidence.prior.predicted.place_log_density(track_index[tracked], patch[tracked])[:, None]
    return _posterior(score, patches, heights)


def refine_places(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, track_index: Ints
) -> RefinedPlaces:
    """The posterior of each person's place alone, by pixels, at its height in the pool; arguments as above."""
    patches = Patches.around(pool.ground)
    patch = patches.ground
    heights, widths = (np.repeat(size[:, None], len(PLACES), 1) for size in (pool.height, pool.width))
    score = _pixel_scores(evidence, assignment, evidence.views[0].tried(patch, heights, widths))
    tracked = np.flatnonzero(track_index >= 0)
    score[tracked] += evidence.prior.predicted.place_log_density(track_index[tracked], patch[tracked])
    weight = np.exp(score - score.max(1, keepdims=True))
    weight /= weight.sum(1, keepdims=True)
    return RefinedPlaces(*patches.moments(weight), pool.height, np.zeros(len(pool)))


def _tried_heights(pool: Candidates, evidence: FrameEvidence) -> Floats:
    """Heights that are tried for each person, float64 (person, height), metres, rising."""
    if any(isinstance(view, BoxView) for view in evidence.views):
        return pool.height[:, None] * (1.0 + _HEIGHT_STEPS)
    heights = np.asarray(evidence.prior.body.heights)
    return np.tile(heights[::2] if len(heights) > _HEIGHT_LIMIT else heights, (len(pool), 1))


def _scores(
    pool: Candidates, evidence: FrameEvidence, assignment: EvidenceAssignment, heights: Floats, patch: Floats
) -> Floats:
    """Log-posterior of each person over heights and places of a patch as a birth, float64 (person, height, place)."""
    score = np.repeat(evidence.prior.log_height(heights)[..., None], len(PLACES), 2)
    if len(evidence.rasters):
        tall = np.tile(heights, (1, len(PLACES)))  # heights are inner: each place is looked up once
        places, widths = np.repeat(patch, heights.shape[1], 1), np.repeat(pool.width[:, None], tall.shape[1], 1)
        of_pillar = _pixel_scores(evidence, assignment, evidence.views[0].tried(places, tall, widths))
        score += of_pillar.reshape(len(pool), len(PLACES), heights.shape[1]).transpose(0, 2, 1)
    if len(pool) and any(isinstance(view, BoxView) for view in evidence.views):
        score += _box_scores(patch, evidence, assignment.box, heights)
    return score


def _box_scores(patch: Floats, evidence: FrameEvidence, box: Ints, heights: Floats) -> Floats:
    """Its part by boxes, `box` int64 (view, person), nats: found once for those who keep their place and boxes."""
    placed = np.column_stack([patch[:, 0], patch[:, 1], patch[:, -1], heights, box.T])
    names, known = [row.tobytes() for row in placed], evidence.box_scores
    new = [j for j, name in enumerate(names) if name not in known]
    score = np.zeros((len(new), heights.shape[1], len(PLACES)))
    for view, observation, own_box in zip(evidence.views, evidence.observations, box, strict=True):
        if isinstance(view, BoxView) and observation is not None:
            boxes, least = view.boxes(observation), _MINIMUM_BOX_LOG_LIKELIHOOD
            add_own_fits(view.table, patch[new], heights[new], own_box[new], boxes, least, score)
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


def _posterior(score: Floats, patches: Patches, heights: Floats) -> RefinedPlaces:
    """Means and variances from scores (person, height, place) of patches and heights, metres."""
    weight = np.exp(score - score.max((1, 2), keepdims=True))
    total = weight.reshape(len(score), heights.shape[1] * len(PLACES)).sum(1)[:, None]
    of_place, of_height = weight.sum(1) / total, weight.sum(2) / total
    height = (of_height * heights).sum(1)
    variance = (of_height * (heights - height[:, None]) ** 2).sum(1)
    return RefinedPlaces(*patches.moments(of_place), height, variance)
