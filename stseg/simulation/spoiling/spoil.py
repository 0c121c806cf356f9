"""Spoiled silhouettes and boxes: a scene with masks and boxes that err as segmentations and detectors do.

Colour frames, instance images and the truth stay as they are. Errors of a frame depend on the scene's seed, the camera
and the frame alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes, Floats
from stseg.errors import ConfigError, one_of
from stseg.geometry import Camera
from stseg.geometry.rig import BODY_HEIGHT
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
            raise ConfigError("spoil", "kind", repr(self.kind), one_of(self.kind, STRENGTHS))
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
