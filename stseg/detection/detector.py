"""Per-frame MAP detection with ghost suppression: candidates, and the set of them that best explains all views.

Candidates come from a ground lattice, scored by the evidence that is not explained yet, so that people behind others
are found once those are. Predicted tracks are candidates too, and a birth away from the border costs. After each round
the set is searched again, until a round changes nothing. Before the final search, rejected candidates that were nearly
accepted are fitted to their pixels (docs/how-it-works.md, Detection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.arrays import Flags, Ints, ViewEvidence
from stseg.bodies.box_noise import BoxNoise
from stseg.bodies.views import BoxView, PixelView, ViewObservation
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig
from stseg.detection.evidence.birth_lattice import lattice, lattice_candidates
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.key_frames import followed, key_frame_interval
from stseg.detection.prior import Prior
from stseg.detection.problem import Parameters
from stseg.detection.result import explanation
from stseg.detection.score.repulsion import CORE
from stseg.detection.search.map_estimate import FrameEvidence, MapEstimate
from stseg.detection.search.merging import merged
from stseg.detection.search.restart import better, is_doubtful, restarted
from stseg.detection.search.search import ENUMERATED
from stseg.geometry import Rig
from stseg.noise.box_noise_estimate import BoxNoiseEstimate
from stseg.noise.estimates import Estimates
from stseg.noise.population_estimate import PopulationEstimate
from stseg.noise.rim_estimate import RimEstimate
from stseg.records.border import Border
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.view_health.reprojection_residuals import nearest_people, reprojection_residuals
from stseg.view_health.view_failures import ViewFailures

_NEARLY = -15.0
"""Gain above which an alternative is fitted to its pixels, nats: what the right place and size may add."""
_LOOKS = 2
"""Searches of a session's first frame from which its rims are learned: the second finds who was missed by the first."""
_SEEN = 2.0
"""Evidence of all views above which it is, nats: less is no foreground left over."""


class Detector:
    """The detector of one rig: lattice and tables are made once, frames are explained one by one.

    Its kernels share memory that is asked for once, so threads explain no frames at the same time.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        The detector's constants.
    body
        Population prior of heights and widths.
    level
        How fast the noise of boxes is learned.
    """

    def __init__(
        self,
        rig: Rig,
        kinds: Sequence[str],
        config: DetectionConfig,
        body: BodyConfig,
        level: ErrorRateConfig | None = None,
    ) -> None:
        self.config, self.body = config, body
        self._rate, self._level = rig.frame_rate, level or ErrorRateConfig()
        self.first_noise = BoxNoiseEstimate(self._rate, self._level).noise
        grid = rig.grid
        self.lattice_ground = lattice(grid, config.lattice_spacing)
        flat = self.lattice_ground.reshape(-1, 2)
        self.views: list[BoxView | PixelView] = [
            BoxView(camera, grid, flat, config, body)
            if kind == "boxes"
            else PixelView(camera, grid, flat, config, body)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        self.pixel_lattice = PixelLattice.of(self.views, flat, body)
        core = config.minimum_distance - CORE if "pixels" in kinds else 0.0
        self.parameters = Parameters.of(config, core, body.width_mean)
        self.border = Border.of(rig)
        self._key_interval = key_frame_interval(rig.frame_rate, config)
        self._has_boxes = "boxes" in kinds
        self._swap_rounds = 0 if self._has_boxes else config.swap_moves

    def new_estimates(self) -> Estimates:
        """Estimates of a session that begins: first guesses, the configured population, and no view that fails."""
        number, rate, level = len(self.views), self._rate, self._level
        return Estimates(
            BoxNoiseEstimate(rate, level),
            PopulationEstimate(self.body, rate, level),
            RimEstimate(number, self.body, self.config, rate, level),
            ViewFailures(number, self.body, rate, level),
        )

    def explain_next(
        self,
        learned: Estimates,
        frame: int,
        seen: Sequence[ViewEvidence],
        predicted: PredictedTracks | None,
        proposed: Candidates | None = None,
    ) -> Explanation:
        """Explain a session's next frame by the views that are not excluded, and update what the session has learned.

        `frame` is its number in the recording, which says whether it is a key frame (`stseg.detection.key_frames`). A
        frame in which a view begins to fail is explained again without it.
        """
        every, failures = self.observe(seen, learned.box_noise.noise), learned.failures
        failures.begin(predicted, self.views, every)
        shown: Sequence[ViewObservation | None] = failures.kept(every)
        if predicted is None and not self._has_boxes:
            self._look_at_rims(learned.rims, shown, learned.population.body)
        is_key = frame % self._key_interval == 0
        explained, is_searched = self._explained(learned, is_key, shown, predicted, proposed)
        if failures.learn(explained, self.views, every):
            shown = failures.kept(every)
            explained, is_searched = self._explained(learned, is_key, shown, predicted, proposed)
        if self._has_boxes:
            learned.box_noise.learn(explained, self.views, shown)
        elif is_searched:
            learned.population.learn(explained.people)
            learned.rims.learn(explained.people, self.views, shown)
        else:
            learned.population.skip_frame()
            learned.rims.skip_frame()
        if failures.excluded.any():
            return self._with_excluded_residuals(explained, every, failures.excluded)
        return explained

    def _with_excluded_residuals(
        self, explained: Explanation, every: Sequence[ViewObservation | None], excluded: Flags
    ) -> Explanation:
        """A frame's explanation with the residuals of excluded views, too: a camera that was moved shows in them."""
        people = explained.people
        exact = Candidates(people.ground, people.height, people.width)
        seen = [view if out else None for view, out in zip(every, excluded, strict=True)]
        owners = [
            np.zeros(0, np.int64) if own is None else nearest_people(exact, view, own)
            for view, own in zip(self.views, seen, strict=True)
        ]
        measured = reprojection_residuals(exact, self.views, seen, owners)
        return replace(explained, residual=np.where(excluded, measured, explained.residual))

    def _explained(
        self,
        learned: Estimates,
        is_key: bool,
        shown: Sequence[ViewObservation | None],
        predicted: PredictedTracks | None,
        proposed: Candidates | None,
    ) -> tuple[Explanation, bool]:
        """A frame's explanation by what has been learned, and whether the whole ground was searched for it."""
        tracked = self._tracked(learned.rims.applied(shown), learned.population.body, predicted)
        if not is_key and predicted is not None and proposed is None:
            known = followed(tracked, self.lattice_ground)
            if known is not None:
                return known, False
        found = self._searched(tracked, proposed)
        if is_key and predicted is not None and not self._has_boxes and is_doubtful(found):
            found = better(found, self._searched_afresh(found))
        return explanation(found), True

    def _look_at_rims(self, rims: RimEstimate, shown: Sequence[ViewObservation | None], body: BodyConfig) -> None:
        """Learn the rims of a session's first frame before it is explained: births cost nothing in that frame alone."""
        for _ in range(_LOOKS):
            explained = explanation(self._searched(self._tracked(rims.applied(shown), body, None), None))
            rims.learn(explained.people, self.views, shown)

    def observe(self, seen: Sequence[ViewEvidence], noise: BoxNoise | None = None) -> list[ViewObservation | None]:
        """Observations of the views under a box noise, by default the first guess; None where a view is blind."""
        known = noise or self.first_noise
        return [None if s is None else view.observe(s, known) for view, s in zip(self.views, seen, strict=True)]

    def explain(
        self,
        seen: Sequence[ViewEvidence],
        predicted: PredictedTracks | None,
        proposed: Candidates | None = None,
        noise: BoxNoise | None = None,
    ) -> Explanation:
        """Explain one frame under the configured population.

        Parameters
        ----------
        seen
            What each view shows.
        predicted
            Tracks of earlier frames; None in a first frame, where births cost nothing.
        proposed
            Candidates from elsewhere, best first: beside those of the first round's lattice, but for duplicates.
        noise
            Noise of boxes; by default the first guess.
        """
        return explanation(self._searched(self._tracked(self.observe(seen, noise), self.body, predicted), proposed))

    def _tracked(
        self, observations: Sequence[ViewObservation | None], body: BodyConfig, predicted: PredictedTracks | None
    ) -> MapEstimate:
        """The best set of the predicted tracks alone."""
        prior = Prior.of(predicted, self.config, body, self.border)
        tracked = prior.pool()
        return MapEstimate.of_search(self.evidence(observations, prior), tracked, np.arange(len(tracked)))

    def evidence(self, observations: Sequence[ViewObservation | None], prior: Prior) -> FrameEvidence:
        """What a frame is judged by."""
        return FrameEvidence(self.views, observations, prior, self.parameters, self.pixel_lattice)

    def _searched_afresh(self, found: MapEstimate) -> MapEstimate:
        """The search from whom it finds where no track is known.

        With few views many sets are better than all that exchange one or two members, and tracks lead into one of them.
        """
        evidence = found.evidence
        forgetful = self._searched(self._tracked(evidence.observations, evidence.prior.body, None), None)
        start = forgetful.pool.at(forgetful.members)
        pool = start.joined_with(evidence.prior.pool()).joined_with(found.pool.at(found.members))
        return self._settled(merged(MapEstimate.of_search(evidence, pool, np.arange(len(start)))))

    def _searched(self, estimate: MapEstimate, proposed: Candidates | None) -> MapEstimate:
        """The whole search, from the predicted tracks on."""
        for _ in range(self.config.search_rounds):
            fresh = lattice_candidates(estimate, self.lattice_ground).new_to(estimate.pool)
            if proposed is not None:
                fresh, proposed = fresh.joined_apart(proposed, self.config.lattice_spacing), None
            moved = self._moved(estimate)
            if not len(fresh) and not len(moved):
                break
            known, before = len(estimate.pool), estimate.members
            searched = estimate.searched_with(moved.joined_with(fresh), before)
            estimate = merged(searched)
            if (searched.members < known).all():
                break
            settled = len(estimate.members) == len(searched.members)
            if settled and not self._has_boxes and _same_people(estimate.members, before, known):
                break
        return self._settled(estimate)

    def _moved(self, estimate: MapEstimate) -> Candidates:
        """The members nearer to where they stand: a step between two searches.

        Where all views show pixels and all members continue tracks, their heights are known well enough for it.
        """
        if self._has_boxes or (estimate.track_index < 0).any():
            return estimate.refined().pool
        return estimate.moved()

    def _settled(self, estimate: MapEstimate) -> MapEstimate:
        """The final search: from the refined places, which may show two members to be one, then thoroughly."""
        exact, known = self._moved(estimate), len(estimate.pool)
        moved = estimate.searched_with(exact, np.arange(known, known + len(exact)))
        if self._has_boxes:
            moved = restarted(moved, self.lattice_ground)
        alternatives = moved.alternatives()
        pool = moved.pool.at(np.concatenate([moved.members, alternatives]))
        if not self._has_boxes:
            pool = pool.joined_with(_fitted(moved, alternatives))
        start = np.arange(len(moved.members))
        return merged(MapEstimate.of_search(moved.evidence, pool, start, ENUMERATED, self._swap_rounds))


def _fitted(estimate: MapEstimate, alternatives: Ints) -> Candidates:
    """Alternatives that are nearly worth a member, at the places and sizes that their own pixels show.

    The lattice tries few heights and one width of each: a child is worth less than nothing at the size of an adult.
    """
    additions = estimate.additions(alternatives)
    nearly = alternatives[(additions.gain > _NEARLY) & (additions.view_evidence.sum(0) > _SEEN)]
    if not len(nearly):
        return estimate.pool.at(nearly)
    together = estimate.with_members(np.concatenate([estimate.members, nearly]))
    return together.some_refined(np.arange(len(estimate.members), len(together.members))).pool


def _same_people(members: Ints, before: Ints, known: int) -> bool:
    """Whether a search among `known` candidates, those that `before` moved to, and others kept exactly these people."""
    moved = (members >= known) & (members < known + len(before))
    origin = members.copy()
    origin[moved] = before[members[moved] - known]
    return np.array_equal(np.sort(origin), np.sort(before))
