"""The stages of one rig, from observations to tracks and a volume; nothing in them changes while a recording runs.

    observation -> evidence -> explanation -> volume -> window -> cut -> tracklets -> tracks
    (foreground)   (detection)  (occupancy)   (trackers: segmentation, tracking)

What is learned from a recording, and its frames, are of a `stseg.engine.session.Session`.
"""

from __future__ import annotations

from collections.abc import Sequence

from stseg.arrays import Ints, Rows
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.detection.proposals import Proposals
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable
from stseg.model.tables import Tracks
from stseg.occupancy.volume import Occupancy
from stseg.trackers import find_tracker
from stseg.tracking.final_tracks import committed_tracks, final_tracks
from stseg.tracking.track_boxes import box_rows


class Pipeline:
    """The stages of one rig, with their tables; sessions share it.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera's evidence is: "boxes" or "pixels".
    config
        The constants of all stages.
    tracker
        Its name, one of `stseg.trackers.TRACKERS`.
    """

    def __init__(self, rig: Rig, kinds: Sequence[str], config: Config, tracker: str) -> None:
        self.rig, self.config, self.tracker = rig, config, find_tracker(tracker)
        self.detector = Detector(rig, kinds, config.detection, config.body, config.error_rates)
        self.occupancy = Occupancy(rig, kinds, config.occupancy, config.detection, config.body, config.error_rates)
        self.proposals = Proposals(rig, kinds, config)

    def finished(self, committed: Rows, events: Rows, shown: Rig | None = None) -> tuple[Tracks, Ints]:
        """The tracks of a whole run, and the track id of each committed row.

        Parameters
        ----------
        committed : TRAJECTORY (n,)
            Rows of all frames, as the tracker committed them.
        events : EVENT (k,)
            All events, as the tracker committed them.
        shown
            The rig in whose pixels the tracks' boxes are given; by default this one.
        """
        rate, config = self.rig.frame_rate, self.config
        if self.tracker.final:
            whole = committed_tracks(committed, events, rate, config.tracking)
        else:
            whole = final_tracks(committed, events, rate, self.detector.border, config)
        tables = [view.table for view in self.detector.views]
        if shown is not None:
            tables = [BodyTable.of(camera, shown.grid) for camera in shown.cameras]
        return Tracks(whole.trajectory, box_rows(tables, whole.trajectory), whole.events), whole.identity
