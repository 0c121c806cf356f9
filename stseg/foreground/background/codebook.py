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

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.config import CodebookConfig
from stseg.foreground.background.codebook_kernels import Codewords, Tube, fill_codebook_log_odds, follow, teach
from stseg.foreground.background.model import TURNS, Background
from stseg.foreground.background.temporal_mode import commonest_colours


class Codebook(Background):
    """The background of one view, and the likelihood that its pixels show people."""

    name: ClassVar[str] = "codebook"

    def __init__(self, size: tuple[int, int], frame_rate: float, config: CodebookConfig | None = None) -> None:
        self.config = config = CodebookConfig() if config is None else config
        super().__init__(size, frame_rate, config, config.channel_sd)
        self._words = Codewords.none((size[1], size[0], config.codewords))
        self._tube = Tube(config.highlight_prior, config.brightest_highlight, config.channel_sd)
        self._reach = config.match_distance * config.channel_sd

    def relight(self, gain: Singles) -> None:
        """Multiply all that was learned by gains float32 (v, u, 3), after a change of light."""
        self._words.mean[:] *= gain[:, :, None]

    def _background_sample(self, step: int) -> Singles:
        strongest = self._words.weight[::step, ::step].argmax(-1)[:, :, None, None]
        return np.asarray(np.take_along_axis(self._words.mean[::step, ::step], strongest, 2)[:, :, 0])

    def _start(self, frames: NDArray[np.uint8]) -> None:
        self._words = words = Codewords.none(self._words.weight.shape)
        words.mean[:, :, 0], _ = commonest_colours(frames, self._reach)
        words.frequency[:, :, 0] = words.weight[:, :, 0] = 1
        longest = np.zeros(words.weight.shape, np.int32)
        for index, frame in enumerate(frames):
            self._learn(frame, np.ones(3), index + 1, longest)
        forget_rare_words(len(frames), round(self.config.recurrence * len(frames)), longest, words)

    def _learn_empty(self, image: Bytes, gain: Floats) -> None:
        self._learn(image, gain, 0, np.zeros(self._words.weight.shape, np.int32))

    def _learn(self, image: Bytes, gain: Floats, now: int, longest: NDArray[np.int32]) -> None:
        teach(image, gain.astype(np.float32), now, np.float32(self._reach), longest, self._words)

    def _evaluate(self, image: Bytes, gain: Floats, log_odds: Singles) -> None:
        fill_codebook_log_odds(image, gain.astype(np.float32), self._words, self._priors, self._tube, log_odds)

    def _update_rows(self, first: int, image: Bytes, gain: Floats, likelihood: Singles) -> None:
        config, turn, rows = self.config, self._turn, slice(first, None, TURNS)
        times = math.ceil(config.absorption_time / turn), math.ceil(config.absence / turn)
        rate = np.float32(1.0 - math.exp(-turn / config.memory))
        words = self._words.rows(rows)
        now = self._frames_evaluated // TURNS + 1
        follow(image[rows], gain.astype(np.float32), likelihood[rows], now, np.float32(self._reach), rate, times, words)


def forget_rare_words(frames: int, allowed: int, longest: NDArray[np.int32], words: Codewords) -> None:
    """After initialisation among people, keep the first codewords and those with an allowed longest negative run.

    A run goes on from the last frame to the first (Kim et al. 2005, section 2.1).
    """
    around = frames - words.access[..., 1] + words.access[..., 0] - 1
    rare = np.maximum(longest, around) > allowed
    rare[:, :, 0] = False
    words.frequency[rare] = words.weight[rare] = 0
    words.access[:] = 0
