"""A scene filmed: frames of all cameras one after the other, with the truth of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes, Floats, Rows
from stseg.geometry import Rig
from stseg.simulate.cameras import build_rig, turns
from stseg.simulate.render import Viewer
from stseg.simulate.scene import SceneSpec
from stseg.simulate.walkers import walk

EMPTY_FRAMES = 40
"""Length of the films of the empty room; they end just before the first frame."""


@dataclass(frozen=True, slots=True)
class View:
    """One camera's frame and what is known of it.

    Attributes
    ----------
    image : uint8 (v, u, 3)
        Blue, green, red.
    instances : uint16 (v, u)
        The id of the person whom each pixel shows, 0 for nobody.
    boxes
        What a detector would find.
    """

    image: Bytes
    instances: NDArray[np.uint16]
    boxes: Boxes


@dataclass(frozen=True, slots=True)
class Moment:
    """One frame of the recording.

    Attributes
    ----------
    frame
        From 0.
    truth : TRUTH (n,)
        Who is in the area and where, see `stseg.simulate.walkers`.
    views
        One a camera, in the rig's order.
    """

    frame: int
    truth: Rows
    views: tuple[View, ...]


class Film:
    """A scene and its cameras.

    Parameters
    ----------
    spec
        The scene.

    Attributes
    ----------
    rig
        Its cameras and grid.
    """

    def __init__(self, spec: SceneSpec) -> None:
        self.spec = spec
        self.rig: Rig = build_rig(spec)
        self._viewers = [Viewer(spec, *place) for place in zip(self.rig.cameras, turns(spec), strict=True)]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.spec.frames

    @property
    def quality(self) -> int:
        """JPEG quality of the frames, 1..100."""
        return self.spec.quality

    def empty(self) -> Iterator[tuple[Bytes, ...]]:
        """Frames of the empty room, one uint8 (v, u, 3) a camera, from the time before the first frame."""
        for frame in range(-EMPTY_FRAMES, 0):
            yield tuple(viewer.empty(frame) for viewer in self._viewers)

    def moments(self) -> Iterator[Moment]:
        """The frames from the first to the last."""
        half: Floats = np.array(self.spec.area) / 2
        for crowd in walk(self.spec):
            truth = crowd.truth(self.spec.area)
            scene = self._pose(crowd)
            yield Moment(crowd.frame, truth, tuple(viewer.view(scene, half) for viewer in self._viewers))
