"""Build the detection result of a frame: people, rejected candidates (ghosts), assignment of boxes and pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stseg.arrays import Floats, Ints, Shorts
from stseg.bodies.outlines import paint
from stseg.bodies.views import BoxView, PixelView, View
from stseg.detection.problem import BoxEvidence, Problem
from stseg.detection.search.map_estimate import MapEstimate, RefinedPeople
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation, People
from stseg.records.sizes import Sizes
from stseg.view_health.reprojection_residuals import reprojection_residuals


def explanation(estimate: MapEstimate) -> Explanation:
    """The result of a settled estimate: its members are refined, residuals measured."""
    explained = explanation_by(estimate, estimate.refined())
    people, evidence = explained.people, estimate.evidence
    exact = Candidates(people.ground, people.height, people.width)
    residual = reprojection_residuals(exact, evidence.views, evidence.observations, estimate.box_assignment)
    return replace(explained, residual=residual)


def explanation_by(estimate: MapEstimate, refined: RefinedPeople) -> Explanation:
    """The result of an estimate whose members are refined already; no residuals are measured."""
    views, members, score = estimate.evidence.views, estimate.members, estimate.members_score
    ground = _outside_core(refined.pool.ground, members, estimate.problem)
    exact = Candidates(ground, refined.known.height, refined.known.width)
    people = People(
        exact.ground, exact.height, exact.width, refined.covariance, estimate.losses, score.view_evidence,
        _visibility(estimate), _prior(estimate, members, estimate.track_index), estimate.track_index, refined.sizes,
    )  # fmt: skip
    assigned = [
        pixels if isinstance(view, PixelView) else _painted(view, exact)
        for view, pixels in zip(views, estimate.pixel_assignment, strict=True)
    ]
    return Explanation(
        people,
        _ghosts(estimate),
        tuple(assigned),
        tuple(view.step for view in views),
        tuple(estimate.box_assignment),
        np.full(len(views), np.nan),
    )


def _outside_core(refined: Floats, members: Ints, problem: Problem) -> Floats:
    """Refined places (n, 2), but where that would bring two bodies into the hard core those that were searched, metres.

    Places are refined one by one; no two of those that were searched are within the core.
    """
    ground, kept, breadth = refined.copy(), np.zeros(len(refined), bool), problem.breadth[members]
    room = problem.parameters.hard_core * (breadth[:, None] + breadth) / 2
    np.fill_diagonal(room, 0.0)
    while True:
        near = (np.hypot(*np.moveaxis(ground[:, None] - ground, -1, 0)) < room).any(1) & ~kept
        if not near.any():
            return ground
        kept |= near
        ground[near] = problem.ground[members[near]]


def _prior(estimate: MapEstimate, candidates: Ints, track_index: Ints) -> Floats:
    """Log-odds of candidates before any view is asked, nats, float64 (n,)."""
    problem = estimate.problem
    own = problem.parameters.prior_log_odds + problem.size_prior[candidates]
    return np.array(
        [
            p + (problem.track_gain[i, k] if k >= 0 else -problem.birth_cost[i])
            for p, i, k in zip(own, candidates, track_index, strict=True)
        ]
    )


def _visibility(estimate: MapEstimate) -> Floats:
    """Share of each member that each view sees past the others, float64 (view, member)."""
    members, evidence = estimate.members, estimate.problem.boxes
    visibility = np.ones((len(estimate.evidence.views), len(members)))
    boxes = iter(range(len(evidence.match)))
    for row, view in zip(visibility, estimate.evidence.views, strict=True):
        if isinstance(view, BoxView):
            k = next(boxes)
            row[:] = view.found_share(evidence.inside[k][members] * np.prod(_left(evidence, k, members), axis=1))
    return visibility


def _left(evidence: BoxEvidence, view: int, members: Ints) -> Floats:
    """Share of each member's pillar that each other member leaves in a view with boxes, float64 (member, member)."""
    hiders, candidates = evidence.hiders, evidence.inside.shape[1]
    left = np.ones((len(members), candidates))
    for row, i in zip(left, (view * candidates + members).tolist(), strict=True):
        own = slice(*hiders.start[i : i + 2].tolist())
        row[hiders.item[own]] = hiders.value[own]
    return left[:, members]


def _ghosts(estimate: MapEstimate) -> People:
    """The rejected candidates, each with what it would add to the set."""
    config, body = estimate.evidence.prior.config, estimate.evidence.prior.body
    rejected = estimate.others
    added = estimate.other_additions
    pool, births = estimate.pool.at(rejected), np.full(len(rejected), -1, np.int64)
    covariance = np.tile(np.eye(2) * config.lattice_spacing**2 / 12, (len(rejected), 1, 1))
    prior, sizes = _prior(estimate, rejected, added.track_index), Sizes.of_population(len(rejected), body)
    return People(
        pool.ground, pool.height, pool.width, covariance, added.gain, added.view_evidence,
        np.ones_like(added.view_evidence), prior, births, sizes,
    )  # fmt: skip


def _painted(view: View, people: Candidates) -> Shorts:
    """The person whose body is nearest at each raster pixel of a view, int16 (v, u); -1 for none."""
    first, spans, _ = view.outlines(people.ground, people.height, people.width)
    assigned = np.full(view.shape, -1, np.int16)
    paint(np.argsort(-view.distance(people.ground), kind="stable"), first, spans, assigned)
    return assigned
