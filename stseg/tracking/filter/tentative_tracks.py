"""Tentative tracks: candidates that a frame rejects, whose evidence adds up if the next frame shows them again."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Floats, ViewEvidence
from stseg.config import BodyConfig
from stseg.geometry.distances import distances
from stseg.records.people import People
from stseg.records.sizes import is_rare_height, log_population_height

_LEAST_LOG_ODDS = -6.0
"""Log-odds below which a rejected candidate starts no tentative track, nats; without what a rare height costs where all
views deliver pixels: broken boxes show rare heights, frame after frame."""
_REPEATED_EVIDENCE = 2.0
"""Part of a rejected candidate's evidence that the next frame repeats, nats: in rigs with boxes, where a detector's
errors last, and by fewer than `SURE_VIEWS`, where ghosts last in which two silhouettes meet."""
SURE_VIEWS = 3
"""Views of pixels with evidence for a candidate from which it adds up in full: three lines seldom meet by chance."""
EXCLUSION_RADIUS = 0.5
"""Radius around other tracks within which no place is interpolated, and no tentative track begins whose evidence the
next frame repeats, metres."""
_SURE_RADIUS = 0.35
"""Radius within which no tentative track begins whose evidence adds up in full, metres: crowds nearly touch."""


def tentative_log_odds(
    ghosts: People, standing: Floats, evidence: Sequence[ViewEvidence], body: BodyConfig
) -> dict[int, float]:
    """Log-odds of the rejected candidates that become tentative tracks, by their index, nats.

    None begins near the places of other tracks, `standing` float64 (n, 2), metres. `evidence` is that of the views,
    `body` the population.
    """
    has_boxes = any(isinstance(view, Boxes) for view in evidence)
    is_repeated = has_boxes | ((ghosts.view_evidence != 0).sum(0) < SURE_VIEWS)
    log_odds = ghosts.evidence - np.where(is_repeated, _REPEATED_EVIDENCE, 0.0)
    distance = distances(ghosts.ground, standing).min(1, initial=np.inf)
    is_apart = distance >= np.where(is_repeated, EXCLUSION_RADIUS, _SURE_RADIUS)
    is_rare = is_rare_height(ghosts.height, body) & (not has_boxes)
    rare = np.where(is_rare, log_population_height(ghosts.height, body), 0.0)
    return {j: float(log_odds[j]) for j in np.flatnonzero(is_apart & (log_odds - rare > _LEAST_LOG_ODDS)).tolist()}
