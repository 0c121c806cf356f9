"""Each camera's foreground, its background learned before the run begins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stseg.arrays import Bytes
from stseg.config import Config
from stseg.foreground import make_background
from stseg.foreground.light_change import LightWatch
from stseg.foreground.sight import Sight
from stseg.io.frames import open_frames, read_background
from stseg.io.recording import Recording

_SAMPLES = 40
"""Frames that a background is learned from where no empty scene is given."""
_SPREAD = 300.0
"""Seconds over which they are spread."""


def make_sights(recording: Recording, config: Config, first: int, stop: int) -> list[Sight]:
    """The foreground of every camera, in the rig's order.

    A colour camera learns its background from its empty frames, or else from frames of the run itself.
    """
    return [_sight(recording, k, config, first, stop) for k in range(len(recording.sources))]


def _sight(recording: Recording, camera: int, config: Config, first: int, stop: int) -> Sight:
    source = recording.sources[camera]
    if source.source.kind not in ("video", "images"):
        return Sight()
    model = make_background(recording.rig.cameras[camera].size, recording.rig.frame_rate, config.foreground)
    if source.background is not None:
        for image in read_background(recording, camera):
            model.learn(np.asarray(image, np.uint8))
    else:
        model.learn_from(_spread(recording, camera, first, stop))
    return Sight(LightWatch(model, recording.rig.frame_rate, config.light))


def _spread(recording: Recording, camera: int, first: int, stop: int) -> Iterator[Bytes]:
    """Frames of one camera, spread over the beginning of the run."""
    rig = replace(recording.rig, cameras=recording.rig.cameras[camera : camera + 1])
    alone = replace(recording, rig=rig, sources=recording.sources[camera : camera + 1])
    last = min(stop, first + round(_SPREAD * rig.frame_rate))
    every = max(1, (last - first) // _SAMPLES)
    with open_frames(alone, first, last) as moments:
        for moment in moments:
            (image,) = moment.views
            if (moment.frame - first) % every == 0 and image is not None:
                yield np.asarray(image, np.uint8)
