"""What is asked of a model of the empty scene, and what its models have in common.

A background model is of one view. It learns the empty scene, then gives each frame's likelihood of people and follows
the scene while it does; what it has learned can be taken out as arrays and put back.

The likelihood is a posterior: the probability that the pixel shows a person, with the model's `prior` for it, whatever
the model. Whoever fuses views takes the prior out (`stseg.foreground.view_foreground`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from copy import copy
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import AnyArray, Bytes, Floats, Singles
from stseg.config import BackgroundConfig
from stseg.errors import ConfigError, InputError, SourceError
from stseg.foreground.channel_gain import channel_gains
from stseg.foreground.smoothing import pool_log_odds

TURNS = 4
"""Each frame teaches every fourth row at four times the rate: the rates are slow, and it costs a quarter."""


class Background(Protocol):
    """A model of the empty scene of one view."""

    @property
    def prior(self) -> float:
        """The prior probability of a person at a pixel that is in its likelihood, 0..1."""
        ...

    def learn(self, image: Bytes) -> None:
        """Learn a frame of the empty scene, uint8 (v, u, 3) BGR."""
        ...

    def learn_from(self, images: Iterable[Bytes]) -> None:
        """Start anew from frames in which people walk, uint8 (v, u, 3) BGR each."""
        ...

    def likelihood(self, image: Bytes) -> Singles:
        """The posterior probability that each pixel shows a person, float32 (v, u) in (0, 1); then learns the frame."""
        ...

    def commonest(self) -> Singles:
        """The commonest background of each pixel, grey levels in the light that it was learned in, (v, u, 3)."""
        ...

    def relight(self, gain: Singles) -> None:
        """Take all that it has learned into another light, by gains float32 (v, u, 3)."""
        ...

    def at_rate(self, frame_rate: float) -> Self:
        """The same model, asked at another rate, frames per second; this one is not to be asked any more."""
        ...

    def state(self) -> dict[str, AnyArray]:
        """Copies of all that it has learned, from which a model of its kind goes on bit for bit."""
        ...


class PixelModel(ABC):
    """What the models of single pixels share: light, pooling, turns, state; a `Background`.

    Parameters
    ----------
    size
        Width and height of the images, pixels.
    frame_rate
        Frames per second at which `likelihood` is asked.
    config
        What it assumes of scene and camera.
    arrays
        All that it has learned, each (v, u, K, ...) for K modes a pixel, by name and in the order in which its kernels
        take them. `mean` float32 (v, u, K, 3), grey levels BGR in the light that they were learned in, and `weight`
        float32 (v, u, K) are among them: `stseg.foreground.channel_gain` asks the strongest mode.

    Notes
    -----
    First it learns: `learn` each frame of the empty scene, or `learn_from` frames of the recording itself.
    """

    name: ClassVar[str]
    """What messages call it."""

    def __init__(
        self, size: tuple[int, int], frame_rate: float, config: BackgroundConfig, arrays: dict[str, AnyArray]
    ) -> None:
        if not frame_rate > 0:
            raise ConfigError(self.name, "frame_rate", frame_rate, "frames per second, above 0")
        self._shape = (size[1], size[0], 3)
        self._turn = TURNS / frame_rate
        self._config = config
        self._arrays = arrays
        self._learned = 0
        self._asked = 0

    @property
    def prior(self) -> float:
        """The prior probability of a person at a pixel that is in its likelihood, 0..1."""
        return self._config.foreground

    @classmethod
    def from_state(cls, state: Mapping[str, AnyArray], frame_rate: float, config: Any = None) -> Self:
        """A model that goes on from `state` bit for bit.

        Raises
        ------
        InputError
            Where an array is missing, or has another shape or dtype than `state` gives it.
        """
        place = f"state of a {cls.name}"
        if "weight" not in state:
            raise InputError(place, "", "no weight", "all arrays of the state")
        height, width = state["weight"].shape[:2]
        model = cls((width, height), frame_rate, config)  # type: ignore[call-arg]  # a model makes its arrays itself
        own = model.state()
        if missing := own.keys() - state.keys():
            raise InputError(place, "", f"no {', '.join(sorted(missing))}", "all arrays of the state")
        for key, array in own.items():
            if state[key].shape != array.shape or state[key].dtype != array.dtype:
                found = f"{state[key].dtype} {state[key].shape}"
                raise InputError(place, key, found, f"{array.dtype} {array.shape}")
        model._arrays = {key: state[key].copy() for key in model._arrays}
        model._learned, model._asked = int(state["learned"]), int(state["asked"])
        return model

    def at_rate(self, frame_rate: float) -> Self:
        """The same model, asked at another rate, frames per second; this one is not to be asked any more."""
        paced = copy(self)
        paced._turn = TURNS / frame_rate
        return paced

    def state(self) -> dict[str, AnyArray]:
        """Copies of all that it has learned.

        Returns
        -------
        dict
            The arrays that the model's class tells of; learned and asked int64 (): frames so far of `learn` and of
            `likelihood`.
        """
        counts = {"learned": np.array(self._learned, np.int64), "asked": np.array(self._asked, np.int64)}
        return {key: array.copy() for key, array in self._arrays.items()} | counts

    def learn(self, image: Bytes) -> None:
        """Learn a frame of the empty scene, uint8 (v, u, 3) BGR; all frames learned count the same."""
        self._check(image)
        self._teach(image, self._gain(image))
        self._learned += 1

    def learn_from(self, images: Iterable[Bytes]) -> None:
        """Start anew from frames in which people walk: each pixel's commonest colour.

        Parameters
        ----------
        images : uint8 (v, u, 3) BGR each
            Two to five dozen, spread over a minute or more: a pixel is right where no person's colour covers it as
            often as the background shows. They are held in memory together.

        Raises
        ------
        SourceError
            Where there are none.
        """
        frames = list(images)
        if not frames:
            raise SourceError(self.name, "", "no frames", "one or more to learn from")
        for frame in frames:
            self._check(frame)
        self._start(np.stack(frames))
        self._learned = len(frames)

    def likelihood(self, image: Bytes) -> Singles:
        """The probability that each pixel shows a person; then learns the frame.

        Parameters
        ----------
        image : uint8 (v, u, 3) BGR
            The next frame.

        Returns
        -------
        float32 (v, u)
            L in (0, 1), as the model's module defines it, log-odds averaged over `radius`.

        Raises
        ------
        SourceError
            Where the image is not of the model's size, or nothing has been learned yet.
        """
        self._check(image)
        if self._learned == 0:
            raise SourceError(self.name, "", "a model that has learned nothing", "frames to learn from first")
        gain = self._gain(image)
        log_odds, rows, likelihood = (np.empty(image.shape[:2], np.float32) for _ in range(3))
        self._evaluate(image, gain, log_odds)
        pool_log_odds(log_odds, self._config.radius, rows, likelihood)
        self._follow(slice(self._asked % TURNS, None, TURNS), image, gain, likelihood)
        self._asked += 1
        return likelihood

    def commonest(self) -> Singles:
        """The commonest background of each pixel, grey levels in the light that it was learned in, (v, u, 3)."""
        strongest = self._arrays["weight"].argmax(-1)[:, :, None, None]
        return np.asarray(np.take_along_axis(self._arrays["mean"], strongest, 2)[:, :, 0])

    def relight(self, gain: Singles) -> None:
        """Take all that it has learned into another light, by gains float32 (v, u, 3)."""
        self._arrays["mean"] *= gain[:, :, None]

    @abstractmethod
    def _start(self, frames: NDArray[np.uint8]) -> None:
        """Forget everything, and learn from frames (n, v, u, 3) in which people walk."""

    @abstractmethod
    def _teach(self, image: Bytes, gain: Floats) -> None:
        """Learn a frame of the empty scene."""

    @abstractmethod
    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        """Fill in the log-odds of a person at each pixel by itself."""

    @abstractmethod
    def _follow(self, rows: slice, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        """Learn rows of a frame that may show people, where `likelihood` (v, u) says."""

    def _gain(self, image: Bytes) -> Floats:
        """The frame's light relative to the model's."""
        return channel_gains(image, self._arrays["mean"], self._arrays["weight"]) if self._learned else np.ones(3)

    def _check(self, image: Bytes) -> None:
        if image.shape != self._shape or image.dtype != np.uint8:
            raise SourceError(self.name, "image", f"{image.dtype} {image.shape}", f"uint8 {self._shape}")
