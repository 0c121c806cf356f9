"""Ghosts: the candidates of a frame that are rejected, each with the evidence on which it is.

A candidate is rejected where the set of people that best explains all views is found without it
(`search.best_set`): the score of the set with it is lower (`Additions.gain`, the evidence of a ghost).
Later stages decide again on ghosts and detections: the window accepts a ghost or drops a detection by its existence
over several frames (`stseg.segmentation.existence`), and final tracks are pruned (`stseg.trajectories.pruning`). The
main reason against each ghost is read from the rows of a run file (`stseg.records.ghost_reasons`).
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.search.map_estimate import MapEstimate
from stseg.records.people import People
from stseg.records.sizes import Sizes


def rejected_candidates(estimate: MapEstimate) -> People:
    """Candidates outside an estimate's set that some view shows, with the change of its score by each as evidence."""
    config, body = estimate.evidence.prior.config, estimate.evidence.prior.body
    rejected, additions = estimate.others, estimate.other_additions
    pool, births = estimate.pool.at(rejected), np.full(len(rejected), -1, np.int64)
    covariance = np.tile(np.eye(2) * config.lattice_spacing**2 / 12, (len(rejected), 1, 1))
    prior = candidate_prior_log_odds(estimate, rejected, additions.track_index)
    sizes = Sizes.of_population(len(rejected), body)
    candidates = People(
        pool.ground,
        pool.height,
        pool.width,
        covariance,
        additions.gain,
        additions.view_evidence,
        np.ones_like(additions.view_evidence),
        prior,
        births,
        sizes,
    )
    is_shown = additions.view_evidence.any(0)
    return candidates if is_shown.all() else candidates.at(np.flatnonzero(is_shown))


def candidate_prior_log_odds(estimate: MapEstimate, candidates: Ints, track_index: Ints) -> Floats:
    """Log-odds of candidates (n,) with their tracks, -1 for births, without the evidence of any view: nats, (n,)."""
    problem = estimate.problem
    prior = problem.parameters.prior_log_odds + problem.size_prior[candidates]
    return np.array(
        [
            p + (problem.track_gain[i, k] if k >= 0 else -problem.birth_cost[i])
            for p, i, k in zip(prior, candidates, track_index, strict=True)
        ]
    )
