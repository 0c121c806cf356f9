"""Minimum cuts of space-time windows, identities over their overlaps (Khan and Shah 2009, section 5).

See docs/how-it-works.md, Energy and Tracks.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import ClassVar

import numpy as np

from stseg.arrays import Flags, Ints, Labels, Rows, Singles
from stseg.config import Config
from stseg.geometry import Rig
from stseg.geometry.distances import unmatched
from stseg.graphcut.cut import greatest_empty_set
from stseg.graphcut.grid_energy import QUANTUM, GridEnergy
from stseg.graphcut.solvers import SOLVERS, find_solver
from stseg.occupancy.revision import revised_volume
from stseg.records.blobs import Blobs
from stseg.records.people import SAME_PLACE
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sparse_labels import SparseLabels
from stseg.records.sparse_volume import SparseVolume
from stseg.records.tables import WINDOW
from stseg.segmentation.blobs import find_blobs
from stseg.segmentation.cell_labelling import WindowDetections, label_cells
from stseg.segmentation.cell_motion import PlacedTracks, motion_field, same_tracks
from stseg.segmentation.cut_energy import build_energy
from stseg.segmentation.label_energy import BodyShape
from stseg.segmentation.patches import GroundPatches, mark_places, people_squares
from stseg.trackers.alternative_tracks import AcceptedAlternative, Reading
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame
from stseg.trackers.rows import TrackPlaces, event_rows, trajectory_rows
from stseg.trackers.window_existence import TrackedFrame, WindowExistence
from stseg.tracking.filter.prediction import earlier_detections, predicted_places, together
from stseg.tracking.filter.track_filter import TrackFilter
from stseg.tracking.windows.tracklets import form_tracklets
from stseg.tracking.windows.window_association import TrackAssociation, WindowAssignment
from stseg.tracking.windows.windows import ENDLESS, LONGEST, Window, windows

Submit = Callable[[Callable[[], Commit]], Future[Commit]]
"""Begins the solution of a window."""


class CutTracker:
    """Tracks by the minimum cut of overlapping windows; see `TrackingMethod`."""

    final: ClassVar[bool] = False

    def __init__(self, rig: Rig, config: Config, first: int) -> None:
        self.rig, self.config = rig, config
        self.filter = TrackFilter(rig.frame_rate, config)
        self.association = TrackAssociation(rig.frame_rate, config.tracking)
        spread, unassigned = config.body.height_spread, config.occupancy.occupied_share
        self.solver = find_solver(config.segmentation.solver)
        self.existence = WindowExistence(rig, config, self.solver)
        self.context = min(round(config.tracking.context * rig.frame_rate), LONGEST)
        self.pillar = BodyShape(config.occupancy.person_radius, spread, unassigned)
        self.open_frames: list[TrackedFrame] = []
        self.first = self.committed = first
        self.coming = windows(rig.frame_rate, config.tracking, first, ENDLESS)
        self.window = next(self.coming)
        self._submit: Submit = _done
        self._solving = deque[Future[Commit]]()

    def solve_by(self, submit: Submit) -> None:
        """From now on have windows solved by `submit`, one after the other, perhaps in another thread meanwhile."""
        self._submit = submit

    def take(self, decision: AcceptedAlternative) -> list[int]:
        """Replace the tracks, and the people of frames that no window has decided; the numbers of these frames."""
        self.filter, revised = decision.filter, []
        for k, one in enumerate(self.open_frames):
            frame = one.fused.frame
            if frame >= self.committed and frame in decision.readings:
                self.open_frames[k] = self._read_anew(one, decision.readings[frame])
                revised.append(frame)
        return revised

    def _read_anew(self, one: TrackedFrame, reading: Reading) -> TrackedFrame:
        """A frame by another reading."""
        before, people = one.fused.people, reading.explanation.people

        def revised() -> SparseVolume:
            added = people.at(unmatched(people.ground, before.ground, SAME_PLACE))
            return revised_volume(one.fused.volume, before.ground, people.ground, added, self.rig.grid, self.config)

        ghosts = reading.explanation.ghosts
        return TrackedFrame(replace(one.fused, people=people, ghosts=ghosts, made=cache(revised)), reading.tracks)

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a frame; None for the first."""
        return self.filter.predict(frame)

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; commit windows that are solved, and solve the window before it if that is complete.

        A window waits for the time after its last frame in which a hidden person may appear again.
        """
        if fused.frame >= self.window.solve_stop + self.context:
            self._solve_later(self.window)
            self.window = next(self.coming)
            needed = self.window.solve_first - self.context
            self.open_frames = [tracked for tracked in self.open_frames if tracked.fused.frame >= needed]
        tracks = self.filter.update(fused.frame, fused.people, fused.ghosts, observed.evidence)
        self.open_frames.append(TrackedFrame(fused, tracks))
        return self._solved(1)

    def finish(self) -> list[Commit]:
        """Solve the open windows; the run ends here."""
        if not self.open_frames:
            return []
        stop = self.open_frames[-1].fused.frame + 1
        remaining = windows(self.rig.frame_rate, self.config.tracking, self.first, stop)
        for window in remaining:
            if window.commit_stop > self.committed:
                self._solve_later(window)
        return self._solved(0)

    def _solve_later(self, window: Window) -> None:
        """Have a window solved by the frames that are open now."""
        first, stop = window.solve_first - self.context, window.solve_stop + self.context
        around = [one for one in self.open_frames if first <= one.fused.frame < stop]
        self.committed = window.commit_stop
        self._solving.append(self._submit(partial(self._solve, window, around)))

    def _solved(self, most: int) -> list[Commit]:
        """The next windows that are solved; waits until at most so many are not."""
        commits = []
        while self._solving and (len(self._solving) > most or self._solving[0].done()):
            commits.append(self._solving.popleft().result())
        return commits

    def _solve(self, window: Window, around: list[TrackedFrame]) -> Commit:
        frames = self.existence.revised(around, window.solve_first, window.solve_stop)
        patches, log_odds, energy = self._cut_out(frames)
        cut = self.solver.grid(energy)
        label = self._divide(window, frames, patches, energy, cut.occupied)
        reach = self.config.occupancy.person_radius
        blobs = [
            find_blobs(cells, volume, one.fused.people.ground, one.tracks, reach, patches)
            for cells, volume, one in zip(label, log_odds, frames, strict=True)
        ]
        tracklets = form_tracklets(blobs, window.solve_first)
        decision = self.association.decide(window, blobs, tracklets)
        frames_of = window.index, window.solve_first, window.solve_stop, window.commit_first, window.commit_stop
        row = np.array([(*frames_of, energy.of(cut.occupied), QUANTUM, cut.nodes)], WINDOW)
        return self._commit(window, frames, patches, label, blobs, decision, row)

    def _cut_out(self, frames: list[TrackedFrame]) -> tuple[GroundPatches, Singles, GridEnergy]:
        """Patches of the ground that are enough, and the window's log-odds (time, plane, row, column) and energy there.

        See `stseg.segmentation.patches`.
        """
        grid, squares = self.rig.grid, self._squares(frames)
        if self.solver is not SOLVERS["stseg"]:  # others take whole grids
            squares[:] = True
        while True:
            patches = GroundPatches.of(grid, squares)
            log_odds = np.stack([patches.log_odds(tracked.fused.volume) for tracked in frames])
            energy = self._energy(frames, patches, log_odds)
            if not patches.border.any():
                return patches, log_odds, energy
            open_border = patches.border & ~greatest_empty_set(energy).all((0, 1))
            if not open_border.any():
                return patches, log_odds, energy
            mark_places(squares, patches.place[open_border], grid)

    def _squares(self, frames: list[TrackedFrame]) -> Flags:
        """Squares of the ground with people, or with log-odds above 0."""
        grid, ahead = self.rig.grid, []
        for now, then in zip(frames, [*frames[1:], frames[-1]], strict=True):
            first_rows, later = same_tracks(now.tracks, then.tracks)
            ahead.append(now.fused.people.ground.copy())
            ahead[-1][first_rows] = then.fused.people.ground[later]
        here = np.concatenate([one.fused.people.ground for one in frames])
        squares = people_squares(grid, here, np.concatenate(ahead), self.config.occupancy.person_radius)
        mark_places(squares, np.concatenate([one.fused.volume.occupied_places() for one in frames]), grid)
        return squares

    def _energy(self, frames: list[TrackedFrame], patches: GroundPatches, log_odds: Singles) -> GridEnergy:
        reach, grid = self.config.occupancy.person_radius, self.rig.grid
        placed = [PlacedTracks(one.fused.people.ground, one.tracks) for one in frames]
        motion = [motion_field(*pair, reach, grid.cell, patches.ground) for pair in pairwise(placed)]
        steps = np.array(motion, np.int64).reshape(-1, *patches.place.shape, 2)
        successor, present = patches.successors(steps), patches.place >= 0
        return build_energy(log_odds, successor, grid, self.config.segmentation, present)

    def _divide(
        self, window: Window, frames: list[TrackedFrame], patches: GroundPatches, energy: GridEnergy, occupied: Flags
    ) -> Labels:
        """Label the occupied cells with the filter tracks of this window and of active tracks."""
        tails = [track.tail for track in self.association.active]
        mean_height = self.config.body.height_mean
        histories = [earlier_detections(tails, window.solve_first, mean_height, self.config.motion)]
        histories += [tracked.detections() for tracked in frames]
        places = predicted_places(
            together(histories), window.solve_first, window.solve_stop, self.rig.frame_rate, self.config.tracking
        )
        found = WindowDetections([one.fused.people.ground for one in frames], [one.tracks for one in frames])
        return label_cells(energy, occupied, found, places, self.pillar, patches, self.solver)

    def _commit(
        self,
        window: Window,
        frames: list[TrackedFrame],
        patches: GroundPatches,
        label: Labels,
        blobs: list[Blobs],
        decision: WindowAssignment,
        row: Rows,
    ) -> Commit:
        kept = range(window.commit_first - frames[0].fused.frame, window.commit_stop - frames[0].fused.frame)
        shape, labels, rows = self.rig.grid.shape, [], []
        for k in kept:
            identity = np.append(0, decision.identity[k]).astype(np.int32)
            plane, sheet = np.divmod(np.flatnonzero(label[k]), patches.place.size)
            place = patches.place.reshape(-1)[sheet]
            cell = plane * (shape[1] * shape[2]) + place
            labels.append(SparseLabels(shape, cell, identity[blobs[k].cells.reshape(-1)[place]]))
            rows.append(self._rows(frames[k].fused, blobs[k], decision.identity[k]))
        trajectory = np.concatenate(rows)
        return Commit([frames[k].fused for k in kept], labels, trajectory, event_rows(decision.events), row)

    def _rows(self, fused: FusedFrame, blobs: Blobs, identity: Ints) -> Rows:
        """TRAJECTORY rows of the detections that the blobs of identities hold."""
        named, people = np.flatnonzero(identity), fused.people
        detected, (tall, wide) = blobs.person[named], people.sizes.measured(self.config.body)
        tracks = TrackPlaces(
            identity[named],
            people.ground[detected],
            people.covariance[detected],
            tall[detected],
            wide[detected],
            people.evidence[detected],
        )
        return trajectory_rows(fused.frame, tracks, blobs.extent[named])


def _done(solution: Callable[[], Commit]) -> Future[Commit]:
    """A window that is solved at once."""
    done = Future[Commit]()
    done.set_result(solution())
    return done
