"""Explanation of a frame by an estimate: people, rejected candidates, and the assignment of boxes and pixels."""

from dataclasses import replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Shorts
from stseg.bodies.outlines import paint_outlines
from stseg.bodies.views import BoxView, PixelView, View
from stseg.detection.ghosts import candidate_prior_log_odds, rejected_candidates
from stseg.detection.problem import BoxEvidence, DetectionProblem
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.refined_people import RefinedPeople, refined_members
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation, People
from stseg.view_health.reprojection_residuals import reprojection_residuals


def explained_frame(estimate: MapEstimate) -> Explanation:
    """The explanation by a final estimate: its members are refined, residuals measured.

    Nobody is detected by a prediction alone, where no view says anything.
    """
    observed = is_observed(estimate)
    estimate = estimate if observed.all() else estimate.with_members(estimate.members[observed])
    explanation = explained_by(estimate, refined_members(estimate))
    people, evidence = explanation.people, estimate.evidence
    residual = reprojection_residuals(
        people.candidates, evidence.views, evidence.observations, estimate.box_assignment, people.is_free
    )
    return replace(explanation, residual=residual)


def is_observed(estimate: MapEstimate) -> Flags:
    """Members of whom some view says something, bool (n,)."""
    return np.asarray(estimate.members_score.view_evidence.any(0))


def explained_by(estimate: MapEstimate, refined: RefinedPeople) -> Explanation:
    """The explanation by an estimate with its refined members; no residuals are measured."""
    views, members, score = estimate.evidence.views, estimate.members, estimate.members_score
    ground = _outside_core(refined.pool.ground, members, estimate.problem)
    bodies = Candidates(ground, refined.track_sizes.height, refined.track_sizes.width)
    people = People(
        bodies.ground,
        bodies.height,
        bodies.width,
        refined.covariance,
        estimate.losses,
        score.view_evidence,
        _found_share(estimate),
        candidate_prior_log_odds(estimate, members, score.track_index),
        score.track_index,
        refined.sizes,
    )
    pixel_assignment = [
        pixels if isinstance(view, PixelView) else _painted(view, bodies)
        for view, pixels in zip(views, estimate.pixel_assignment, strict=True)
    ]
    return Explanation(
        people,
        rejected_candidates(estimate),
        tuple(pixel_assignment),
        tuple(view.step for view in views),
        tuple(estimate.box_assignment),
        np.full(len(views), np.nan),
        estimate.unfinished,
    )


def _outside_core(refined: Floats, members: Ints, problem: DetectionProblem) -> Floats:
    """Refined places (n, 2), but where that would bring two bodies into the hard core those that were searched, metres.

    Places are refined one by one; no two of those that were searched are within the core.
    """
    ground, is_reset, breadth = refined.copy(), np.zeros(len(refined), bool), problem.breadth[members]
    room = problem.parameters.hard_core * (breadth[:, None] + breadth) / 2
    np.fill_diagonal(room, 0.0)
    while True:
        is_inside = (distances(ground, ground) < room).any(1) & ~is_reset
        if not is_inside.any():
            return ground
        is_reset |= is_inside
        ground[is_inside] = problem.ground[members[is_inside]]


def _found_share(estimate: MapEstimate) -> Floats:
    """Share of each member that each view sees past the others, float64 (view, member)."""
    members, evidence = estimate.members, estimate.problem.boxes
    found_share = np.ones((len(estimate.evidence.views), len(members)))
    boxes = iter(range(len(evidence.match)))
    for row, view in zip(found_share, estimate.evidence.views, strict=True):
        if isinstance(view, BoxView):
            k = next(boxes)
            visible = np.prod(_visible_past(evidence, k, members), axis=1)
            row[:] = view.found_share(evidence.inside[k][members] * visible)
    return found_share


def _visible_past(evidence: BoxEvidence, view: int, members: Ints) -> Floats:
    """Share of each member's pillar visible past each other member in a view with boxes, float64 (member, member)."""
    occluders, candidates = evidence.occluders, evidence.inside.shape[1]
    visible = np.ones((len(members), candidates))
    for row, i in zip(visible, (view * candidates + members).tolist(), strict=True):
        of_one = slice(*occluders.start[i : i + 2].tolist())
        row[occluders.item[of_one]] = occluders.value[of_one]
    return visible[:, members]


def _painted(view: View, people: Candidates) -> Shorts:
    """The person with the nearest body at each raster pixel of a view, int16 (v, u); -1 for none."""
    first, spans, _ = view.outlines(people.ground, people.height, people.width)
    owner = np.full(view.shape, -1, np.int16)
    paint_outlines(np.argsort(-view.distance(people.ground), kind="stable"), first, spans, owner)
    return owner
