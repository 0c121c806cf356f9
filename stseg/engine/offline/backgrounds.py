"""Background training: the foreground model of each camera for a segment of the recording.

The recording is divided into background periods of `segments.background_period` seconds, each with a background of its
own. Changes of daylight and moved furniture thus have little effect, and the result of a segment depends on no other
segment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

import numpy as np

from stseg.arrays import Bytes
from stseg.config import Config, IlluminationConfig, SegmentConfig
from stseg.engine.offline.segments import Segment
from stseg.foreground import make_background
from stseg.foreground.background.model import Background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.aligned_stream import StreamIndex
from stseg.io.recording.frames import read_background, read_camera
from stseg.io.recording.recording import Recording

_Frames = TypeVar("_Frames", range, Sequence[int])


@dataclass(frozen=True)
class BackgroundFrames:
    """Training frames of the backgrounds of a segment."""

    part: range
    """Background period of the segment, from which a camera without an empty scene is trained."""
    before: range
    """Period before the segment's warm-up, by which the background of a camera with an empty scene is updated."""


def make_foregrounds(
    recording: Recording,
    config: Config,
    first: int,
    stop: int,
    segment: Segment | None = None,
    streams: StreamIndex | None = None,
) -> list[ViewForeground]:
    """Foreground models of all cameras for the frames of a segment.

    The background of a colour camera is trained on the background period of the segment; frames in which the camera is
    blind are replaced by the nearest in which it is not. A camera that is blind throughout keeps an untrained model,
    which is never used. An empty scene teaches it instead, then the period before. At last each takes the first light.

    Parameters
    ----------
    recording, config
        The streams, and the constants of all stages.
    first, stop
        The frames of the run, half open.
    segment
        The segment to process; by default all frames of the run, without a warm-up.
    streams
        From `stseg.io.recording.aligned_stream.index_streams`, to seek distant frames.

    Returns
    -------
    list of ViewForeground
        One per camera, in the rig's order.
    """
    segment = Segment(0, first, first, stop) if segment is None else segment
    training = background_frames(segment, config.segments, recording.rig.frame_rate, first, stop)
    learned = learn_foregrounds(recording, config, training, streams)
    take_first_light(learned, recording, config, segment, streams)
    return learned


def learn_foregrounds(
    recording: Recording, config: Config, training: BackgroundFrames, streams: StreamIndex | None
) -> list[ViewForeground]:
    """Foreground models of all cameras in the light of their training frames; see `make_foregrounds`."""
    return [_view_foreground(recording, k, config, training, streams) for k in range(len(recording.sources))]


def take_first_light(
    learned: list[ViewForeground], recording: Recording, config: Config, segment: Segment, streams: StreamIndex | None
) -> None:
    """Relight the backgrounds of all cameras whose first image of a segment is in other light."""
    frames = sampled(range(segment.lead, segment.stop), config.segments)
    for camera, foreground in enumerate(learned):
        if foreground.background is not None:
            images = _images(recording, camera, frames, streams)
            first = list(islice(images, 1))
            if first and foreground.background.sees_other_light(first[0]):
                foreground.background.relight([*first, *images])


def background_frames(
    segment: Segment, config: SegmentConfig, frame_rate: float, first: int, stop: int
) -> BackgroundFrames:
    """Training frames of the backgrounds of a segment, in a run of frames first .. stop - 1."""
    length = part_length(config, frame_rate)
    begin = max(first, min(first + (segment.first - first) // length * length, stop - length))
    lead = first + (segment.lead - first) // length * length
    return BackgroundFrames(range(begin, min(begin + length, stop)), range(max(first, lead - length), lead))


def part_length(config: SegmentConfig, frame_rate: float) -> int:
    """Length of a background period, frames."""
    return max(1, round(config.background_period * frame_rate))


def is_colour(recording: Recording, camera: int) -> bool:
    """Whether a camera delivers colour images, whose foreground needs a background model."""
    return recording.sources[camera].source.kind in ("video", "images")


def empty_background(recording: Recording, camera: int, config: Config) -> Background:
    """A background trained on the camera's empty scene; untrained if the camera has none."""
    model = make_background(recording.reduced_rig.cameras[camera].size, recording.rig.frame_rate, config.foreground)
    if recording.sources[camera].background is not None:
        for empty in read_background(recording, camera):
            model.learn(np.asarray(empty, np.uint8))
    return model


class BackgroundLearner:
    """Recursive update of a background by every `step`-th frame.

    Parameters
    ----------
    model
        The background; owned by the learner afterwards.
    frame_rate
        Frame rate of the recording, frames per second.
    step
        Interval between updates, frames.
    config
        Constants of the detection of illumination changes.
    """

    def __init__(self, model: Background, frame_rate: float, step: int, config: IlluminationConfig) -> None:
        self._model, self._frame_rate = model.at_rate(frame_rate / step), frame_rate
        self._monitor = IlluminationMonitor(self._model, frame_rate / step, config)

    def update(self, image: Bytes) -> None:
        """Update the background by the next training frame, uint8 (v, u, channel)."""
        self._monitor.likelihood(image)

    def learned(self) -> Background:
        """The updated background at the recording's frame rate; ends the use of this learner."""
        return self._model.at_rate(self._frame_rate)


def _view_foreground(
    recording: Recording, camera: int, config: Config, training: BackgroundFrames, streams: StreamIndex | None
) -> ViewForeground:
    if not is_colour(recording, camera):
        return ViewForeground()
    frame_rate = recording.rig.frame_rate
    model = empty_background(recording, camera, config)
    if recording.sources[camera].background is None:
        covered = sampled(_covered_frames(recording, camera, training.part, streams), config.segments)
        if len(covered):
            model.learn_from(_images(recording, camera, covered, streams))
    elif training.before:
        frames = sampled(training.before, config.segments)
        learner = BackgroundLearner(model, frame_rate, frames.step, config.illumination)
        for image in _images(recording, camera, frames, streams):
            learner.update(image)
        model = learner.learned()
    return ViewForeground(IlluminationMonitor(model, frame_rate, config.illumination))


def _covered_frames(recording: Recording, camera: int, part: range, streams: StreamIndex | None) -> Sequence[int]:
    """Frames in which the camera is not blind, as many as the period has: its own, then the nearest to it.

    Without a stream index, all frames from the camera's offset on.
    """
    if streams is None:
        delay = max(0, recording.sources[camera].offset - part.start)
        return range(part.start + delay, part.stop + delay)
    ranges = streams.visible_ranges(recording)[camera].tolist()
    frames = np.concatenate([np.arange(*one) for one in ranges] or [np.arange(0)])
    begin, end = frames.searchsorted([part.start, part.stop]).tolist()
    lacking = len(part) - (end - begin)
    begin = max(0, min(begin - lacking // 2, len(frames) - len(part)))
    nearest: list[int] = frames[begin : begin + len(part)].tolist()
    return nearest


def _images(recording: Recording, camera: int, frames: Sequence[int], streams: StreamIndex | None) -> Iterator[Bytes]:
    """Images of a colour camera, uint8 (v, u, channel), in the given frames except those in which it is blind."""
    for image in read_camera(recording, camera, frames, streams):
        if image is not None:
            yield np.asarray(image, np.uint8)


def sampled(part: _Frames, config: SegmentConfig) -> _Frames:
    """Training frames of a period at equal intervals, at least `background_samples` if it has as many."""
    return part[:: max(1, len(part) // config.background_samples)]
