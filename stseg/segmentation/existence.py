"""Existence of people over a window: which candidates of its frames are real, decided together.

Candidates are the detector's detections and ghosts (rejected candidates), with their evidence in nats. One binary
variable x_i for each; a link i -> j says that candidate j of a later frame is the same body as candidate i.

    -E(x) = sum_i g_i x_i + sum_links b_ij x_i x_j - sum_exclusions K x_i x_j
    g_i   = view evidence + prior log-odds + height prior - birth cost - death cost
    b_ij  as of `stseg.segmentation.candidate_links`

Without links a candidate pays for its birth and its death; a link saves both. Birth and death cost nothing at the
border of the scene and at the ends of the window. Links form paths: each candidate has at most one predecessor and one
successor, by a minimum-cost flow that ignores exclusions (Zhang, Li and Nevatia, CVPR 2008). Candidates of one frame
that are closer than the reach of a body exclude each other, unless both are people of the detector: their evidence is
the same. Links are submodular, exclusions are not: roof duality. A path through a candidate that another one excludes
falls apart.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.config import BodyConfig, DetectionConfig
from stseg.graphcut.grid_energy import QUANTUM
from stseg.graphcut.qpbo import QuadraticEnergy, QuadraticMinimum, minimise
from stseg.records.border import Border
from stseg.records.sizes import log_population_height
from stseg.segmentation.candidate_links import LinkModel, Links, WindowCandidates
from stseg.segmentation.paths import best_paths, path_marginals

_EXCLUSION_PENALTY = 1e4
"""K: repulsion of candidates that exclude each other, nats."""
Exclusions = tuple[Ints, Ints]
"""Candidates that exclude each other, (pair,) each."""


@dataclass(frozen=True)
class Existence:
    """Decision over a window."""

    real: Flags
    """bool (n,): candidates that are people."""
    successor: Ints
    """int64 (n,): link of each candidate, -1 for none."""
    log_odds: Floats
    """float64 (n,): marginal log-odds of each candidate along its path, nats."""


@dataclass(frozen=True)
class ExistenceModel:
    """Terms of the energy for one scene."""

    links: LinkModel
    """b."""
    reach: float
    """Distance below which candidates of one frame exclude each other, metres."""
    border: Border
    detection: DetectionConfig
    body: BodyConfig

    def decide(self, found: WindowCandidates, cut: Callable[..., Flags]) -> Existence:
        """Candidates that are real, and the links between them."""
        n = len(found)
        if not n:
            return Existence(np.zeros(0, bool), np.zeros(0, np.int64), np.zeros(0))
        gain, birth, death = self._gains(found)
        links, exclusions = self.links.between(found, birth, death), self._exclusions(found)
        return _solve(gain, links, exclusions, cut)

    def _gains(self, found: WindowCandidates) -> tuple[Floats, Floats, Floats]:
        """g, and in it the costs of birth and death, nats, float64 (n,) each."""
        inside = self.detection.birth_cost * self.border.inside(found.ground, self.detection.border_width)
        birth = np.where(found.frame == 0, 0.0, inside)
        death = np.where(found.frame == found.frames - 1, 0.0, inside)
        tall = log_population_height(found.height, self.body)
        return found.evidence + self.detection.prior_log_odds + tall - birth - death, birth, death

    def _exclusions(self, found: WindowCandidates) -> Exclusions:
        """Pairs of one frame that share their evidence; two people of the detector do not."""
        ends = np.searchsorted(found.frame, np.arange(found.frame[-1] + 2))
        pairs = [first + _pairs(stop - first) for first, stop in pairwise(ends.tolist())]
        one, other = np.concatenate(pairs, axis=1)
        overlapping = np.hypot(*(found.ground[one] - found.ground[other]).T) < self.reach
        kept = overlapping & ~((found.track[one] > 0) & (found.track[other] > 0))
        return one[kept].astype(np.int64), other[kept].astype(np.int64)


@lru_cache(maxsize=256)
def _pairs(number: int) -> Ints:
    """All pairs of some candidates, int64 (2, pair); not to be written to."""
    return np.stack(np.triu_indices(number, 1))


def _solve(gain: Floats, links: Links, exclusions: Exclusions, cut: Callable[..., Flags]) -> Existence:
    """The candidates of least energy on the best paths."""
    start, end, bonus = links
    successor = best_paths(gain, start, end, bonus)
    chosen = successor[start] == end
    start, end, bonus = start[chosen], end[chosen], bonus[chosen]
    one, other = exclusions
    energy = QuadraticEnergy(
        _quanta(-gain),
        np.concatenate([start, one]),
        np.concatenate([end, other]),
        np.concatenate([_quanta(-bonus), np.full(len(one), round(_EXCLUSION_PENALTY / QUANTUM), np.int64)]),
    )
    least: QuadraticMinimum = minimise(energy, cut)
    return Existence(least.labels, successor, path_marginals(gain, start, end, bonus))


def _quanta(nats: Floats) -> Ints:
    return np.rint(nats / QUANTUM).astype(np.int64)
