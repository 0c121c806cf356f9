"""Per-frame MAP detection with ghost suppression: candidates, and the set of them that best explains all views.

A detector searches frames (`search.frame_search`), follows the tracks of frames between key frames (`key_frames`), and
updates what a session learns of its views: noise of boxes, sizes of people, eaten edges of silhouettes, failing views.
Predicted tracks are candidates, too, and a birth away from the border costs (docs/how-it-works.md, Detection).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.arrays import Flags, ViewEvidence
from stseg.bodies.box_fit import BoxNoise
from stseg.bodies.views import BoxView, DetectorView, PixelView, ViewObservation, ViewObservations
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig
from stseg.detection.alternatives import followed_alternative, found_alternative
from stseg.detection.evidence.birth_lattice import lattice
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.explanation import explained_frame
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.key_frames import followed_frame, key_frame_interval
from stseg.detection.prior import Prior
from stseg.detection.problem import ScoreParameters
from stseg.detection.score.scoring import CORE_MARGIN
from stseg.detection.search.frame_search import FrameSearch
from stseg.detection.search.restarts import better_of, weak_members
from stseg.geometry import Rig
from stseg.noise.box_bias_estimate import BoxBiasEstimate
from stseg.noise.box_noise_estimate import BoxNoiseEstimate
from stseg.noise.estimates import Estimates
from stseg.noise.population_estimate import PopulationEstimate
from stseg.noise.rim_estimate import RimEstimate
from stseg.noise.torn_masks import is_unexplained, mask_log_likelihood
from stseg.records.border import Border
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.view_health.reprojection_residuals import nearest_people, reprojection_residuals
from stseg.view_health.view_failures import ViewFailures

_RESTARTS = 3
"""Restarts of the search of one frame by boxes, at most."""
_FIRST_FRAME_SEARCHES = 2
"""Searches of a session's first frame from which its rims are learned: the second finds who was missed by the first."""


class Detector:
    """The detector of one rig: lattice and tables are made once, frames are explained one by one.

    Its kernels share memory that is allocated once, so threads explain no frames at the same time.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        Kind of each camera's recording: "boxes" or "pixels".
    config
        The detector's constants.
    body
        Population prior of heights and widths.
    error_rates
        Memory of what is learned, and the evidence for a person that it takes.
    """

    def __init__(
        self,
        rig: Rig,
        kinds: Sequence[str],
        config: DetectionConfig,
        body: BodyConfig,
        error_rates: ErrorRateConfig | None = None,
    ) -> None:
        self.config, self.body = config, body
        self._frame_rate, self._error_rates = rig.frame_rate, error_rates or ErrorRateConfig()
        self.first_noise = BoxNoiseEstimate(self._frame_rate, self._error_rates, body.stoutness).noise
        grid = rig.grid
        self.lattice_ground = lattice(grid, config.lattice_spacing)
        flat = self.lattice_ground.reshape(-1, 2)
        self.views: list[DetectorView] = [
            BoxView(camera, grid, flat, config, body)
            if kind == "boxes"
            else PixelView(camera, grid, flat, config, body)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        self.pixel_lattice = PixelLattice.of(self.views, flat, body)
        core = config.minimum_distance - CORE_MARGIN if "pixels" in kinds else 0.0
        self.parameters = ScoreParameters.of(config, core, body.width_mean)
        self.border = Border.of(rig)
        self._has_boxes = "boxes" in kinds
        self.key_interval = key_frame_interval(rig.frame_rate, config, self._has_boxes)
        """Frames from one key frame to the next."""
        swap_sweeps, restarts = (0, _RESTARTS) if self._has_boxes else (config.swap_moves, 0)
        self._search = FrameSearch(self.lattice_ground, self._has_boxes, config.search_rounds, swap_sweeps, restarts)

    def new_estimates(self) -> Estimates:
        """Estimates of a session that begins: first guesses, the configured population, and no view that fails."""
        number, rate, error_rates = len(self.views), self._frame_rate, self._error_rates
        return Estimates(
            BoxNoiseEstimate(rate, error_rates, self.body.stoutness),
            BoxBiasEstimate(number, rate, error_rates),
            PopulationEstimate(self.body, rate, error_rates),
            RimEstimate(number, self.body, self.config, rate, error_rates),
            ViewFailures(number, self.body, rate, error_rates),
        )

    def observe(self, views: Sequence[ViewEvidence], noise: BoxNoise | None = None) -> list[ViewObservation | None]:
        """ViewObservations of the views under a box noise, by default the first guess; None where a view is blind."""
        box_noise = noise or self.first_noise
        return [None if v is None else view.observe(v, box_noise) for view, v in zip(self.views, views, strict=True)]

    def evidence(self, observations: ViewObservations, prior: Prior) -> FrameEvidence:
        """Evidence of a frame under a prior."""
        return FrameEvidence(self.views, observations, prior, self.parameters, self.pixel_lattice)

    def explain(
        self, views: Sequence[ViewEvidence], predicted: PredictedTracks | None, proposals: Candidates | None = None
    ) -> Explanation:
        """Explain one frame as `explain_next`, by first guesses alone: of a session that has learned nothing."""
        evidence = self.evidence(self.observe(views), self._prior(predicted, self.body))
        return explained_frame(self._search.whole(self._search.of_tracks(evidence), proposals))

    def explain_next(
        self,
        learned: Estimates,
        frame: int,
        views: Sequence[ViewEvidence],
        predicted: PredictedTracks | None,
        proposals: Candidates | None = None,
        alternative: PredictedTracks | None = None,
    ) -> Explanation:
        """Explain a session's next frame by the views that are not excluded, and update what the session has learned.

        `frame` is its number in the recording, which says whether it is a key frame (`stseg.detection.key_frames`).
        `predicted` are the tracks of earlier frames; None in a first frame, where births cost nothing. `proposals` are
        candidates from elsewhere, best first: added to those of the first round's lattice, but for duplicates. A frame
        in which a view begins to fail is explained again without it. `alternative` are tracks of another reading of the
        frames before, by which the frame is explained, too. A key frame's search may find a further reading.
        """
        observations, failures = self.observe(views, learned.box_noise.noise), learned.failures
        failures.begin(predicted, self.views, observations)
        included: ViewObservations = failures.kept(observations)
        is_key = frame % self.key_interval == 0
        if learned.rims.is_young and (is_key or predicted is None) and not self._has_boxes:
            self._learn_first_rims(learned, included, _FIRST_FRAME_SEARCHES if predicted is None else 1)
        evidence = self._learned_evidence(learned, included, predicted)
        explanation, is_searched = self._explained(learned, is_key, evidence, predicted, proposals)
        if failures.learn(explanation, self.views, observations):
            included = failures.kept(observations)
            evidence = self._learned_evidence(learned, included, predicted)
            explanation, is_searched = self._explained(learned, is_key, evidence, predicted, proposals)
        if alternative is not None:
            followed = evidence.under(self._prior(alternative, learned.population.body))
            untracked = evidence.under(self._prior(None, learned.population.body))
            other = followed_alternative(self._search, followed, untracked, explanation)
            explanation = replace(explanation, followed=other)
        if self._has_boxes:
            learned.box_noise.learn(explanation, self.views, included)
            learned.box_bias.learn(explanation, self.views, included)
        elif is_searched:
            learned.population.learn(explanation.people)
            learned.rims.learn(explanation.people, self.views, included)
        else:
            learned.population.skip_frame()
            learned.rims.skip_frame()
        learned.frames += 1
        if failures.excluded.any():
            return self._with_excluded_residuals(explanation, observations, failures.excluded)
        return explanation

    def _explained(
        self,
        learned: Estimates,
        is_key: bool,
        evidence: FrameEvidence,
        predicted: PredictedTracks | None,
        proposals: Candidates | None,
    ) -> tuple[Explanation, bool]:
        """A frame's explanation by what has been learned, and whether the whole ground was searched for it."""
        tracks = self._search.of_tracks(evidence)
        is_new = learned.frames < self.key_interval
        if not (is_key or is_new) and predicted is not None and proposals is None:
            explanation = followed_frame(tracks, self._search)
            if explanation is not None:
                return explanation, False
        estimate = self._search.whole(tracks, proposals)
        if (is_key or self._has_boxes) and predicted is not None and len(weak_members(estimate)):
            untracked = evidence.under(self._prior(None, evidence.prior.body))
            people = self._search.without_tracks(untracked, estimate)
            estimate = better_of(estimate, self._search.repeated(estimate, people))
            explanation = explained_frame(estimate)
            found = found_alternative(estimate, untracked, explanation, people)
            return replace(explanation, found=found), True
        return explained_frame(estimate), True

    def _prior(self, predicted: PredictedTracks | None, body: BodyConfig) -> Prior:
        return Prior.of(predicted, self.config, body, self.border)

    def _learned_evidence(
        self, learned: Estimates, observations: ViewObservations, predicted: PredictedTracks | None
    ) -> FrameEvidence:
        """Evidence of a frame by what has been learned, under the prior of its predicted tracks."""
        applied, prior = learned.rims.applied(observations), self._prior(predicted, learned.population.body)
        parameters = self.parameters._replace(box_miss_rate=learned.box_noise.miss_rate(self.config.box_miss_rate))
        return FrameEvidence(self.views, applied, prior, parameters, self.pixel_lattice)

    def _learn_first_rims(self, learned: Estimates, observations: ViewObservations, searches: int) -> None:
        """Learn the rims of a young session before its frame is explained, as if births cost nothing.

        If what is learned so far leaves much unexplained, a guess of torn masks is tried, too: the rims are those of
        the explanation by which the masks are more likely.
        """
        for _ in range(searches):
            likely = self._by_births(learned.rims.applied(observations), learned)
            if is_unexplained(likely.pixel_assignment, observations):
                torn = self._by_births(learned.rims.torn_guess(observations), learned)
                likely = max(likely, torn, key=lambda one: mask_log_likelihood(one.pixel_assignment, observations))
            learned.rims.learn(likely.people, self.views, observations)

    def _by_births(self, observations: ViewObservations, learned: Estimates) -> Explanation:
        """A frame's explanation without tracks."""
        evidence = self.evidence(observations, self._prior(None, learned.population.body))
        return explained_frame(self._search.whole(self._search.of_tracks(evidence)))

    def _with_excluded_residuals(
        self, explanation: Explanation, observations: ViewObservations, excluded: Flags
    ) -> Explanation:
        """A frame's explanation with the residuals of excluded views, too: a camera that was moved shows in them."""
        bodies = explanation.people.candidates
        of_excluded = [o if is_excluded else None for o, is_excluded in zip(observations, excluded, strict=True)]
        owners = [
            np.zeros(0, np.int64) if o is None else nearest_people(bodies, view, o)
            for view, o in zip(self.views, of_excluded, strict=True)
        ]
        free = np.zeros((len(self.views), len(bodies)), bool)
        residual = reprojection_residuals(bodies, self.views, of_excluded, owners, free)
        return replace(explanation, residual=np.where(excluded, residual, explanation.residual))
