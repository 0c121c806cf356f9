"""Each camera's foreground while the recording goes on: backgrounds know what has been seen, nothing of what will be.

A camera with an empty scene sees by the very background of a run of the whole recording
(`stseg.engine.backgrounds`). One without learns from the beginning of what is followed, and then goes on learning.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy

import numpy as np

from stseg.arrays import Bytes, Observation
from stseg.config import Config
from stseg.engine.backgrounds import BackgroundLearner, empty_background, is_colour, part_length, sampled
from stseg.foreground.background import Background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.live.live_frames import LiveFrameSet
from stseg.io.recording.recording import Recording


class LiveForegrounds:
    """The foreground of every camera of a recording that goes on.

    Parameters
    ----------
    recording, config
        The streams, and the constants of all stages.
    """

    def __init__(self, recording: Recording, config: Config) -> None:
        self._recording, self._config = recording, config
        frame_rate = recording.rig.frame_rate
        part = range(part_length(config.segments, frame_rate))
        self._part, self._step = len(part), sampled(part, config.segments).step
        colour = [k for k in range(len(recording.sources)) if is_colour(recording, k)]
        self._models = {k: empty_background(recording, k, config) for k in colour}
        self._empty = {k: self._models[k] for k in colour if recording.sources[k].background is not None}
        self._blind = {k for k in colour if k not in self._empty}
        self._learners: dict[int, BackgroundLearner] = {}

    @property
    def learns(self) -> bool:
        """Whether there are backgrounds at all."""
        return bool(self._models)

    @property
    def unlearned(self) -> list[str]:
        """Cameras whose background is to be learned first, by name."""
        return [self._recording.rig.cameras[k].name for k in sorted(self._blind)]

    def learn(self, moments: Iterable[LiveFrameSet]) -> int:
        """Teach the cameras without an empty scene; how many moments there were."""
        frames = max(1, round(self._config.live.background_time * self._recording.rig.frame_rate))
        step = sampled(range(frames), self._config.segments).step
        seen: dict[int, list[Bytes]] = {k: [] for k in self._blind}
        count = 0
        for count, moment in enumerate(moments, 1):
            if (count - 1) % step == 0:
                for k, images in seen.items():
                    images += _image(moment.views[k])
            if count == frames:
                break
        for k, images in seen.items():
            if images:
                self._models[k].learn_from(images)
                self._blind.discard(k)
        return count

    def see(self, moment: LiveFrameSet, since: int) -> None:
        """The next moment, of the frames that are followed since a frame: some of them teach the backgrounds."""
        own = (moment.frame - since) % self._part
        if own == 0:
            self._begin_part()
        if own % self._step == 0:
            for k, learner in self._learners.items():
                for image in _image(moment.views[k]):
                    learner.see(image)

    def sights(self) -> list[ViewForeground]:
        """What a segment sees by that begins to look now."""
        frame_rate, light = self._recording.rig.frame_rate, self._config.illumination
        models = [self._models.get(k) for k in range(len(self._recording.sources))]
        return [
            ViewForeground(None if model is None else IlluminationMonitor(deepcopy(model), frame_rate, light))
            for model in models
        ]

    def _begin_part(self) -> None:
        """What was learned in the part before holds for this one; an empty scene is begun with anew each time."""
        for k, model in self._models.items():
            learned = self._learners[k].learned() if k in self._learners else model
            self._models[k] = learned
            self._learners[k] = self._learner(self._empty.get(k, learned))

    def _learner(self, model: Background) -> BackgroundLearner:
        return BackgroundLearner(deepcopy(model), self._recording.rig.frame_rate, self._step, self._config.illumination)


def _image(view: Observation) -> list[Bytes]:
    return [] if view is None else [np.asarray(view, np.uint8)]
