"""Sudden illumination change: detection and recovery (docs/how-it-works.md, Foreground).

A background model adapts to slow light, and by one gain a channel to whatever changes a whole view alike. Where a lamp
or a cloud changes a part of the view, a large share of it turns into foreground at once: more than people can cover. In
another light the new foreground keeps the texture of the background: dark spots stay darker than their surroundings. A
body (somebody before the lens) has a texture of its own. If it is light,

1. a smooth field of gains (`stseg.foreground.gain_field`) is fitted to the pixels that showed background just before,
   and the model is relit by it: from a quarter of such a share on, so that a moving cloud is followed step by step.
2. As long as too much stays foreground, the view is blind, but not for longer than `blind_time`.
3. After that time, pixels that showed background before the change, have been static since, and changed in brightness
   much more than in colour, are relit one by one: sharp borders of light, and saturated pixels.

If it is no light (an obstacle before the lens, a camera that was pushed), the view is used again after that time as it
is. What a background was learned from may have other light than the first image of a segment. The model is then relit
by the temporal mode of the frames that share the light of that image: people who walk are not in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter, minimum_filter, uniform_filter

from stseg.arrays import Bytes, Flags, Singles
from stseg.config import IlluminationConfig
from stseg.foreground.background.model import Background
from stseg.foreground.channel_gain import STRIDE
from stseg.foreground.gain_field import gain_field

_FAINT_SHARE = 0.25  # of the rise that is a change: from there on a smooth field is tried
_EQUAL_COLOUR = 20.0  # grey levels within which colours agree, in the channel that differs most
_KEPT_FRAMES = 8  # frames since a change from which static pixels are found
_STATIC_SHARE = 0.85  # share of them that must agree
_GREATEST_TINT = 0.35  # of the logarithm of the gain: how much more one channel may change than their mean
_GREATEST_GAIN = 1.5  # of that logarithm: how much one pixel's light may change
_TEXTURE = 0.02  # of the logarithm of grey levels, against the surroundings: fainter texture is not compared
_SAME_TEXTURE = 0.75  # share of it that stays in another light; of a body it is half, by chance
_SURROUNDINGS = 0.02  # of the width of the view: how far the surroundings of a pixel reach
_FEWEST_SURROUNDINGS = 36.0  # with texture, by which light is known: three quarters agree by chance once in 500


@dataclass(slots=True)
class LightChange:
    """One sudden illumination change of a view."""

    first: int
    last: int
    """Frames between which the light changed, counted from the first call of `likelihood`."""
    blind: int = 0
    """Number of frames without evidence."""


class IlluminationMonitor:
    """A background model with detection of sudden illumination changes.

    Parameters
    ----------
    model
        The model, which has learned the empty scene.
    frame_rate
        Frames per second at which `likelihood` is called.
    config
        Thresholds of a change.
    """

    def __init__(self, model: Background, frame_rate: float, config: IlluminationConfig | None = None) -> None:
        self.model = model
        self.changes: list[LightChange] = []
        """All changes so far."""
        self._config = IlluminationConfig() if config is None else config
        self._window = max(1, round(self._config.change_time * frame_rate))
        self._patience = max(1, round(self._config.blind_time * frame_rate))
        self._shares: deque[float] = deque(maxlen=self._window)
        self._frames = 0
        self._good: Singles | None = None
        self._open: _OpenChange | None = None

    def sees_other_light(self, image: Bytes) -> bool:
        """Whether an image, uint8 (v, u, 3) BGR, shows another light than the model's, or more than people cover."""
        likelihood, config = deepcopy(self.model).likelihood(image), self._config
        share, empty = self._share(likelihood), np.ones(likelihood.shape, np.float32)
        is_light = share > _FAINT_SHARE * config.changed_share and self._keeps_texture(image, likelihood, empty)
        return share > config.changed_share or is_light

    def relight(self, images: Sequence[Bytes]) -> None:
        """Relight the model, pixel by pixel, to the light of the first of images in which people walk.

        Images uint8 (v, u, 3) BGR, as of `Background.learn_from`, teach that light until it changes.
        """
        lit = np.cumsum([2 * self.sees_other_light(image) - 1 for image in images])
        ends = np.flatnonzero(np.maximum.accumulate(lit) - lit > 1)  # one frame may be wrong by itself
        present = deepcopy(self.model)
        present.learn_from(images[: int(lit[: ends[0] if len(ends) else None].argmax()) + 1])
        scene = np.rint(present.background_image()).astype(np.uint8)
        likelihood, empty = deepcopy(self.model).likelihood(scene), np.ones(scene.shape[:2], np.float32)
        if self._keeps_texture(scene, likelihood, empty):
            self.model.relight(stationary_gain(scene[None], self.model.background_image(), empty, empty > 0))

    def skip(self) -> None:
        """Count a missing frame."""
        self._frames += 1

    def likelihood(self, image: Bytes) -> Singles | None:
        """The model's likelihood, or None while the view is blind.

        Parameters
        ----------
        image : uint8 (v, u, 3) BGR
            The next frame.
        """
        relit = unlit = self.model.likelihood(image)
        share = self._share(relit)
        rise = 0.0 if self._good is None else share - min(self._shares)
        if self._good is not None and rise > _FAINT_SHARE * self._config.changed_share:
            if self._open is None and rise > self._config.changed_share:
                self._record_change()
                self._open = _OpenChange(1 - self._good, self._frames)
            relit = self._in_new_light(image, relit, 1 - self._good if self._open is None else self._open.empty)
        found = relit if self._open is None else self._settle(self._open, image, relit)
        if found is not None:
            self._good = found
            self._shares.append(share if found is unlit else self._share(found))
        self._frames += 1
        return found

    def _share(self, likelihood: Singles) -> float:
        """Share of the view with a likelihood above the prior."""
        return float((likelihood[::STRIDE, ::STRIDE] > np.float32(self.model.prior)).mean())

    def _record_change(self) -> None:
        """Record a change, or one more step of the last."""
        if not self.changes or self._frames - self.changes[-1].last > self._window:
            self.changes.append(LightChange(self._frames, self._frames))
        self.changes[-1].last = self._frames

    def _settle(self, change: _OpenChange, image: Bytes, likelihood: Singles) -> Singles | None:
        """Likelihood during an open change, None while the change is unexplained."""
        config, waited = self._config, self._frames - change.since + 1
        if waited % max(1, self._patience // _KEPT_FRAMES) == 0:
            change.frames.append(image.copy())
        if waited < self._patience:
            if self._share(likelihood) - min(self._shares) <= config.changed_share:
                return likelihood
            self._record_change()
            self.changes[-1].blind += 1
            return None
        unexplained = likelihood > self.model.prior
        is_few = self._share(likelihood) - min(self._shares) <= config.changed_share
        if is_few or self._keeps_texture(image, likelihood, change.empty):
            frames = np.stack([*change.frames, image])
            self.model.relight(stationary_gain(frames, self.model.background_image(), change.empty, unexplained))
            likelihood = self.model.likelihood(image)
        self._open = None
        self._shares.clear()
        return likelihood

    def _in_new_light(self, image: Bytes, likelihood: Singles, empty: Singles) -> Singles:
        """Likelihood after relighting the model by a smooth field of gains, if the change is one of light."""
        if not self._keeps_texture(image, likelihood, empty):
            return likelihood
        self._record_change()
        self.model.relight(gain_field(image, self.model.background_image(), empty))
        return self.model.likelihood(image)

    def _keeps_texture(self, image: Bytes, likelihood: Singles, empty: Singles) -> bool:
        """Whether new foreground has the texture of the background, as another light has; a body has its own."""
        around = max(6, round(_SURROUNDINGS * image.shape[1]))
        grey = (np.log(colours.mean(-1, dtype=np.float32) + 1) for colours in (image, self.model.background_image()))
        now, before = (uniform_filter(level, around // 6) - uniform_filter(level, 2 * around) for level in grey)
        new = (likelihood > self.model.prior) & (empty > 0.5) & (np.abs(before) > _TEXTURE)
        compared = max(_FEWEST_SURROUNDINGS * around**2, np.count_nonzero(new))
        return bool(np.count_nonzero(new & (now * before > 0)) > _SAME_TEXTURE * compared)


@dataclass(slots=True)
class _OpenChange:
    """An open change: probability of background before it (v, u), its first frame, and frames since."""

    empty: Singles
    since: int
    frames: list[Bytes] = field(default_factory=list)


def stationary_gain(frames: Bytes, background: Singles, empty: Singles, unexplained: Flags) -> Singles:
    """Gains of static pixels in a new light, one by one.

    Parameters
    ----------
    frames : uint8 (n, v, u, 3)
        In the new light; it may go on changing smoothly, and the gains are those of the last.
    background : float32 (v, u, 3)
        Grey levels in the light that they were learned in.
    empty : float32 (v, u)
        Probability that each pixel showed background before the light changed, 0..1.
    unexplained : bool (v, u)
        Pixels of an unexplained change; all others keep their light.

    Returns
    -------
    float32 (v, u, 3)
        Where a person was or is, where the scene moves or has another colour: the gains of the surroundings.
    """
    middle = np.median(frames, axis=0).astype(np.float32)
    agree = (np.abs(frames - middle).max(-1) <= _EQUAL_COLOUR).mean(0)
    now = gain_field(frames[-1], middle, agree.astype(np.float32))
    ratio = np.log((now * middle + 1) / (background + 1))
    brighter = ratio.mean(-1, keepdims=True)
    tint = np.abs(ratio - brighter).max(-1)
    around = _SURROUNDINGS * empty.shape[1]
    empty_around = minimum_filter(empty, round(around) | 1)
    is_light = (tint <= _GREATEST_TINT) & (np.abs(brighter[..., 0]) <= _GREATEST_GAIN)
    lit = (agree >= _STATIC_SHARE) & (empty_around > 0.5) & is_light
    weight = gaussian_filter(lit.astype(np.float32), around)[..., None] + np.float32(1e-6)
    filled = gaussian_filter(np.where(lit[..., None], ratio, 0), (around, around, 0)) / weight
    relit = np.where(unexplained[..., None], ratio, 0)
    return np.asarray(np.exp(np.where(lit[..., None], relit, filled)), np.float32)
