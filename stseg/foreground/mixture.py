"""Background as a mixture of Gaussians per pixel, foreground as what it does not explain (METHODS 2).

For a pixel of colour x (BGR, grey levels), with background modes k of weight w_k, mean mu_k and variance var_k,

    L(x) = f p(x | person) / (f p(x | person) + (1 - f) p(x | scene)),
    p(x | scene)  = (1 - e) sum_k w_k [(1 - s) N(x; mu_k, var_k I) + s D(x; mu_k, var_k)] + e U,
    p(x | person) = (1 - m) U + m sum_k w_k D(x; mu_k, var_k),

the posterior probability that the pixel shows a person: a function of the squared Mahalanobis distances to the modes
(KS09, HW12). Its log-odds are held within 5 nats and averaged over the neighbours. U is the uniform density of colours
and D a mode in shadow: a Gaussian around the segment from `darkest` mu to mu, of the mode's own chromaticity, denser
towards mu since penumbras are commoner than deep shadows:

    D(x; mu, var) = 2 t exp(-|x - r mu|^2 / (2 var)) / (2 pi var (l + sqrt(2 pi var))),
    r = clip(x.mu / |mu|^2, darkest, 1),   t = (r - darkest) / (1 - darkest),   l = (1 - darkest) |mu|.

Some clothes look like a darkened wall (m), so L stays soft in the shadow range: about f m / (f m + (1 - f) s).

Learning (Stauffer and Grimson 1999, with selective rates). A frame teaches the nearest mode within `match` standard
deviations. A mode of weight `share` or more is background and learns with rate dt / memory times (1 - L). Any other
mode, and a new one, which takes the place of the weakest, learns so slowly that its weight reaches `share` after
`absorption` seconds: a person may stand that long without fading, and a chair put down for longer becomes background.
Where background shows meanwhile, such a mode is forgotten within the memory; so what flickers must be learned from
the empty scene. A colour that only a shadow explains teaches nothing, and background gives up no mode to people.

Light that changes over the whole view, slowly or at once, is a gain of each channel on all means
(`stseg.foreground.light`); where a part of it turns darker that is a shadow, where brighter new background after
`absorption`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Singles
from stseg.config import MixtureConfig
from stseg.errors import ConfigError, InputError, SourceError
from stseg.foreground.commonest import commonest_colours
from stseg.foreground.light import channel_gains
from stseg.foreground.mixture_kernels import evaluate, update
from stseg.foreground.smoothing import pool_log_odds

_TURNS = 4  # each frame teaches every fourth row at four times the rate: the rates are slow, and it costs a quarter


class Mixture:
    """The background of one view, and the likelihood that its pixels show people.

    Parameters
    ----------
    size
        Width and height of the images, pixels.
    frame_rate
        Frames per second at which `likelihood` is asked.
    config
        What it assumes of scene and camera.

    Notes
    -----
    First it learns: `learn` each frame of the empty scene, or `learn_from` frames of the recording itself.
    """

    def __init__(self, size: tuple[int, int], frame_rate: float, config: MixtureConfig | None = None) -> None:
        if not frame_rate > 0:
            raise ConfigError("mixture", "frame_rate", frame_rate, "frames per second, above 0")
        self.config = MixtureConfig() if config is None else config
        width, height = size
        self._frame_rate = frame_rate
        self._mean = np.zeros((height, width, self.config.modes, 3), np.float32)
        self._variance = np.full((height, width, self.config.modes), self.config.initial_sd**2, np.float32)
        self._weight = np.zeros((height, width, self.config.modes), np.float32)
        self._learned = 0
        self._asked = 0

    @classmethod
    def from_state(
        cls, state: Mapping[str, AnyArray], frame_rate: float, config: MixtureConfig | None = None
    ) -> Mixture:
        """A model that goes on from `state` bit for bit.

        Raises
        ------
        InputError
            Where an array is missing, or has another shape or dtype than `state` gives it.
        """
        if missing := {"mean", "variance", "weight", "learned", "asked"} - set(state):
            raise InputError("state of a mixture", "", f"no {', '.join(sorted(missing))}", "all five arrays")
        height, width = state["weight"].shape[:2]
        model = cls((width, height), frame_rate, config)
        for key, own in model.state().items():
            if state[key].shape != own.shape or state[key].dtype != own.dtype:
                found = f"{state[key].dtype} {state[key].shape}"
                raise InputError("state of a mixture", key, found, f"{own.dtype} {own.shape}")
        model._mean, model._variance, model._weight = (state[key].copy() for key in ("mean", "variance", "weight"))
        model._learned, model._asked = int(state["learned"]), int(state["asked"])
        return model

    def state(self) -> dict[str, AnyArray]:
        """Copies of all that it has learned.

        Returns
        -------
        dict
            mean float32 (v, u, K, 3) grey levels BGR, variance float32 (v, u, K) squared grey levels, weight float32
            (v, u, K), learned and asked int64 (): frames so far of `learn` and of `likelihood`.
        """
        return {
            "mean": self._mean.copy(),
            "variance": self._variance.copy(),
            "weight": self._weight.copy(),
            "learned": np.array(self._learned, np.int64),
            "asked": np.array(self._asked, np.int64),
        }

    def learn(self, image: Bytes) -> None:
        """Learn a frame of the empty scene, uint8 (v, u, 3) BGR; all frames learned count the same."""
        self._check(image)
        certain = np.ones(image.shape[:2], np.float32)
        rate = 1.0 / (self._learned + 1)
        self._update(slice(None), image, self._gain(image), certain, rate, rate)
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
            raise SourceError("mixture", "", "no frames", "one or more to learn from")
        for frame in frames:
            self._check(frame)
        config = self.config
        mean, variance = commonest_colours(np.stack(frames), config.match * config.minimum_sd)
        self._weight[:] = 0
        self._weight[:, :, 0] = 1
        self._mean[:, :, 0] = mean
        self._variance[:, :, 0] = np.maximum(variance, config.minimum_sd**2)
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
            L in (0, 1), as the module defines it, log-odds averaged over `radius`.

        Raises
        ------
        SourceError
            Where the image is not of the model's size, or nothing has been learned yet.
        """
        self._check(image)
        if self._learned == 0:
            raise SourceError("mixture", "", "a model that has learned nothing", "frames to learn from first")
        config = self.config
        gain = self._gain(image)
        log_odds, rows, likelihood = (np.empty(image.shape[:2], np.float32) for _ in range(3))
        evaluate(
            image, gain, self._mean, self._variance, self._weight, config.share, config.foreground,
            config.unexplained, config.shadow, config.darkest, config.mimicry, log_odds,
        )  # fmt: skip
        pool_log_odds(log_odds, config.radius, rows, likelihood)
        step = _TURNS / self._frame_rate
        fast = 1.0 - math.exp(-step / config.memory)
        slow = 1.0 - (1.0 - config.share) ** (step / config.absorption)
        self._update(slice(self._asked % _TURNS, None, _TURNS), image, gain, likelihood, fast, slow)
        self._asked += 1
        return likelihood

    def _gain(self, image: Bytes) -> Floats:
        """The frame's light relative to the model's."""
        return channel_gains(image, self._mean, self._weight) if self._learned else np.ones(3)

    def _update(self, rows: slice, image: Bytes, gain: Floats, likelihood: Singles, fast: float, slow: float) -> None:
        config = self.config
        update(
            image[rows], gain.astype(np.float32), likelihood[rows], np.float32(fast), np.float32(slow),
            np.float32(config.share), np.float32(config.match), np.float32(config.minimum_sd),
            np.float32(config.initial_sd), self._mean[rows], self._variance[rows], self._weight[rows],
        )  # fmt: skip

    def _check(self, image: Bytes) -> None:
        shape = (*self._weight.shape[:2], 3)
        if image.shape != shape or image.dtype != np.uint8:
            raise SourceError("mixture", "image", f"{image.dtype} {image.shape}", f"uint8 {shape}")
