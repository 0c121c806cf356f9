"""Films with exact masks that background models are compared on: one difficulty each.

Fixed before anything was measured on them; change none, make a new one.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes, Flags
from stseg.simulation import Film, Lamp, SceneSpec

__all__ = ["FILMS", "Shot", "shoot"]

_ROOM = SceneSpec(
    name="walk",
    people=5,
    area=(5.0, 5.0),
    seconds=15.0,
    cameras=1,
    camera_distance=5.8,
    size=(320, 240),
    light_drift=0.0,
    shadows=0.0,
    noise=3.0,
    seed=611,
)
_CORNER = (-1.5, 1.0, 2.4)

FILMS: dict[str, tuple[SceneSpec, str]] = {
    spec.name: (spec, codec)
    for spec, codec in (
        (_ROOM, ""),
        (replace(_ROOM, name="still", seconds=60.0, speed=(0.01, 0.02), stay=200.0, seed=612), ""),
        (replace(_ROOM, name="shadows", shadows=0.45, seed=613), ""),
        (replace(_ROOM, name="drift", light_drift=0.25, light_period=10.0, seed=614), ""),
        (replace(_ROOM, name="noise", noise=10.0, seed=615), ""),
        (replace(_ROOM, name="mpeg4", shadows=0.3, seed=616), "mp4v"),
        (replace(_ROOM, name="jpeg", shadows=0.3, quality=30, seed=617), "MJPG"),
        (replace(_ROOM, name="lamp", lamps=(Lamp(2.5, 5.0, place=_CORNER, reach=1.5),), seed=618), ""),
        (replace(_ROOM, name="switch", lamps=(Lamp(-0.5, 4.0, 9.0),), seed=619), ""),
        (replace(_ROOM, name="cloud", lamps=(Lamp(-0.4, 4.0, 9.0, 2.0, (3.0, 0.0, 5.0), 7.0),), seed=620), ""),
        (replace(_ROOM, name="exposure", lamps=(Lamp(0.7, 5.0),), seed=621), ""),
    )
}
"""Scene and codec by name; no codec, no compression."""


@dataclass(frozen=True)
class Shot:
    """One camera's film.

    Attributes
    ----------
    rate
        Frames per second.
    empty : list of uint8 (v, u, 3)
        Frames of the empty scene: the warm-up.
    images : list of uint8 (v, u, 3)
        The frames that count.
    masks : list of bool (v, u)
        Where people are in each.
    """

    rate: float
    empty: list[Bytes]
    images: list[Bytes]
    masks: list[Flags]


def shoot(name: str) -> Shot:
    """Film a named film."""
    spec, codec = FILMS[name]
    film = Film(spec)
    empty = [views[0] for views in film.empty()]
    views = [moment.views[0] for moment in film.frame_sets()]
    images, masks = [view.image for view in views], [view.instances > 0 for view in views]
    if codec:
        seen = list(_compressed(empty + images, codec, spec))
        empty, images = seen[: len(empty)], seen[len(empty) :]
    return Shot(spec.frame_rate, empty, images, masks)


def _compressed(images: list[Bytes], codec: str, spec: SceneSpec) -> Iterator[Bytes]:
    """The frames as they come back from a video file."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "film.avi")
        video = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*codec), spec.frame_rate, spec.size)
        video.set(cv2.VIDEOWRITER_PROP_QUALITY, spec.quality)
        for image in images:
            video.write(image)
        video.release()
        stream = cv2.VideoCapture(path)
        for _ in images:
            yield np.asarray(stream.read()[1], np.uint8)
        stream.release()
