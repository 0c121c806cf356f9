"""Background models: what all of them share.

A background model belongs to one view. It learns the empty scene, then gives the foreground likelihood of each frame
and adapts to the scene while it does.

The likelihood is a posterior: the probability that a pixel shows a person, including the model's `prior`. The fusion of
views has a prior of its own, so the pixel's is divided out before (`stseg.foreground.view_foreground`).
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from copy import copy
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import BackgroundConfig
from stseg.errors import ConfigError, SourceError
from stseg.foreground.background.posterior import Priors, pool_log_odds
from stseg.foreground.channel_gain import STRIDE, channel_gains, to_common_light

TURNS = 4
"""Each frame updates every fourth row at four times the rate: rates are slow, and it costs a quarter."""
_GREY = 2.0
"""Mean difference of a pixel's channels below which a camera shows no colours, grey levels."""


class Background(ABC):
    """A background model of one view: gain, pooling, update turns. Deep copies are independent of each other.

    Parameters
    ----------
    size
        Width and height of the images, pixels.
    frame_rate
        Frames per second at which `likelihood` is called.
    config
        Assumptions about scene and camera.
    spread
        Least standard deviation of a background colour across its ray, grey levels.

    Notes
    -----
    Learning comes first: `learn` each frame of the empty scene, or `learn_from` frames of the recording itself.
    """

    name: ClassVar[str]
    """The model's name in messages."""

    def __init__(self, size: tuple[int, int], frame_rate: float, config: BackgroundConfig, spread: float = 4.0) -> None:
        if not frame_rate > 0:
            raise ConfigError(self.name, "frame_rate", frame_rate, "frames per second, above 0")
        self._shape = (size[1], size[0], 3)
        self._turn = TURNS / frame_rate
        self._config, self._spread, self._priors = config, spread, Priors.of(config)
        self._frames_learned = 0
        self._frames_evaluated = 0

    @property
    def prior(self) -> float:
        """Prior probability of a person at a pixel, included in the likelihood, 0..1."""
        return self._config.foreground_prior

    def at_rate(self, frame_rate: float) -> Self:
        """The same model for another frame rate, frames per second; shares its arrays, so use only one of the two."""
        paced = copy(self)
        paced._turn = TURNS / frame_rate
        return paced

    def learn(self, image: Bytes) -> None:
        """Learn a frame of the empty scene, uint8 (v, u, 3) BGR; all such frames have equal weight."""
        self._check(image)
        image = np.ascontiguousarray(image)
        self._learn_colours(image)
        self._learn_empty(image, self._gain(image))
        self._frames_learned += 1

    def learn_from(self, images: Iterable[Bytes]) -> None:
        """Start anew from frames in which people walk: the temporal mode of each pixel's colour, in one light.

        Parameters
        ----------
        images : uint8 (v, u, 3) BGR each
            Two to five dozen, spread over a minute or more: a pixel is right where no person's colour covers it as
            often as the background shows. All are held in memory together.

        Raises
        ------
        SourceError
            Without frames.
        """
        frames = list(images)
        if not frames:
            raise SourceError(self.name, "", "no frames", "one or more to learn from")
        for frame in frames:
            self._check(frame)
        stacked = np.stack(frames)
        self._learn_colours(stacked)
        to_common_light(stacked)
        self._start(stacked)
        self._frames_learned = len(frames)

    def likelihood(self, image: Bytes) -> Singles:
        """Posterior foreground probability of each pixel; then the model learns the frame.

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
            Where the image is not of the model's size, or the model has learned nothing yet.
        """
        self._check(image)
        if self._frames_learned == 0:
            raise SourceError(self.name, "", "a model that has learned nothing", "frames to learn from first")
        image = np.ascontiguousarray(image)
        gain = self._gain(image)
        log_odds, likelihood = (np.empty(image.shape[:2], np.float32) for _ in range(2))
        self._evaluate(image, gain, log_odds)
        pool_log_odds(log_odds, self._config.smoothing_radius, likelihood)
        self._update_rows(self._frames_evaluated % TURNS, image, gain, likelihood)
        self._frames_evaluated += 1
        return likelihood

    def background_image(self) -> Singles:
        """Strongest background mode of each pixel, (v, u, 3), grey levels in the light that it was learned in."""
        return self._background_sample(1).copy()

    @abstractmethod
    def relight(self, gain: Singles) -> None:
        """Multiply all that was learned by gains float32 (v, u, 3), after a change of light."""

    @abstractmethod
    def _background_sample(self, step: int) -> Singles:
        """Mean of the strongest mode of every step-th pixel along u and v, (v, u, 3)."""

    @abstractmethod
    def _start(self, frames: NDArray[np.uint8]) -> None:
        """Discard everything, and learn from frames (n, v, u, 3) in which people walk."""

    @abstractmethod
    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        """Learn a frame of the empty scene."""

    @abstractmethod
    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        """Fill in the foreground log-odds of each pixel by itself."""

    @abstractmethod
    def _update_rows(self, first: int, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        """Learn every `TURNS`-th row from `first` on of a frame that may show people with `likelihood` (v, u)."""

    def _learn_colours(self, images: NDArray[np.uint8]) -> None:
        """Learn whether the camera shows colours, from images (..., v, u, 3).

        Where it shows greys alone, an unknown colour lies on the line of greys, as a shadow does: U is denser there.
        """
        is_grey = np.ptp(images[..., ::STRIDE, ::STRIDE, :], axis=-1).mean() < _GREY
        priors = Priors.of(self._config)
        self._priors = priors.of_greys(self._spread) if is_grey else priors

    def _gain(self, image: Bytes) -> Floats:
        """The frame's channel gains relative to the model."""
        return (
            channel_gains(image[::STRIDE, ::STRIDE], self._background_sample(STRIDE))
            if self._frames_learned
            else np.ones(3)
        )

    def _check(self, image: Bytes) -> None:
        if image.shape != self._shape or image.dtype != np.uint8:
            raise SourceError(self.name, "image", f"{image.dtype} {image.shape}", f"uint8 {self._shape}")
