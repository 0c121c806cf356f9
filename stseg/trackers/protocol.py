"""The tracker protocol: fused frames in, committed frames out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from stseg.arrays import Labels, Observation, Rows, Singles, ViewEvidence
from stseg.config import Config
from stseg.geometry import Rig
from stseg.records.people import People
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sparse_labels import SparseLabels
from stseg.records.sparse_volume import SparseVolume


@dataclass(frozen=True)
class FusedFrame:
    """One frame after detection and fusion."""

    frame: int
    """Its number in the recording."""
    people: People
    """Its detections."""
    ghosts: People
    """Rejected candidates."""
    made: SparseVolume | Callable[[], SparseVolume]
    """The volume, or a function that gives it where the fusion may still be at work."""

    @property
    def volume(self) -> SparseVolume:
        """The log-odds as they were made."""
        return self.made() if callable(self.made) else self.made

    @property
    def log_odds(self) -> Singles:
        """The log-odds of all cells, float32 (plane, y, x), nats; nan where no view sees the cell."""
        return self.volume.dense()


@dataclass(frozen=True)
class FrameObservations:
    """The observations and evidence of a frame, in the rig's order; valid only while the frame is added."""

    observations: Sequence[Observation]
    """Raw data of each camera; `stseg.baselines.colour_views` extracts colour."""
    evidence: Sequence[ViewEvidence]
    """Foreground of each view: boxes, a likelihood map float32 (v, u), or None for a blind view."""


@dataclass(frozen=True)
class Commit:
    """Committed frames and their tracks."""

    frames: list[FusedFrame]
    """Frames in order."""
    labels: Sequence[SparseLabels]
    """Track ids of each frame's cells."""
    trajectory: Rows
    """Rows of `stseg.records.tables`, TRAJECTORY."""
    events: Rows
    """Rows of EVENT."""
    windows: Rows
    """Rows of WINDOW."""

    @property
    def label(self) -> Labels:
        """int32 (time, plane, y, x): track ids, 0 for background."""
        return np.stack([one.dense() for one in self.labels])


class TrackingMethod(Protocol):
    """Takes frames in order from the run's `first`, and returns committed frames as soon as they are final."""

    final: ClassVar[bool]
    """Whether committed identities are final; else global association decides them again over the whole run."""

    def __init__(self, rig: Rig, config: Config, first: int) -> None: ...

    def add(self, fused: FusedFrame, observed: FrameObservations) -> list[Commit]:
        """Add a frame; returns the frames that it completes."""

    def finish(self) -> list[Commit]:
        """End the run; returns the frames that were open."""

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of all tracks for a frame; None for the first."""
