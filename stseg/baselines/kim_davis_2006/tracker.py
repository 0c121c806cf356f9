"""Guided particle filter: particles move to the people by iterated localisation (Kim and Davis 2006, section 4.3).

Each frame, every particle takes a random step and is then moved by the search, which segments all views by it and
intersects the people's axes; its weight is its colour likelihood there. A few particles are enough, since even one that
starts beside a person converges to the person. The paper starts tracks by hand or from isolated blobs; here unassigned
detections start them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.baselines.colour_views import ColourView, colour_views
from stseg.baselines.kim_davis_2006.appearance import PersonAppearance
from stseg.baselines.kim_davis_2006.crowd import Crowd
from stseg.baselines.kim_davis_2006.filter import estimate, particle_weights, predicted_particles, resampled
from stseg.baselines.kim_davis_2006.search import search
from stseg.baselines.kim_davis_2006.views import ParticleFrame, ParticleView
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.distances import distances
from stseg.records.border import Border
from stseg.records.predicted_tracks import EXISTENCE_DECAY, PredictedTracks
from stseg.records.sizes import Sizes
from stseg.trackers.framewise import FramewiseTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import Event, TrackPlaces
from stseg.tracking.filter.assignment import assign
from stseg.tracking.filter.track_filter import DETECTED_LOG_ODDS

_FLOOR = 0.05
"""Least standard deviation of a place, metres: particles share errors."""
_HEIGHT_NOISE = 0.06
"""Standard deviation of a person's height, metres."""
_MARGIN = 0.6
"""Search radius around the last places, metres."""
_PROPOSAL_PERIOD = 3
"""One particle in this many proposes an undetected track at an unassigned detection."""
_DUPLICATE_TIME = 0.4
"""Longest time that an undetected track may share the place of a detected one, seconds."""
_HEIGHT_RENEWAL = 0.1
"""Weight of a detection's height in the running mean."""


class ParticleTracker(FramewiseTracker):
    """Tracks by colours."""

    final: ClassVar[bool] = True

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        super().__init__(rig, config, first)
        self.views = [ParticleView(camera, config.particles.raster_columns) for camera in rig.cameras]
        self.border = Border.of(rig)
        self.rng = np.random.default_rng(config.particles.seed)
        self.issued, self.begun = 0, False
        self.crowd = Crowd.empty(1 if config.particles.method == "search" else config.particles.particles)

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks, at their last places; None for the first frame."""
        if not self.begun:
            return None
        crowd, config = self.crowd, self.config
        drift = config.motion.position_noise**2 + self._step(frame) ** 2
        unseen = (frame - 1 - crowd.last_detection) / self.rig.frame_rate
        sizes = Sizes.of_heights(crowd.height, np.full(len(crowd), _HEIGHT_NOISE**2), config.body)
        return PredictedTracks(
            crowd.ground, crowd.covariance + drift * np.eye(2), sizes, DETECTED_LOG_ODDS - EXISTENCE_DECAY * unseen
        )

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; it is committed at once.

        Raises
        ------
        SourceError
            Where no camera delivers colour.
        """
        views = colour_views(observed, "particles", fused.frame)
        view_frames = self._view_frames(views, self._propose(fused))
        self._follow(view_frames, self._step(fused.frame))
        seconds = (fused.frame - self.frame) / self.rig.frame_rate
        self.frame, self.begun = fused.frame, True
        evidence, unassigned = self._recognise(fused)
        deaths = self._end()
        births = self._begin(fused, unassigned)
        if births or deaths:
            view_frames = self._view_frames(views, np.full(len(self.crowd), _MARGIN))
        for view_frame in view_frames:
            self._learn(view_frame, seconds)
        crowd, events = self.crowd, births + deaths
        nats = np.array([evidence.get(int(i), 0.0) for i in crowd.ids])
        width = np.full(len(crowd), self.config.body.width_mean)
        tracks = TrackPlaces(crowd.ids, crowd.ground, crowd.covariance, crowd.height, width, nats)
        return [self.commit(fused, tracks, events)]

    def _step(self, frame: int) -> float:
        """Standard deviation of a person's step to a frame, metres."""
        return self.config.particles.velocity_spread * (frame - self.frame) / self.rig.frame_rate

    def _propose(self, fused: FusedFrame) -> Floats:
        """Propose undetected tracks at unassigned detections, in some particles.

        Returns
        -------
        float64 (n,)
            Search radius of each track, metres.
        """
        crowd, config, found = self.crowd, self.config, fused.people.ground
        margin = np.full(len(crowd), _MARGIN)
        distance = distances(crowd.ground, found)
        detected, assigned = assign(distance, config.particles.assignment_distance)
        lost, new = np.setdiff1d(np.arange(len(crowd)), detected), np.setdiff1d(np.arange(len(found)), assigned)
        reach = (
            config.particles.assignment_distance
            + config.particles.walking_speed * (fused.frame - crowd.last_detection) / self.rig.frame_rate
        )
        particles = crowd.particles.copy()
        if config.particles.method != "search":
            for a, b in zip(*assign(distance[np.ix_(lost, new)] - reach[lost, None], 0.0), strict=True):
                k, j = lost[a], new[b]
                particles[::_PROPOSAL_PERIOD, k] = found[j]
                margin[k] += distance[k, j]
        self.crowd = replace(crowd, particles=particles)
        return margin

    def _view_frames(self, views: Sequence[ColourView | None], margin: Floats) -> list[ParticleFrame]:
        """The views prepared for a search within margins (n,), metres."""
        crowd = self.crowd
        return [
            particle_view.prepare(view, crowd.ground, crowd.height, crowd.appearances, margin)
            for particle_view, view in zip(self.views, views, strict=True)
            if view is not None
        ]

    def _follow(self, frames: Sequence[ParticleFrame], step: float) -> None:
        """Propagate, weight and resample the particles."""
        config, crowd = self.config.particles, self.crowd
        moved = crowd.particles if config.method == "search" else predicted_particles(crowd.particles, step, self.rng)
        if config.method != "generic":
            median = config.axis_fit == "median"
            moved = np.stack([search(frames, hypothesis, config.iterations, median) for hypothesis in moved])
        reference, misfit = crowd.reference, np.zeros(moved.shape[:2])
        for hypothesis, row in zip(moved, misfit, strict=True):
            for frame in frames:
                frame.add_misfit(hypothesis, reference, row)
        weight = particle_weights(misfit.sum(1), config.colour_weight)
        ground, covariance = estimate(moved, weight)
        drawn = resampled(moved, weight, self.rng)
        covariance = covariance + _FLOOR**2 * np.eye(2)
        self.crowd = replace(crowd, ground=ground, covariance=covariance, particles=drawn)

    def _recognise(self, fused: FusedFrame) -> tuple[dict[int, float], Ints]:
        """Assign detections: evidence of each track, nats, and the unassigned detections."""
        crowd, people = self.crowd, fused.people
        matched, found = assign(distances(crowd.ground, people.ground), self.config.particles.assignment_distance)
        last_detection, height = crowd.last_detection.copy(), crowd.height.copy()
        last_detection[matched] = fused.frame
        height[matched] += _HEIGHT_RENEWAL * (people.height[found] - height[matched])
        self.crowd = replace(crowd, last_detection=last_detection, height=height)
        evidence = {int(i): float(nats) for i, nats in zip(crowd.ids[matched], people.evidence[found], strict=True)}
        return evidence, np.setdiff1d(np.arange(len(people)), found)

    def _begin(self, fused: FusedFrame, unassigned: Ints) -> list[Event]:
        """Births from unassigned detections."""
        people, count = fused.people, len(unassigned)
        ids = self.issued + 1 + np.arange(count)
        self.issued += count
        places = people.ground[unassigned]
        particles = predicted_particles(np.repeat(places[None], len(self.crowd.particles), 0), _FLOOR, self.rng)
        unknown = (PersonAppearance.unknown(),) * count
        self.crowd = self.crowd.joined_with(
            Crowd(
                ids,
                np.full(count, fused.frame),
                people.height[unassigned],
                places,
                people.covariance[unassigned],
                particles,
                unknown,
            )
        )
        return [(fused.frame, "birth", int(i), 0, "found where nobody was followed") for i in ids]

    def _end(self) -> list[Event]:
        """Remove tracks that left, were undetected for too long, or share the place of another."""
        crowd, config = self.crowd, self.config
        undetected = (self.frame - crowd.last_detection) / self.rig.frame_rate
        left = (self.border.away(crowd.ground) == 0.0) & (undetected > 0)
        close = distances(crowd.ground, crowd.ground) < config.detection.minimum_distance
        deaths: list[Event] = []
        for k, identity in enumerate(crowd.ids.tolist()):
            others = crowd.ids[close[k] & (undetected == 0)]
            if left[k]:
                deaths.append((self.frame, "death", identity, 0, "left the area"))
            elif undetected[k] > config.particles.patience:
                deaths.append((self.frame, "death", identity, 0, f"not found for {config.particles.patience:g} s"))
            elif undetected[k] > _DUPLICATE_TIME and len(others):
                deaths.append((self.frame, "death", identity, int(others[0]), "stands where another was found"))
        self.crowd = crowd.kept(~np.isin(crowd.ids, [event[2] for event in deaths]))
        return deaths

    def _learn(self, frame: ParticleFrame, seconds: float) -> None:
        crowd = self.crowd
        share = min(seconds / self.config.particles.colour_memory, 1.0)
        learned = frame.learned(crowd.ground, crowd.appearances, share, self.rng)
        self.crowd = replace(crowd, appearances=tuple(learned))
