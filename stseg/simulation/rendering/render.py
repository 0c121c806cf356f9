"""Render one camera's frames of a scene: room, shadows, people and sensor."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes, Floats, Ints, Singles
from stseg.geometry import Camera
from stseg.simulation.crowd.social_forces import CrowdFrame
from stseg.simulation.rendering.body import Bodies
from stseg.simulation.rendering.cameras import frame_seed, light_phase, pixel_rays
from stseg.simulation.rendering.clothes import clothing
from stseg.simulation.rendering.illumination import lit
from stseg.simulation.rendering.ray_casting import PENUMBRA, darken, draw_bodies, pixel_boxes
from stseg.simulation.rendering.room import render_room
from stseg.simulation.scene import SceneSpec, Topic, random_stream
from stseg.simulation.spoiling.detector import detect, visible_boxes

LAMP = np.array([0.5, -0.35, 1.0]) / np.linalg.norm([0.5, -0.35, 1.0])
"""Direction towards the light."""


@dataclass(frozen=True, slots=True)
class RenderedView:
    """One camera's rendered frame with its ground truth."""

    image: Bytes
    """uint8 (v, u, 3): blue, green, red; black where the scene has no video."""
    instances: NDArray[np.uint16]
    """uint16 (v, u): id of the person that each pixel shows, 0 for background; also people just outside the area."""
    boxes: Boxes
    """Boxes of the simulated detector."""
    spoiled: Bytes | None = None
    """uint8 (v, u), 0..255: the silhouettes with errors; None where they are exact."""

    @property
    def mask(self) -> Bytes:
        """Silhouettes of all people, uint8 (v, u), 0 or 255 where they are exact."""
        return np.where(self.instances > 0, np.uint8(255), np.uint8(0)) if self.spoiled is None else self.spoiled


@dataclass(frozen=True, slots=True)
class Drawing:
    """The rendered scene before the sensor model."""

    light: Bytes
    """uint8 (v, u, 3): the scene at normal light: no softness, no noise."""
    instances: NDArray[np.uint16]
    """uint16 (v, u): as in `RenderedView`."""
    silhouettes: Ints
    """int64 (n, 5): see `stseg.simulation.rendering.ray_casting.draw_bodies`."""
    depth: Singles
    """float32 (v, u): depth in lengths of the pixels' rays, metres."""


class Viewer:
    """A camera in a scene; `turn` is its place in the ring, see `stseg.simulation.rendering.cameras.turns`."""

    def __init__(self, spec: SceneSpec, camera: Camera, turn: float) -> None:
        self.camera = camera
        self._spec, self._turn, self._phase = spec, turn, light_phase(spec, turn)
        self._rays, self._eye = pixel_rays(camera), camera.centre
        self.room = render_room(spec, self._rays, self._eye)

    def empty(self, frame: int) -> Bytes:
        """The camera's frame of the empty room, uint8 (v, u, 3)."""
        return self._expose(self.room.image, self.room.depth, frame)

    def view(self, crowd: CrowdFrame, bodies: Bodies) -> RenderedView:
        """The camera's frame of a crowd with its `bodies`, see `stseg.simulation.rendering.body.pose`."""
        drawing = self.draw(crowd, bodies)
        visible = np.empty((len(crowd.id), 5), np.int64)
        row_of = np.zeros(int(crowd.id.max(initial=0)) + 1, np.int64)
        row_of[crowd.id] = np.arange(len(crowd.id))
        visible_boxes(drawing.instances, row_of, visible)
        rng = random_stream(self._spec.seed, Topic.DETECTOR, *frame_seed(self._turn, crowd.frame))
        boxes = detect(self.camera, visible, drawing.silhouettes, np.array(self._spec.area) / 2, rng)
        if "video" not in self._spec.kinds:
            return RenderedView(np.zeros_like(drawing.light), drawing.instances, boxes)
        image = self._expose(drawing.light, drawing.depth, crowd.frame)
        return RenderedView(image, drawing.instances, boxes)

    def draw(self, crowd: CrowdFrame, bodies: Bodies) -> Drawing:
        """The crowd in the room."""
        image = self._with_shadows(bodies)
        depth = self.room.depth.copy()
        instances = np.zeros(image.shape[:2], np.uint16)
        silhouettes = np.empty((len(crowd.id), 5), np.int64)
        paint = np.array([clothing(self._spec.seed, int(person), self._spec.alike) for person in crowd.id])
        if len(crowd.id):
            ids, boxes = crowd.id.astype(np.uint16), pixel_boxes(self.camera, bodies.corners(1.0))
            scene = (self._rays, self._eye, boxes, bodies.centre, bodies.form, paint, LAMP)
            draw_bodies(*scene, ids, depth, image, instances, silhouettes)
        return Drawing(image, instances, silhouettes, depth)

    def _with_shadows(self, bodies: Bodies) -> Bytes:
        """The room with the people's shadows and without the people."""
        if self._spec.shadows == 0:
            return self.room.image.copy()
        corners = bodies.corners(PENUMBRA)
        fallen: Floats = corners - corners[..., 2:] / LAMP[2] * LAMP
        boxes = pixel_boxes(self.camera, fallen).reshape(-1, 4)
        shade = np.zeros(self.room.image.shape[:2], np.float32)
        darken(self.room.ground, boxes, bodies.centre.reshape(-1, 3), bodies.form.reshape(-1, 3, 3), LAMP, shade)
        image = self.room.image.copy()
        dark = shade > 0
        image[dark] = np.rint(image[dark] * (1 - self._spec.shadows * shade[dark])[:, None])
        return image

    def _expose(self, light: Bytes, depth: Singles, frame: int) -> Bytes:
        rng = random_stream(self._spec.seed, Topic.SENSOR, *frame_seed(self._turn, frame))
        gain: Singles | float = self._spec.gain(frame, self._phase)
        if self._spec.lamps:
            points = self._eye + depth[..., None] * self._rays
            gain = np.float32(gain) * lit(self._spec.lamps, frame / self._spec.frame_rate, points)
        return expose(light, gain, self._spec.noise, rng)


_SOFTNESS = 0.6
"""Standard deviation of the lens's blur, pixels."""


def expose(light: Bytes, gain: Singles | float, noise: float, rng: np.random.Generator) -> Bytes:
    """Expose a frame.

    Parameters
    ----------
    light : uint8 (v, u, 3)
        The scene at normal light.
    gain : float32 (v, u) or float
        Illumination relative to normal.
    noise
        Standard deviation of the sensor's noise, grey levels.
    rng
        Source of randomness.

    Returns
    -------
    uint8 (v, u, 3)
    """
    soft = cv2.GaussianBlur(light, (5, 5), _SOFTNESS)
    frame = rng.standard_normal(light.shape, np.float32)
    frame *= noise
    frame += np.float32(gain) * soft + 0.5 if isinstance(gain, float) else gain[..., None] * soft + np.float32(0.5)
    return np.clip(frame, 0, 255, out=frame).astype(np.uint8)
