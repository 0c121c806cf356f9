"""State and learning times that the two mixtures of Gaussians per pixel share."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import MixtureConfig
from stseg.foreground.background.gaussian_kernels import (
    MEAN,
    VARIANCE,
    Adaptation,
    Priors,
    evaluate,
    put_strongest_first,
    update,
)
from stseg.foreground.background.model import TURNS, PixelModel
from stseg.foreground.background.temporal_mode import commonest_colours

_MEAN = slice(MEAN, VARIANCE)


class GaussianModel(PixelModel):
    """A mixture of Gaussians per pixel; state `modes` float32 (mode, plane, v, u), see `gaussian_kernels`."""

    variances: ClassVar[int]
    """Variances of a mode: 1 if it is isotropic, 2 if across and along the ray of its chromaticity."""

    def __init__(self, size: tuple[int, int], frame_rate: float, config: MixtureConfig) -> None:
        super().__init__(size, frame_rate, config)
        self.config = config
        self._priors = Priors.of(config)
        self.modes = np.zeros((config.modes, VARIANCE + self.variances + 1, size[1], size[0]), np.float32)
        self.modes[:, VARIANCE:-1] = config.initial_sd**2

    @abstractmethod
    def _least_sds(self) -> tuple[float, float]:
        """Least standard deviations of a mode across and along the ray of its chromaticity, grey levels."""

    def relight(self, gain: Singles) -> None:
        """Multiply all that was learned by gains float32 (v, u, 3), after a change of light."""
        self.modes[:, _MEAN] *= gain.transpose(2, 0, 1)

    def _background_sample(self, step: int) -> Singles:
        return np.asarray(self.modes[0, _MEAN, ::step, ::step].transpose(1, 2, 0))

    def _start(self, frames: NDArray[np.uint8]) -> None:
        config = self.config
        colour, spread = commonest_colours(frames, config.match_distance * config.minimum_sd)
        self.modes[:, -1] = 0
        self.modes[0, _MEAN] = colour.transpose(2, 0, 1)
        self.modes[0, VARIANCE:-1] = np.maximum(spread, config.minimum_sd**2)
        self.modes[0, -1] = 1
        if self.variances == 2:
            self._separate_variances(frames)

    def _separate_variances(self, frames: NDArray[np.uint8]) -> None:
        """Learn the two variances of the first modes from frames; whatever else these teach is discarded."""
        certain, rate = np.ones(frames.shape[1:3], np.float32), 1.0 / len(frames)
        for frame in frames:
            self._update(frame, np.ones(3), certain, (rate, rate), 0, 1)
        self.modes[:, -1], self.modes[0, -1] = 0, 1

    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        rate = 1.0 / (self._frames_learned + 1)
        self._update(image, gain, np.ones(image.shape[:2], np.float32), (rate, rate), 0, 1)
        put_strongest_first(0, 1, self.modes)

    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        evaluate(image, gain.astype(np.float32), self.modes, self._priors, log_odds)

    def _update_rows(self, first: int, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        self._update(image, gain, likelihood, learning_rates(self._turn, self.config), first, TURNS)
        put_strongest_first(first, TURNS, self.modes)

    def _update(
        self, image: Bytes, gain: Floats, likelihood: Singles, rates: tuple[float, float], first: int, step: int
    ) -> None:
        config, sds = self.config, self._least_sds()
        numbers = config.background_weight, config.match_distance, config.initial_sd, *sds
        constants = Adaptation(*(np.float32(number) for number in numbers))
        fast, slow = (np.float32(rate) for rate in rates)
        update(image, gain.astype(np.float32), likelihood, fast, slow, constants, first, step, self.modes)


def learning_rates(seconds: float, config: MixtureConfig) -> tuple[float, float]:
    """Learning rates of a mode over some seconds: of background, and of what moved in."""
    fast = 1.0 - math.exp(-seconds / config.memory)
    return fast, 1.0 - (1.0 - config.background_weight) ** (seconds / config.absorption_time)
