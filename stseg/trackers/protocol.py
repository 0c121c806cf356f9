"""What goes into a tracker, frame by frame, and what comes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from stseg.arrays import Labels, Observation, Rows, Singles, ViewEvidence
from stseg.config import Config
from stseg.geometry import Rig
from stseg.model.people import People
from stseg.model.predicted_tracks import PredictedTracks

STAYING, FORGETTING = 1.0, 4.0
"""What trackers without odds of their own expect: log-odds that somebody found in one frame is found in the next, nats,
and how fast they fall after, nats per second."""


@dataclass(frozen=True)
class FusedFrame:
    """One frame, explained and fused.

    Attributes
    ----------
    frame
        Its number in the recording.
    people
        Whom the pass of the frame found.
    ghosts
        Candidates that the pass did not believe.
    log_odds : float32 (plane, y, x)
        The volume, nats; nan where no view sees the cell.
    """

    frame: int
    people: People
    ghosts: People
    log_odds: Singles


@dataclass(frozen=True)
class FrameObservations:
    """What the cameras showed in a frame, in the rig's order: there while the frame is added, held by no one after.

    Attributes
    ----------
    observations
        What each delivered; see `stseg.trackers.colour_views` for a tracker that needs colour.
    evidence
        What the foreground made of it: boxes, a likelihood map float32 (v, u), or None where the view is blind.
    """

    observations: Sequence[Observation]
    evidence: Sequence[ViewEvidence]


@dataclass(frozen=True)
class Commit:
    """Frames that are decided.

    Attributes
    ----------
    scenes
        The frames, in order.
    label : int32 (time, plane, y, x)
        Track ids, 0 for background.
    trajectory, events, windows
        Rows of `stseg.model.tables`: TRAJECTORY, EVENT, WINDOW.
    """

    scenes: list[FusedFrame]
    label: Labels
    trajectory: Rows
    events: Rows
    windows: Rows


class Tracker(Protocol):
    """Takes frames in order, gives back what is decided as soon as it is.

    Parameters
    ----------
    rig, config
        The scene, and the constants of all stages.
    first
        The run's first frame.
    """

    final: ClassVar[bool]
    """Whether who is who stands as it is committed; else it is decided again from the whole run (`identity.whole`)."""

    def __init__(self, rig: Rig, config: Config, first: int) -> None: ...

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """The next frame; what is decided by it."""

    def finish(self) -> list[Commit]:
        """No more frames; what was still open."""

    def expected(self, frame: int) -> PredictedTracks | None:
        """Whom the frames before lead to expect in a frame; None in the first."""
