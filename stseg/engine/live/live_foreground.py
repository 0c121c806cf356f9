"""Causal background models: foreground of each camera of a recording in progress, learned from past frames only.

A camera with an empty scene uses the same background as in a run over the whole recording
(`stseg.engine.offline.backgrounds`). A camera without one learns from the first frames received, and is then updated;
one with an empty scene in other light is relit by them.
"""

from collections.abc import Iterable
from copy import deepcopy
from itertools import islice

import numpy as np

from stseg.arrays import Bytes, Observation
from stseg.config import Config
from stseg.engine.offline.backgrounds import BackgroundLearner, empty_background, is_colour, part_length, sampled
from stseg.foreground.background.model import Background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.recording import Recording


class LiveForegrounds:
    """Background models and foreground of every camera of a recording in progress."""

    def __init__(self, recording: Recording, config: Config) -> None:
        self._recording, self._config = recording, config
        frame_rate = recording.rig.frame_rate
        part = range(part_length(config.segments, frame_rate))
        self._part, self._step = len(part), sampled(part, config.segments).step
        colour = [k for k in range(len(recording.sources)) if is_colour(recording, k)]
        self._models = {k: empty_background(recording, k, config) for k in colour}
        self._empty = {k: self._models[k] for k in colour if recording.sources[k].background is not None}
        self._untrained = {k for k in colour if k not in self._empty}
        self._learners: dict[int, BackgroundLearner] = {}

    @property
    def has_backgrounds(self) -> bool:
        """Whether any camera has a background model."""
        return bool(self._models)

    @property
    def untrained(self) -> list[str]:
        """Names of the cameras whose background is not trained yet, or does not fit the first frame set."""
        return [self._recording.rig.cameras[k].name for k in sorted(self._untrained)]

    def see_first_light(self, frame_set: FrameSet) -> None:
        """Note the cameras whose empty scene does not fit the first frame set: its light, or more than people cover."""
        for k, model in self._empty.items():
            if any(self._monitor(model).sees_other_light(image) for image in _image(frame_set.views[k])):
                self._untrained.add(k)

    def learn(self, frame_sets: Iterable[FrameSet]) -> int:
        """Train or relight the backgrounds of untrained cameras; returns the number of frame sets consumed.

        These are the first ones, of which at most `live.background_time` seconds are consumed.
        """
        frames = max(1, round(self._config.live.background_time * self._recording.rig.frame_rate))
        step = sampled(range(frames), self._config.segments).step
        samples: dict[int, list[Bytes]] = {k: [] for k in self._untrained}
        count = 0
        for count, frame_set in enumerate(islice(frame_sets, frames), 1):
            if (count - 1) % step == 0:
                for k, images in samples.items():
                    images += _image(frame_set.views[k])
        for k, images in samples.items():
            if images:
                model = self._models[k]
                (self._monitor(model).relight if k in self._empty else model.learn_from)(images)
                self._untrained.discard(k)
        return count

    def update(self, frame_set: FrameSet, since: int) -> None:
        """Update the backgrounds by the next frame set, where it is one of the training frames.

        `since` is the first frame of the first background period.
        """
        offset = (frame_set.frame - since) % self._part
        if offset == 0:
            self._begin_part()
        if offset % self._step == 0:
            for k, learner in self._learners.items():
                for image in _image(frame_set.views[k]):
                    learner.update(image)

    def snapshot(self) -> list[ViewForeground]:
        """Foreground models for a segment whose warm-up begins now: copies of the current backgrounds."""
        return [
            ViewForeground(self._monitor(deepcopy(self._models[k])) if k in self._models else None)
            for k in range(len(self._recording.sources))
        ]

    def _monitor(self, model: Background) -> IlluminationMonitor:
        return IlluminationMonitor(model, self._recording.rig.frame_rate, self._config.illumination)

    def _begin_part(self) -> None:
        """Begin a background period: use the model of the last one, and restart learning from an empty scene."""
        for k, model in self._models.items():
            learned = self._learners[k].learned() if k in self._learners else model
            self._models[k] = learned
            model, illumination = deepcopy(self._empty.get(k, learned)), self._config.illumination
            self._learners[k] = BackgroundLearner(model, self._recording.rig.frame_rate, self._step, illumination)


def _image(view: Observation) -> list[Bytes]:
    """The image of a view as a list of one; empty for a missing view."""
    return [] if view is None else [np.asarray(view, np.uint8)]
