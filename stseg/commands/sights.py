"""Each camera's foreground, its background learned before the frames that it is to judge.

A background belongs to a part of the recording, `segments.background` seconds long, so that light which changes over a
day and furniture that is moved matter little, and so that what a segment finds depends on no other segment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np

from stseg.arrays import Bytes
from stseg.config import Config, SegmentConfig
from stseg.foreground import make_background
from stseg.foreground.background import Background
from stseg.foreground.light_change import LightWatch
from stseg.foreground.sight import Sight
from stseg.io.frames import Streams, read_background, read_camera
from stseg.io.recording import Recording

_Frames = TypeVar("_Frames", range, Sequence[int])


def make_sights(
    recording: Recording, config: Config, first: int, stop: int, at: int | None = None, streams: Streams | None = None
) -> list[Sight]:
    """The foreground of every camera, in the rig's order, for frames from `at` on.

    A colour camera learns its background from frames of the part of the run in which `at` lies, and where it is blind
    there, from the nearest in which it sees; one that sees nowhere learns nothing and is not asked. Where it has empty
    frames it learns those, and what has changed since from the part before.

    Parameters
    ----------
    recording, config
        The streams, and the constants of all stages.
    first, stop
        The frames of the run.
    at
        The first frame that will be asked for; by default the run's.
    streams
        What `count_streams` told, for far frames.
    """
    part = background_part(config.segments, recording.rig.frame_rate, first, stop, first if at is None else at)
    return [_sight(recording, k, config, part, first, streams) for k in range(len(recording.sources))]


def background_part(config: SegmentConfig, frame_rate: float, first: int, stop: int, at: int) -> range:
    """The frames of the part of a run, frames first .. stop - 1, whose background holds for a frame."""
    length = max(1, round(config.background * frame_rate))
    begin = max(first, min(first + (at - first) // length * length, stop - length))
    return range(begin, min(begin + length, stop))


def _sight(
    recording: Recording, camera: int, config: Config, part: range, first: int, streams: Streams | None
) -> Sight:
    if recording.sources[camera].source.kind not in ("video", "images"):
        return Sight()
    frame_rate = recording.rig.frame_rate
    model = make_background(recording.rig.cameras[camera].size, frame_rate, config.foreground)
    if recording.sources[camera].background is None:
        frames = sampled(_seeing(recording, camera, part, streams), config.segments)
        if len(frames):
            model.learn_from(_colours(recording, camera, frames, streams))
    else:
        for empty in read_background(recording, camera):
            model.learn(np.asarray(empty, np.uint8))
        before = range(max(first, part.start - len(part)), part.start)
        model = _followed(model, recording, camera, config, before, streams)
    return Sight(LightWatch(model, frame_rate, config.light))


def _seeing(recording: Recording, camera: int, part: range, streams: Streams | None) -> Sequence[int]:
    """As many frames as a part has in which the camera sees: those of the part, then those nearest to it.

    Where nothing was counted, it is taken to see from its offset on.
    """
    if streams is None:
        late = max(0, recording.sources[camera].offset - part.start)
        return range(part.start + late, part.stop + late)
    frames = np.flatnonzero(streams.seen(recording)[camera])
    begin, end = frames.searchsorted([part.start, part.stop]).tolist()
    lacking = len(part) - (end - begin)
    begin = max(0, min(begin - lacking // 2, len(frames) - len(part)))
    nearest: list[int] = frames[begin : begin + len(part)].tolist()
    return nearest


def _followed(
    model: Background, recording: Recording, camera: int, config: Config, before: range, streams: Streams | None
) -> Background:
    """A model of the empty scene after a part of the recording of which it sees some frames."""
    frames = sampled(before, config.segments)
    if not frames:
        return model
    frame_rate = recording.rig.frame_rate
    paced = model.at_rate(frame_rate / frames.step)
    watch = LightWatch(paced, frame_rate / frames.step, config.light)
    for image in _colours(recording, camera, frames, streams):
        watch.likelihood(image)
    return paced.at_rate(frame_rate)


def _colours(recording: Recording, camera: int, frames: Sequence[int], streams: Streams | None) -> Iterator[Bytes]:
    """What a colour camera shows in some frames, where it sees."""
    for image in read_camera(recording, camera, frames, streams):
        if image is not None:
            yield np.asarray(image, np.uint8)


def sampled(part: _Frames, config: SegmentConfig) -> _Frames:
    """Frames spread over a part of the recording."""
    return part[:: max(1, len(part) // config.samples)]
