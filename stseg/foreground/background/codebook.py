"""Codebook background model (Kim et al. 2005, used by Kim and Davis 2006): foreground is what no codeword explains.

A codeword is a colour v, the bounds [low, high] of its brightness relative to v, its frequency (turns in which it was
seen), its longest negative run (the most turns at a stretch in which it was not: MNRL), and the turns of its first and
last access. With r = x.v / |v|^2 a colour x has the distortion d = |x - r v| and the brightness r.

A match or none becomes a likelihood by the noise sigma of a channel: each codeword is a tube around its ray,

    p(x | codeword) = exp(-d^2 / (2 sigma^2)) / (2 pi sigma^2) B(r),

so that distortion d takes d^2 / (2 sigma^2) nats from the log-density of the background. B, per grey level along the
ray, is level within the bounds and Gaussian (sigma) beyond them for what is lit; it falls straight from `low` to
`darkest` low for a shadow, and from `high` to `brightest` high for a highlight. Hence

    p(x | scene)  = (1 - e) sum_k w_k [(1 - s - h) lit_k + s shadow_k + h highlight_k] + e U,
    p(x | person) = (1 - m) U + m sum_k w_k shadow_k,

and L is the posterior with prior f, as in `mixture`. The sums are over background codewords, w_k is
proportional to frequency, which stops growing once it is worth the memory.

Learning. Frames of the empty scene make codewords of whatever they show. Among people the commonest colour of a pixel
is one, and any other whose longest negative run, around the end, is at most the share `recurrence` of the frames.

Then there are two layers (Kim et al., section 4). An unexplained colour, where L >= 1/2, becomes a codeword of the
cache: it is no background, however long a person stands there. It is forgotten once it is away for `absence`, and
becomes background `absorption` seconds after its first access if it was seen in half of the time. Background that was
absorbed so is forgotten when it is away for `absorption`; what was learned first stays, and the cache takes no place of
background. Background learns with (1 - L) times the rate dt / memory; its bounds move inwards with that rate and
outwards twenty times as fast, so that they hold most of the brightness seen, and a passing shadow hardly widens them.
A colour that only a shadow or a highlight explains updates nothing.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import AnyArray, Bytes, Floats, Singles
from stseg.config import CodebookConfig
from stseg.foreground.background.codebook_kernels import evaluate, follow, settle, teach
from stseg.foreground.background.model import TURNS, PixelModel
from stseg.foreground.background.temporal_mode import commonest_colours


class Codebook(PixelModel):
    """The background of one view, and the likelihood that its pixels show people.

    State: mean float32 (v, u, K, 3), the colour v, grey levels BGR; bounds float32 (v, u, K, [low, high]), relative to
    it; frequency float32 (v, u, K), turns; weight float32 (v, u, K), the frequency of background, at most that of the
    memory, and 0 in the cache; access int32 (v, u, K, [first, last]), turns, first 0 for what was learned
    before the first call of `likelihood`. A frequency of 0 is an empty place.
    """

    name: ClassVar[str] = "codebook"

    def __init__(self, size: tuple[int, int], frame_rate: float, config: CodebookConfig | None = None) -> None:
        self.config = CodebookConfig() if config is None else config
        shape = (size[1], size[0], self.config.codewords)
        arrays = {
            "mean": np.zeros((*shape, 3), np.float32),
            "bounds": np.ones((*shape, 2), np.float32),
            "frequency": np.zeros(shape, np.float32),
            "weight": np.zeros(shape, np.float32),
            "access": np.zeros((*shape, 2), np.int32),
        }
        super().__init__(size, frame_rate, self.config)
        self._arrays: dict[str, AnyArray] = arrays

    def relight(self, gain: Singles) -> None:
        """Multiply all that was learned by gains float32 (v, u, 3), after a change of light."""
        self._arrays["mean"] *= gain[:, :, None]

    def _background_sample(self, step: int) -> Singles:
        mean, weight = (self._arrays[name][::step, ::step] for name in ("mean", "weight"))
        strongest = weight.argmax(-1)[:, :, None, None]
        return np.asarray(np.take_along_axis(mean, strongest, 2)[:, :, 0])

    def _start(self, frames: NDArray[np.uint8]) -> None:
        for array in self._arrays.values():
            array[:] = 0
        mean, bounds, frequency, weight, access = self._arrays.values()
        mean[:, :, 0], _ = commonest_colours(frames, self.config.match_distance * self.config.channel_sd)
        bounds[:] = 1
        frequency[:, :, 0] = weight[:, :, 0] = 1
        longest = np.zeros(weight.shape, np.int32)
        for index, frame in enumerate(frames):
            self._learn(frame, np.ones(3), index + 1, longest)
        settle(len(frames), round(self.config.recurrence * len(frames)), longest, frequency, weight, access)

    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        self._learn(image, gain, 0, np.zeros(self._arrays["weight"].shape, np.int32))

    def _learn(self, image: Bytes, gain: Floats, now: int, longest: NDArray[np.int32]) -> None:
        reach = np.float32(self.config.match_distance * self.config.channel_sd)
        mean, bounds, *records = self._arrays.values()
        teach(image, gain.astype(np.float32), now, reach, longest, mean, bounds, *records)

    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        config = self.config
        evaluate(
            image, gain, self._arrays["mean"], self._arrays["bounds"], self._arrays["weight"], config.foreground_prior,
            config.outlier_rate, config.shadow_prior, config.highlight_prior, config.darkest_shadow,
            config.brightest_highlight, config.shadow_confusion, config.channel_sd, log_odds,
        )  # fmt: skip

    def _update_rows(self, first: int, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        config, turn, rows = self.config, self._turn, slice(first, None, TURNS)
        follow(
            image[rows], gain.astype(np.float32), likelihood[rows], self._frames_evaluated // TURNS + 1,
            np.float32(config.match_distance * config.channel_sd), np.float32(1.0 - math.exp(-turn / config.memory)),
            math.ceil(config.absorption_time / turn), math.ceil(config.absence / turn),
            *(array[rows] for array in self._arrays.values()),
        )  # fmt: skip
