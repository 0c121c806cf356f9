"""Foreground of each camera for a segment, from a background learned beforehand.

A background belongs to a part of the recording, `segments.background_period` seconds long, so that light which changes
over a day and furniture that is moved matter little, and so that what a segment finds depends on no other segment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from stseg.arrays import Bytes
from stseg.config import Config, IlluminationConfig, SegmentConfig
from stseg.engine.segments import Segment
from stseg.foreground import make_background
from stseg.foreground.background import Background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.frames import read_background, read_camera
from stseg.io.recording.recording import Recording
from stseg.io.recording.stream_index import StreamIndex

_Frames = TypeVar("_Frames", range, Sequence[int])


@dataclass(frozen=True)
class BackgroundFrames:
    """Training frames of the backgrounds of a segment.

    Attributes
    ----------
    part
        Frames from which a camera without an empty scene learns.
    before
        Frames of which a camera with an empty scene learns what has changed since; they end before the segment begins
        to look.
    """

    part: range
    before: range


def make_foregrounds(
    recording: Recording,
    config: Config,
    first: int,
    stop: int,
    segment: Segment | None = None,
    streams: StreamIndex | None = None,
) -> list[ViewForeground]:
    """The foreground of every camera, in the rig's order, for the frames of a segment.

    A colour camera learns its background from frames of the part of the run in which the segment lies, and where it is
    blind there, from the nearest in which it is not; one that is blind throughout has an untrained model, never used.
    A camera with an empty scene learns that, and the changes since then from the part before.

    Parameters
    ----------
    recording, config
        The streams, and the constants of all stages.
    first, stop
        The frames of the run.
    segment
        The segment that is processed; by default it begins with the run.
    streams
        From `stseg.io.recording.stream_index.index_streams`, to seek distant frames.
    """
    segment = Segment(0, first, first, stop) if segment is None else segment
    training = background_frames(segment, config.segments, recording.rig.frame_rate, first, stop)
    return [_view_foreground(recording, k, config, training, streams) for k in range(len(recording.sources))]


def background_frames(
    segment: Segment, config: SegmentConfig, frame_rate: float, first: int, stop: int
) -> BackgroundFrames:
    """Training frames of the backgrounds of a segment, in a run of frames first .. stop - 1."""
    length = part_length(config, frame_rate)
    begin = max(first, min(first + (segment.first - first) // length * length, stop - length))
    seen = first + (segment.lead - first) // length * length
    return BackgroundFrames(range(begin, min(begin + length, stop)), range(max(first, seen - length), seen))


def part_length(config: SegmentConfig, frame_rate: float) -> int:
    """Frames of a part of the recording whose background holds."""
    return max(1, round(config.background_period * frame_rate))


def is_colour(recording: Recording, camera: int) -> bool:
    """Whether a camera delivers colour, whose foreground needs a background model."""
    return recording.sources[camera].source.kind in ("video", "images")


def empty_background(recording: Recording, camera: int, config: Config) -> Background:
    """A background that has learned the camera's empty scene, if it has one; else nothing."""
    model = make_background(recording.read_rig.cameras[camera].size, recording.rig.frame_rate, config.foreground)
    if recording.sources[camera].background is not None:
        for empty in read_background(recording, camera):
            model.learn(np.asarray(empty, np.uint8))
    return model


class BackgroundLearner:
    """A background that is updated by every `step`-th frame.

    Parameters
    ----------
    model
        The background; not to be used by the caller afterwards.
    frame_rate
        Of the recording, frames per second.
    step
        Frames from one update to the next.
    config
        Constants of the detection of light changes.
    """

    def __init__(self, model: Background, frame_rate: float, step: int, config: IlluminationConfig) -> None:
        self._model, self._frame_rate = model.at_rate(frame_rate / step), frame_rate
        self._watch = IlluminationMonitor(self._model, frame_rate / step, config)

    def see(self, image: Bytes) -> None:
        """Update by the next frame."""
        self._watch.likelihood(image)

    def learned(self) -> Background:
        """The background at the recording's frame rate; this learner is not to be used afterwards."""
        return self._model.at_rate(self._frame_rate)


def _view_foreground(
    recording: Recording, camera: int, config: Config, training: BackgroundFrames, streams: StreamIndex | None
) -> ViewForeground:
    if not is_colour(recording, camera):
        return ViewForeground()
    frame_rate = recording.rig.frame_rate
    model = empty_background(recording, camera, config)
    if recording.sources[camera].background is None:
        shown = sampled(_sighted_frames(recording, camera, training.part, streams), config.segments)
        if len(shown):
            model.learn_from(_colours(recording, camera, shown, streams))
    elif training.before:
        frames = sampled(training.before, config.segments)
        learner = BackgroundLearner(model, frame_rate, frames.step, config.illumination)
        for image in _colours(recording, camera, frames, streams):
            learner.see(image)
        model = learner.learned()
    return ViewForeground(IlluminationMonitor(model, frame_rate, config.illumination))


def _sighted_frames(recording: Recording, camera: int, part: range, streams: StreamIndex | None) -> Sequence[int]:
    """As many frames as a part has in which the camera is not blind: those of the part, then those nearest to it.

    Without a stream index, every frame from the camera's offset on.
    """
    if streams is None:
        late = max(0, recording.sources[camera].offset - part.start)
        return range(part.start + late, part.stop + late)
    frames = np.flatnonzero(streams.coverage(recording)[camera])
    begin, end = frames.searchsorted([part.start, part.stop]).tolist()
    lacking = len(part) - (end - begin)
    begin = max(0, min(begin - lacking // 2, len(frames) - len(part)))
    nearest: list[int] = frames[begin : begin + len(part)].tolist()
    return nearest


def _colours(recording: Recording, camera: int, frames: Sequence[int], streams: StreamIndex | None) -> Iterator[Bytes]:
    """Images of a colour camera in some frames, without those in which it is blind."""
    for image in read_camera(recording, camera, frames, streams):
        if image is not None:
            yield np.asarray(image, np.uint8)


def sampled(part: _Frames, config: SegmentConfig) -> _Frames:
    """Frames spread over a part of the recording."""
    return part[:: max(1, len(part) // config.background_samples)]
