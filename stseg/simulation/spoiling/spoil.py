"""Spoiled silhouettes and boxes: a scene with masks and boxes that err as segmentations and detectors do.

Colour frames, instance images and the truth stay as they are. Errors of a frame depend on the scene's seed, the camera
and the frame alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes, Floats, Rows
from stseg.errors import ConfigError
from stseg.geometry import Camera, Rig
from stseg.geometry.rig import BODY_HEIGHT
from stseg.simulation.film import SceneFilm
from stseg.simulation.scene import Kind
from stseg.simulation.spoiling.errors import BOX_KINDS, MASK_KINDS, Moment

_BODY_WIDTH = 0.42
"""Width of a common body, metres."""


@dataclass(frozen=True)
class Spoil:
    """One kind of error, of `STRENGTHS`, and its strength in the kind's own unit."""

    kind: str
    strength: float

    def __post_init__(self) -> None:
        if self.kind not in STRENGTHS:
            raise ConfigError("spoil", "kind", repr(self.kind), f"one of {', '.join(STRENGTHS)}")
        most = MAX_STRENGTHS[self.kind]
        if not 0 <= self.strength <= most:
            raise ConfigError("spoil", self.kind, f"{self.strength:g}", f"a strength from 0 to {most:g}")


STRENGTHS: dict[str, tuple[float, float, float]] = {
    "dilation": (0.1, 0.2, 0.3),  # share of a body's width, both sides together
    "erosion": (0.1, 0.2, 0.3),  # likewise
    "holes": (0.1, 0.25, 0.4),  # share of the silhouettes
    "legs": (0.1, 0.2, 0.35),  # share of the height that is missing
    "shadows": (0.1, 0.2, 0.4),  # length beside the feet, share of the height
    "flicker": (0.02, 0.05, 0.1),  # share of the time that a person is missing in a view, half a second each
    "staying": (1, 2, 4),  # blobs of a body's size in a view that come and stay
    "rain": (5, 20, 60),  # small blobs in a view and frame
    "jpeg": (0.5, 0.8, 0.95),  # 1 - quality / 100
    "jitter": (0.05, 0.1, 0.2),  # standard deviation of a box's edges, share of its size
    "missed": (0.1, 0.2, 0.4),  # share of the boxes
    "doubled": (0.1, 0.2, 0.4),  # likewise
}
"""The kinds, each with a weak, a middle and a strong strength."""
MAX_STRENGTHS = {kind: {"staying": 20.0, "rain": 1000.0}.get(kind, 1.0) for kind in STRENGTHS}
"""Greatest strength of each kind."""


@dataclass(frozen=True, slots=True)
class SpoiledView:
    """One camera's frame, as of `stseg.simulation.rendering.render.RenderedView`; mask uint8 (v, u), 0..255."""

    image: Bytes
    instances: NDArray[np.uint16]
    boxes: Boxes
    mask: Bytes


@dataclass(frozen=True, slots=True)
class SpoiledFrame:
    """One frame of all cameras, as of `stseg.simulation.film.RenderedFrame`."""

    frame: int
    truth: Rows
    views: tuple[SpoiledView, ...]


class SpoiledFilm:
    """A film with errors in its masks and boxes, one after the other in the order of `spoils`."""

    def __init__(self, film: SceneFilm, spoils: Sequence[Spoil]) -> None:
        self.film, self.spoils = film, tuple(spoils)
        centre = np.array([[np.mean(film.rig.grid.x), np.mean(film.rig.grid.y)]])
        self._widths = [body_width(camera, centre) for camera in film.rig.cameras]

    @property
    def rig(self) -> Rig:
        """The film's cameras and grid."""
        return self.film.rig

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.film.frames

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Kinds of foreground that are written."""
        return self.film.kinds

    @property
    def quality(self) -> int:
        """JPEG quality of the colour frames, 1..100."""
        return self.film.quality

    def empty(self) -> Iterator[tuple[Bytes, ...]]:
        """Frames of the empty room."""
        return self.film.empty()

    def frame_sets(self) -> Iterator[SpoiledFrame]:
        """All frames in order."""
        seed, rate = self.film.spec.seed, self.film.spec.frame_rate
        for frame_set in self.film.frame_sets():
            moments = (Moment(seed, k, frame_set.frame, rate, width) for k, width in enumerate(self._widths))
            views = tuple(
                SpoiledView(
                    view.image,
                    view.instances,
                    spoiled_boxes(view.boxes, self.spoils, moment),
                    spoiled_mask(view.mask, view.instances, self.spoils, moment),
                )
                for view, moment in zip(frame_set.views, moments, strict=True)
            )
            yield SpoiledFrame(frame_set.frame, frame_set.truth, views)


def body_width(camera: Camera, ground: Floats) -> float:
    """Width of a common body at a ground point (1, 2), pixels of the camera's image."""
    foot, _ = camera.project(ground, 0.0)
    head, _ = camera.project(ground, BODY_HEIGHT)
    return float(np.hypot(*(head - foot)[0])) * _BODY_WIDTH / BODY_HEIGHT


def spoiled_mask(mask: Bytes, people: NDArray[np.uint16], spoils: Sequence[Spoil], moment: Moment) -> Bytes:
    """A mask uint8 (v, u), 0..255, with errors; `people` (v, u) names the person at each pixel, 0 for none."""
    for spoil in spoils:
        if spoil.kind in MASK_KINDS:
            mask = MASK_KINDS[spoil.kind](mask, people, spoil.strength, moment)
    return mask


def spoiled_boxes(boxes: Boxes, spoils: Sequence[Spoil], moment: Moment) -> Boxes:
    """A view's boxes with errors."""
    for spoil in spoils:
        if spoil.kind in BOX_KINDS:
            boxes = BOX_KINDS[spoil.kind](boxes, spoil.strength, moment.stream(spoil.kind))
    return boxes
