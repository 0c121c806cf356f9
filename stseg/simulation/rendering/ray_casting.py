"""Ray casting of bodies: each pixel's ray is intersected with the ellipsoids with boxes that contain the pixel."""

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Flags, Floats, Ints, Singles
from stseg.geometry import Camera
from stseg.kernels.accelerate import kernel

AMBIENT = 0.55
"""Share of ambient light; the rest comes from the lamp."""
_MARGIN = 2.0  # pixels around boxes, and
_BULGE = 0.05  # of their size: a lens bends the boxes' straight sides outwards


def pixel_boxes(camera: Camera, corners: Floats) -> Ints:
    """Bounding boxes in the image of sets of points.

    Parameters
    ----------
    camera
        The view.
    corners : float64 (..., corner, 3)
        Metres.

    Returns
    -------
    int64 (..., 4)
        First and last column, first and last row, within the image (empty boxes end before they begin); the whole
        image where a corner lies behind the camera or beyond the lens's fold.
    """
    pixel, ahead = camera.project(corners[..., :2], corners[..., 2])
    whole: Flags = ~np.all(ahead, axis=-1, keepdims=True)
    pixel = np.where(whole[..., None], 0.0, pixel)
    low, high = pixel.min(axis=-2), pixel.max(axis=-2)
    margin = _MARGIN + _BULGE * (high - low)
    most = np.array(camera.size) - 1
    first = np.where(whole, 0, np.clip(np.floor(low - margin), 0, most + 1))
    last = np.where(whole, most, np.clip(np.ceil(high + margin), -1, most))
    return np.stack([first[..., 0], last[..., 0], first[..., 1], last[..., 1]], -1).astype(np.int64)


@kernel
def draw_bodies(
    rays: Singles,
    eye: Floats,
    boxes: Ints,
    centre: Floats,
    form: Floats,
    paint: Floats,
    lamp: Floats,
    ids: NDArray[np.uint16],
    depth: Singles,
    image: Bytes,
    instances: NDArray[np.uint16],
    silhouettes: Ints,
) -> None:
    """Draw bodies into an image with a depth buffer.

    Parameters
    ----------
    rays : float32 (v, u, 3)
        See `stseg.simulation.rendering.cameras.pixel_rays`.
    eye : float64 (3,)
        The camera's centre, metres.
    boxes : int64 (n, part, 4)
        See `pixel_boxes`.
    centre, form
        Of the ellipsoids, float64 (n, part, 3) and (n, part, 3, 3), see `stseg.simulation.rendering.body.Bodies`.
    paint : float64 (n, part, 10)
        See `stseg.simulation.rendering.clothes.own_clothing`.
    lamp : float64 (3,)
        Unit vector towards the light.
    ids : uint16 (n,)
        Ids of the bodies in `instances`.
    depth : float32 (v, u)
        Depth of what is in the image already, metres; changed in place, as are image and instances.
    image : uint8 (v, u, 3)
        Blue, green, red.
    instances : uint16 (v, u)
        Id of the person that each pixel shows, 0 for background.
    silhouettes : int64 (n, 5)
        Filled with first and last column, first and last row, and number of the pixels that each body would cover if
        it stood there alone.
    """
    for b in range(len(centre)):
        extent = silhouettes[b]
        extent[0], extent[1], extent[2], extent[3], extent[4] = image.shape[1], -1, image.shape[0], -1, 0
        origin = np.empty((centre.shape[1], 3))
        for k in range(centre.shape[1]):
            for i in range(3):
                origin[k, i] = 0.0
                for j in range(3):
                    origin[k, i] += form[b, k, i, j] * (eye[j] - centre[b, k, j])
        for v in range(boxes[b, :, 2].min(), boxes[b, :, 3].max() + 1):
            for u in range(boxes[b, :, 0].min(), boxes[b, :, 1].max() + 1):
                part, distance = _nearest(rays[v, u], boxes[b], origin, form[b], u, v)
                if part < 0:
                    continue
                extent[0], extent[1] = min(extent[0], u), max(extent[1], u)
                extent[2], extent[3] = min(extent[2], v), max(extent[3], v)
                extent[4] += 1
                if distance < depth[v, u]:
                    depth[v, u] = distance
                    instances[v, u] = ids[b]
                    _paint(rays[v, u], distance, origin[part], form[b, part], paint[b, part], lamp, image[v, u])


@kernel
def _nearest(ray: Singles, boxes: Ints, origin: Floats, form: Floats, u: int, v: int) -> tuple[int, float]:
    """Nearest part on a ray and its distance, -1 for none; `origin` is the eye in each part's own frame."""
    part, nearest = -1, np.inf
    x, y, z = float(ray[0]), float(ray[1]), float(ray[2])
    for k in range(len(origin)):
        if u < boxes[k, 0] or u > boxes[k, 1] or v < boxes[k, 2] or v > boxes[k, 3]:
            continue
        m, o = form[k], origin[k]
        dx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
        dy = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
        dz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
        a = dx * dx + dy * dy + dz * dz
        h = o[0] * dx + o[1] * dy + o[2] * dz
        under = h * h - a * (o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1.0)
        # A zero ray (no light) gives a zero `under`.
        if under > 0.0:
            distance = (-h - np.sqrt(under)) / a
            if 0.0 < distance < nearest:
                part, nearest = k, distance
    return part, nearest


@kernel
def _paint(
    ray: Singles, distance: float, origin: Floats, form: Floats, paint: Floats, lamp: Floats, colour: Bytes
) -> None:
    """Colour of a part at a ray's intersection: its pattern, shaded by Lambert's law."""
    place = np.empty(3)
    for i in range(3):
        place[i] = origin[i] + distance * (form[i, 0] * ray[0] + form[i, 1] * ray[1] + form[i, 2] * ray[2])
    steps = np.floor(paint[6] * place[0]) + np.floor(paint[7] * place[1]) + np.floor(paint[8] * place[2] + paint[9])
    second = 3 if int(steps) % 2 != 0 else 0
    square, facing = 0.0, 0.0
    for j in range(3):
        normal = form[0, j] * place[0] + form[1, j] * place[1] + form[2, j] * place[2]
        square += normal * normal
        facing += normal * lamp[j]
    light = AMBIENT + (1.0 - AMBIENT) * max(facing / np.sqrt(square), 0.0)
    for channel in range(3):
        colour[channel] = np.uint8(paint[second + channel] * light)


PENUMBRA = 1.3
"""Outer radius of the penumbra, in half axes of the ellipsoid."""
_UMBRA = 0.75  # radius of full shadow


@kernel
def darken(ground: Singles, boxes: Ints, centre: Floats, form: Floats, lamp: Floats, shade: Singles) -> None:
    """Raise `shade`, 0..1, of every pixel's ground point to the shadow cast there.

    Parameters
    ----------
    ground : float32 (v, u, 2)
        Ground point of each pixel, metres; nan where there is none.
    boxes : int64 (n, 4)
        Image boxes that contain the shadows, see `pixel_boxes`.
    centre, form
        Of the ellipsoids, float64 (n, 3) and (n, 3, 3), see `stseg.simulation.rendering.body.Bodies`.
    lamp : float64 (3,)
        Direction towards the light.
    shade : float32 (v, u)
        Modified in place.
    """
    for k in range(len(centre)):
        m = form[k]
        lx = m[0, 0] * lamp[0] + m[0, 1] * lamp[1] + m[0, 2] * lamp[2]
        ly = m[1, 0] * lamp[0] + m[1, 1] * lamp[1] + m[1, 2] * lamp[2]
        lz = m[2, 0] * lamp[0] + m[2, 1] * lamp[1] + m[2, 2] * lamp[2]
        length = lx * lx + ly * ly + lz * lz
        z = -centre[k, 2]
        for v in range(boxes[k, 2], boxes[k, 3] + 1):
            for u in range(boxes[k, 0], boxes[k, 1] + 1):
                x, y = ground[v, u, 0] - centre[k, 0], ground[v, u, 1] - centre[k, 1]
                px = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
                py = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
                pz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
                along = px * lx + py * ly + pz * lz
                # Distance of the light's ray from the centre, in half axes.
                miss = np.sqrt(max(px * px + py * py + pz * pz - along * along / length, 0.0))
                dark = (PENUMBRA - miss) / (PENUMBRA - _UMBRA)
                if dark > shade[v, u]:
                    shade[v, u] = min(dark, 1.0)
