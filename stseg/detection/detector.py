"""The pass of one frame: candidates, and the set of them that best explains what all views show (METHODS 7).

Candidates are sought on a ground lattice, in what nobody explains yet, so people behind others are found once those
others stand. Whom the frames before led to expect are candidates too, and a newcomer away from the border costs. After
each round the set is searched anew, until a round changes nobody.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import ViewEvidence
from stseg.config import BodyConfig, DetectionConfig, ErrorRateConfig
from stseg.detection.box_noise_calibration import BoxNoiseCalibration
from stseg.detection.evidence import peaks
from stseg.detection.map_estimate import FrameEvidence, MapEstimate
from stseg.detection.prior import Prior
from stseg.detection.problem import Parameters
from stseg.detection.result import explanation
from stseg.detection.search import ENUMERATED
from stseg.detection.views import BoxView, PixelView, ViewObservation
from stseg.geometry import Rig
from stseg.model.border import Border
from stseg.model.box_noise import BoxNoise
from stseg.model.candidates import Candidates
from stseg.model.people import Explanation
from stseg.model.predicted_tracks import PredictedTracks


class Detector:
    """The pass for one rig: lattice and tables are made once, frames are explained one by one.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        The pass's constants.
    body
        Population prior of heights and widths.
    level
        How fast it learns how sharp boxes are.
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
        self.first_noise = self.new_calibration().noise
        grid = rig.grid
        x = np.arange(grid.x[0] + config.lattice_spacing / 2, grid.x[1], config.lattice_spacing)
        y = np.arange(grid.y[0] + config.lattice_spacing / 2, grid.y[1], config.lattice_spacing)
        self.lattice_ground = np.stack(np.meshgrid(x, y), -1)
        flat = self.lattice_ground.reshape(-1, 2)
        self.views: list[BoxView | PixelView] = [
            BoxView(camera, grid, flat, config, body)
            if kind == "boxes"
            else PixelView(camera, grid, flat, config, body)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        self.parameters = Parameters(
            config.prior_log_odds,
            config.minimum_distance,
            config.box_log_ratio,
            config.box_miss_rate,
            config.hidden_visibility,
            config.full_visibility,
            config.hidden_detection_rate,
            config.effective_observations,
        )
        self.border = Border.of(rig)
        self._trades = 0 if "boxes" in kinds else config.swap_moves

    def new_calibration(self) -> BoxNoiseCalibration:
        """Box noise calibration of a session that begins: the first guess."""
        return BoxNoiseCalibration(self._rate, self._level)

    def explain_next(
        self,
        calibration: BoxNoiseCalibration,
        seen: Sequence[ViewEvidence],
        expected: PredictedTracks | None,
        proposed: Candidates | None = None,
    ) -> Explanation:
        """Explain a session's next frame, and update the session's box noise calibration with it."""
        noise = calibration.noise
        explained = self.explain(seen, expected, proposed, noise)
        calibration.learn(explained, self.views, self.observe(seen, noise))
        return explained

    def observe(self, seen: Sequence[ViewEvidence], noise: BoxNoise | None = None) -> list[ViewObservation | None]:
        """What each view shows under a box noise, by default the first guess; None where the view is blind."""
        known = noise or self.first_noise
        return [None if s is None else view.observe(s, known) for view, s in zip(self.views, seen, strict=True)]

    def explain(
        self,
        seen: Sequence[ViewEvidence],
        expected: PredictedTracks | None,
        proposed: Candidates | None = None,
        noise: BoxNoise | None = None,
    ) -> Explanation:
        """Explain one frame.

        Parameters
        ----------
        seen
            What each view shows.
        expected
            Whom the frames before lead to expect; None in a first frame, in which nobody is a newcomer.
        proposed
            Candidates from elsewhere, best first: beside those of the first round's lattice, but for duplicates.
        noise
            Noise of boxes; by default the first guess.
        """
        sights = self.observe(seen, noise)
        prior = Prior.of(expected, self.config, self.body, self.border)
        expected_inside = prior.pool()
        seen_now = FrameEvidence(self.views, sights, prior, self.parameters)
        frame = MapEstimate(seen_now, expected_inside, np.arange(len(expected_inside)))
        for _ in range(self.config.search_rounds):
            fresh = self.fresh(frame)
            if proposed is not None:
                fresh, proposed = fresh.joined_apart(proposed, self.config.lattice_spacing), None
            moved = frame.refined().pool
            if not len(fresh) and not len(moved):
                break
            known = len(frame.pool)
            frame = MapEstimate(frame.seen, frame.pool.joined_with(moved).joined_with(fresh), frame.members)
            if (frame.members < known).all():
                break
        return explanation(_settled(frame, self._trades))

    def fresh(self, frame: MapEstimate) -> Candidates:
        """Candidates in what nobody explains yet."""
        heights, (rows, columns) = np.asarray(self.body.heights), self.lattice_ground.shape[:2]
        score = np.repeat(frame.seen.prior.tall(heights)[:, None], rows * columns, 1)
        for view, sight, free in zip(self.views, frame.seen.sights, frame.free(), strict=True):
            if sight is not None:
                score += view.lattice_score(sight, free)
        return peaks(score.reshape(-1, rows, columns), self.lattice_ground, heights, self.body.width_mean)


def _settled(frame: MapEstimate, trades: int) -> MapEstimate:
    """The frame searched from where its people exactly stand, which may show two to be one, then well, by places."""
    exact = frame.refined().pool
    known = len(frame.pool)
    anew = MapEstimate(frame.seen, frame.pool.joined_with(exact), np.arange(known, known + len(exact)))
    places = np.concatenate([anew.members, anew.rivals()])
    return MapEstimate(anew.seen, anew.pool.at(places), np.arange(len(anew.members)), ENUMERATED, trades)
