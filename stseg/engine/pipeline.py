"""The stages of one rig, from observations to tracks and a volume; nothing in them changes while a recording runs.

    observation -> evidence -> explanation -> volume -> window -> cut -> tracklets -> tracks
    (foreground)   (detection)  (occupancy)   (trackers: segmentation, tracking)

What is learned from a recording, and its frames, are of a `stseg.engine.session.Session`.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Protocol, cast

import numpy as np

from stseg.arrays import Floats, Ints, Observation, Rows, Singles, ViewEvidence
from stseg.bodies.pillars import BodyTable
from stseg.config import Config
from stseg.detection.appearance import appearance_rows
from stseg.detection.detector import Detector
from stseg.geometry import Rig
from stseg.identities.association import IdentityProblem
from stseg.identities.search.constraints import NO_CONSTRAINTS, Constraints
from stseg.occupancy.volume import Occupancy
from stseg.records.border import Border
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation
from stseg.records.tables import APPEARANCE, Tracks
from stseg.trackers import find_tracker
from stseg.trackers.protocol import TrackingMethod
from stseg.trajectories.final_tracks import (
    AnyCommittedRows,
    CommittedRows,
    FinalTracks,
    box_rows,
    bridged_rows,
    committed_tracks,
    final_tracks,
)


class CandidateSource(Protocol):
    """Candidates of a frame besides those of the detector."""

    def of(
        self, evidence: Sequence[ViewEvidence], fuse: Callable[[Sequence[ViewEvidence], Explanation], Singles]
    ) -> Candidates:
        """Candidates from each view's evidence, and from a volume (plane, y, x) that is fused under an explanation."""


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
    axes : float64 (feature, k), or None
        By which appearance features of boxes are reduced; None where boxes have none.
    """

    def __init__(
        self, rig: Rig, kinds: Sequence[str], config: Config, tracker: str, axes: Floats | None = None
    ) -> None:
        self.rig, self.config, self.tracker = rig, config, find_tracker(tracker)
        self.detector = Detector(rig, kinds, config.detection, config.body, config.error_rates)
        self.occupancy = Occupancy(rig, kinds, config.occupancy, config.detection, config.body, config.error_rates)
        self.proposals = find_candidate_source(rig, kinds, config)
        self.axes = axes

    def appearance_rows(
        self,
        frame: int,
        explanation: Explanation,
        observations: Sequence[Observation],
        evidence: Sequence[ViewEvidence],
        images: Sequence[Observation] = (),
    ) -> Rows:
        """APPEARANCE rows of a frame, as far as the configuration wants them; `images` are beside detections."""
        if not decides_by_appearance(self.tracker, self.config):
            return np.zeros(0, APPEARANCE)
        tables = [view.table for view in self.detector.views]
        return appearance_rows(frame, explanation, tables, self.axes, observations, evidence, images)

    def finished(self, rows: CommittedRows, image_rig: Rig | None = None) -> tuple[Tracks, Ints]:
        """The tracks of a whole run, and the track id of each committed row.

        Boxes are in this rig's pixels or those of another.
        """
        whole = finished_tracks(self.rig, self.config, self.tracker, rows)
        return _with_boxes(whole, image_rig or self.rig, self.config.body.breadth), whole.identity


def find_candidate_source(rig: Rig, kinds: Sequence[str], config: Config) -> CandidateSource | None:
    """The source of candidates that the configuration names; None for the detector's alone."""
    if config.proposals.source == "lattice":
        return None
    proposals = import_module("stseg.baselines.huang_wang_2012.proposals")  # where it is asked for
    return cast(CandidateSource, proposals.Proposals(rig, kinds, config))


def decides_by_appearance(tracker: type[TrackingMethod], config: Config) -> bool:
    """Whether appearance is evidence of identity."""
    return not tracker.final and config.tracking.appearance != "none"


def finished_tracks(rig: Rig, config: Config, tracker: type[TrackingMethod], rows: AnyCommittedRows) -> FinalTracks:
    """The tracks of a whole run. Rig, configuration and tracker are those that committed the rows."""
    if not tracker.final:
        return final_tracks(rows, rig.frame_rate, Border.of(rig), config)
    return committed_tracks(rows.trajectory, rows.events, rig.frame_rate, config.tracking)


def associated_tracks(
    rig: Rig, config: Config, rows: CommittedRows, image_rig: Rig, constraints: Constraints = NO_CONSTRAINTS
) -> tuple[Tracks, Ints]:
    """The tracks of a whole run and the track id of each committed row, under constraints on these.

    Boxes are in the pixels of `image_rig`; the identities of the run's tracker were not final.
    """
    whole = final_tracks(rows, rig.frame_rate, Border.of(rig), config, constraints)
    return _with_boxes(whole, image_rig, config.body.breadth), whole.identity


def identity_problem(
    rig: Rig, config: Config, committed: Rows, appearance: Rows, constraints: Constraints = NO_CONSTRAINTS
) -> IdentityProblem:
    """Identities of the committed rows, as a problem of which single decisions can be tried."""
    bridged = bridged_rows(committed, rig.frame_rate, config.tracking)
    return IdentityProblem.of(bridged, (appearance,), rig.frame_rate, Border.of(rig), config, constraints)


def box_tables(image_rig: Rig, breadth: float) -> list[BodyTable]:
    """Tables of the views, for boxes in the pixels of their images."""
    return [BodyTable.of(camera, image_rig.grid, breadth=breadth) for camera in image_rig.cameras]


def _with_boxes(whole: FinalTracks, image_rig: Rig, breadth: float) -> Tracks:
    return Tracks(whole.trajectory, box_rows(box_tables(image_rig, breadth), whole.trajectory), whole.events)
