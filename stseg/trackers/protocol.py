"""What goes into a tracker, frame by frame, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from stseg.arrays import Floats, Ints, Labels, Rows, Singles
from stseg.ghosts.explain import People


@dataclass(frozen=True)
class Scene:
    """One frame, explained and fused.

    Attributes
    ----------
    frame
        Its number in the recording.
    people
        Whom the pass of the frame found.
    log_odds : float32 (plane, y, x)
        The volume, nats; nan where no view sees the cell.
    """

    frame: int
    people: People
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

    def predict(self, frame: int) -> Floats:
        """Ground positions of people committed so far, carried to a frame, float64 (n, 2), metres."""


def near_person(ground: Floats, people_ground: Floats, reach: float) -> Ints:
    """The person within reach of each place, the nearest of several, -1 for nobody.

    Parameters
    ----------
    ground : float64 (..., 2)
        Places, metres.
    people_ground : float64 (n, 2)
        People, metres.

    Returns
    -------
    int64 (...)
    """
    if not len(people_ground):
        return np.full(ground.shape[:-1], -1, np.int64)
    away = np.hypot(*np.moveaxis(ground[..., None, :] - people_ground, -1, 0))
    return np.where(away.min(-1) <= reach, away.argmin(-1), -1)
