"""What goes into a tracker, frame by frame, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from stseg.arrays import Labels, Rows, Singles
from stseg.ghosts.expected import Expected
from stseg.ghosts.people import People


@dataclass(frozen=True)
class Scene:
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
class Commit:
    """Frames that are decided.

    Attributes
    ----------
    scenes
        The frames, in order.
    label : int32 (time, plane, y, x)
        Track ids, 0 for background.
    trajectory, events, windows
        Rows of `stseg.tracks`: TRAJECTORY, EVENT, WINDOW.
    """

    scenes: list[Scene]
    label: Labels
    trajectory: Rows
    events: Rows
    windows: Rows


class Tracker(Protocol):
    """Takes frames in order, gives back what is decided as soon as it is."""

    def add(self, scene: Scene) -> list[Commit]:
        """The next frame; what is decided by it."""

    def finish(self) -> list[Commit]:
        """No more frames; what was still open."""

    def expected(self, frame: int) -> Expected | None:
        """Whom the frames before lead to expect in a frame; None in the first."""
