"""Render a scene: frame sets of all cameras in order, with their truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Bytes, Rows
from stseg.geometry import Rig
from stseg.simulation.crowd.script import walk_routes
from stseg.simulation.crowd.social_forces import walk_freely
from stseg.simulation.rendering.body import pose, upright_cylinders
from stseg.simulation.rendering.cameras import build_rig, turns
from stseg.simulation.rendering.render import RenderedView, Viewer
from stseg.simulation.scene import SceneSpec
from stseg.simulation.spoiling.errors import Moment
from stseg.simulation.spoiling.spoil import Spoil, body_width, spoiled_boxes, spoiled_mask

EMPTY_FRAMES = 40
"""Length of the films of the empty room; they end just before the first frame."""


@dataclass(frozen=True, slots=True)
class RenderedFrame:
    """One frame of the recording."""

    frame: int
    """From 0."""
    truth: Rows
    """TRUTH (n,): people inside the area, see `stseg.simulation.crowd.social_forces`."""
    views: tuple[RenderedView, ...]
    """One a camera, in the rig's order."""


class SceneFilm:
    """A scene and its cameras; frames are rendered on demand, so that it may be long.

    Parameters
    ----------
    spec
        The scene.
    spoils
        Errors of masks and boxes, one after the other.
    """

    def __init__(self, spec: SceneSpec, spoils: Sequence[Spoil] = ()) -> None:
        self.spec, self.spoils = spec, tuple(spoils)
        self.rig: Rig = build_rig(spec)
        """Its cameras and grid."""
        self.viewers = [Viewer(spec, *place) for place in zip(self.rig.cameras, turns(spec), strict=True)]

    def empty(self) -> Iterator[tuple[Bytes, ...]]:
        """Frames of the empty room, one uint8 (v, u, 3) a camera, from the time before the first frame."""
        for frame in range(-EMPTY_FRAMES, 0):
            yield tuple(viewer.empty(frame) for viewer in self.viewers)

    def frame_sets(self) -> Iterator[RenderedFrame]:
        """All frames in order, with every camera's view and the truth."""
        for crowd in (walk_routes if self.spec.routes else walk_freely)(self.spec):
            wide, length = self.spec.cylinder, self.spec.length or self.spec.cylinder
            bodies = upright_cylinders(crowd, wide, length) if wide else pose(crowd)
            views = tuple(viewer.view(crowd, bodies) for viewer in self.viewers)
            spoiled = self._spoiled(crowd.frame, views) if self.spoils else views
            yield RenderedFrame(crowd.frame, crowd.truth(self.spec.area), spoiled)

    def _spoiled(self, frame: int, views: Sequence[RenderedView]) -> tuple[RenderedView, ...]:
        """Views with errors in their masks and boxes."""
        centre, found = np.array([[np.mean(self.rig.grid.x), np.mean(self.rig.grid.y)]]), []
        for k, (camera, view) in enumerate(zip(self.rig.cameras, views, strict=True)):
            moment = Moment(self.spec.seed, k, frame, self.spec.frame_rate, body_width(camera, centre))
            boxes = spoiled_boxes(view.boxes, self.spoils, moment)
            mask = spoiled_mask(view.mask, view.instances, self.spoils, moment)
            found.append(replace(view, boxes=boxes, spoiled=mask))
        return tuple(found)
