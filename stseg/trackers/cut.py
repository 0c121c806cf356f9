"""Graph cuts of space-time windows, identities over their overlaps (KS09 section 5; METHODS 4, 5)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from stseg.arrays import Flags, Ints, Labels, Rows
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.sampling import Sampling
from stseg.graphcut.energy import QUANTUM, Energy
from stseg.graphcut.solvers import find_solver
from stseg.model.blobs import Blobs
from stseg.model.predicted_tracks import PredictedTracks
from stseg.model.tables import WINDOW
from stseg.segmentation.blobs import find_blobs
from stseg.segmentation.energy import build_energy
from stseg.segmentation.labelling import WindowDetections, WindowLabels, label_cells
from stseg.segmentation.motion import motion_field
from stseg.segmentation.unary import BodyShape
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import event_rows, trajectory_rows, views_at
from stseg.tracking.prediction import DetectionHistory, earlier_detections, predicted_places, together
from stseg.tracking.track_filter import TrackFilter
from stseg.tracking.tracklets import form_tracklets
from stseg.tracking.window_association import TrackAssociation, WindowAssignment
from stseg.tracking.windows import Window, windows

_ENDLESS = 1 << 62
"""A stop that is not known yet."""


@dataclass(frozen=True)
class _Linked:
    """A frame and the chains of its people."""

    scene: FusedFrame
    chains: Ints

    def sightings(self) -> DetectionHistory:
        """Who was seen where."""
        people, frame = self.scene.people, np.full(len(self.chains), self.scene.frame)
        return DetectionHistory(frame, self.chains, people.ground, people.covariance, people.height)


class CutTracker:
    """Follows people by the minimum cut of one window after the other.

    Parameters
    ----------
    rig, config
        The scene, and the constants of all stages.
    first
        The run's first frame.
    """

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        self.rig, self.config = rig, config
        self.views = Sampling.of(rig, "point").views()
        self.walkers = TrackFilter(rig.frame_rate, config)
        self.identities = TrackAssociation(rig.frame_rate, config.tracking)
        spread, stranger = config.body.height_spread, config.occupancy.occupied_share
        self.solver = find_solver(config.segmentation.solver)
        self.pillar = BodyShape(config.occupancy.person_radius, spread, stranger)
        self.held: list[_Linked] = []
        self.first = self.committed = first
        self.coming = windows(rig.frame_rate, config.tracking, first, _ENDLESS)
        self.window = next(self.coming)

    def expected(self, frame: int) -> PredictedTracks | None:
        """Whom the frames before lead to expect."""
        return self.walkers.expected(frame)

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """The next frame; the window before it, if it is complete.

        A window waits for the frame after its last: only then is it known not to be the run's last one, which commits
        to its end.
        """
        del shown
        done = []
        if scene.frame >= self.window.solve_stop:
            done.append(self._solve(self.window))
            self.window = next(self.coming)
            self.held = [linked for linked in self.held if linked.scene.frame >= self.window.solve_first]
        chains = self.walkers.follow(scene.frame, scene.people, scene.ghosts)
        self.held.append(_Linked(scene, chains))
        return done

    def finish(self) -> list[Commit]:
        """Solve what is still open, in the windows of a run that ends here."""
        if not self.held:
            return []
        stop = self.held[-1].scene.frame + 1
        remaining = windows(self.rig.frame_rate, self.config.tracking, self.first, stop)
        return [self._solve(window) for window in remaining if window.commit_stop > self.committed]

    def _solve(self, window: Window) -> Commit:
        held = [linked for linked in self.held if window.solve_first <= linked.scene.frame < window.solve_stop]
        energy = self._energy(held)
        cut = self.solver.grid(energy)
        label = self._divide(window, held, energy, cut.occupied).label
        reach, grid = self.config.occupancy.person_radius, self.rig.grid
        blobs = [
            find_blobs(cells, linked.scene.log_odds, linked.scene.people.ground, linked.chains, reach, grid)
            for cells, linked in zip(label, held, strict=True)
        ]
        pieces = form_tracklets(blobs, window.solve_first, self.config.tracking)
        decision = self.identities.decide(window, blobs, pieces)
        row = np.array([(*_ranges(window), energy.of(cut.occupied), QUANTUM, cut.nodes)], WINDOW)
        self.committed = window.commit_stop
        return self._commit(window, held, label, blobs, decision, row)

    def _energy(self, held: list[_Linked]) -> Energy:
        log_odds = np.stack([linked.scene.log_odds for linked in held])
        reach, grid = self.config.occupancy.person_radius, self.rig.grid
        motion = [
            motion_field(now.scene.people.ground, then.scene.people.ground, now.chains, then.chains, reach, grid)
            for now, then in pairwise(held)
        ]
        steps = np.array(motion, np.int64).reshape(-1, *grid.shape[1:], 2)
        return build_energy(log_odds, steps, grid, self.config.segmentation)

    def _divide(self, window: Window, held: list[_Linked], energy: Energy, occupied: Flags) -> WindowLabels:
        """Whose the occupied cells are: chains of this window and of tracks that live."""
        tails = [track.tail for track in self.identities.alive]
        mean_height = self.config.body.height_mean
        seen = [earlier_detections(tails, window.solve_first, mean_height, self.config.motion)]
        seen += [linked.sightings() for linked in held]
        places = predicted_places(
            together(seen), window.solve_first, window.solve_stop, self.rig.frame_rate, self.config.tracking
        )
        found = WindowDetections([linked.scene.people.ground for linked in held], [linked.chains for linked in held])
        return label_cells(energy, occupied, found, places, self.pillar, self.rig.grid, self.solver)

    def _commit(
        self,
        window: Window,
        held: list[_Linked],
        label: Labels,
        blobs: list[Blobs],
        decision: WindowAssignment,
        row: Rows,
    ) -> Commit:
        kept = range(window.commit_first - held[0].scene.frame, window.commit_stop - held[0].scene.frame)
        named = np.zeros((len(kept), *self.rig.grid.shape), np.int32)
        rows = []
        for k, cells in zip(kept, named, strict=True):
            identity = np.append(0, decision.identity[k])
            cells[:] = np.where(label[k] != 0, identity[blobs[k].cells], 0)
            rows.append(self._rows(held[k].scene, blobs[k], decision.identity[k]))
        scenes = [held[k].scene for k in kept]
        return Commit(scenes, named, np.concatenate(rows), event_rows(decision.events), row)

    def _rows(self, scene: FusedFrame, blobs: Blobs, identity: Ints) -> Rows:
        """Where a blob holds a person of the pass, the pass knows best where; else the blob's mass tells."""
        named = np.flatnonzero(identity)
        person = blobs.person[named]
        held, who = person >= 0, person.clip(0)
        people = scene.people if len(scene.people) else None
        ground, covariance = blobs.ground[named].copy(), blobs.covariance[named].copy()
        height, score = blobs.height[named].copy(), blobs.mass[named].copy()
        width = np.full(len(named), self.config.body.width_mean)
        if people is not None:
            ground[held], covariance[held] = people.ground[who[held]], people.covariance[who[held]]
            height[held], score[held] = people.sizes.height[who[held]], people.evidence[who[held]]
            width[held] = people.sizes.width[who[held]]
        views = views_at(self.views, ground, self.rig.grid)
        return trajectory_rows(
            scene.frame, identity[named], ground, covariance, height, width, blobs.extent[named], score, views
        )


def _ranges(window: Window) -> tuple[int, int, int, int, int]:
    return window.index, window.solve_first, window.solve_stop, window.commit_first, window.commit_stop
