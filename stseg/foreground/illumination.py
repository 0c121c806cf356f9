"""Light that changes at once, recognised and followed (METHODS 2).

A background model follows slow light, and through one gain a channel whatever changes a whole view alike. Where a lamp
or a cloud changes a part of it, a large share of the view turns into foreground within moments: more than walkers can
cover. Then

1. a smooth field of gains (`stseg.foreground.gain_field`) is fitted, among the pixels that showed background just
   before. If it is broad, as no body is, and explains most of what is new, the model is brought into the new light, and
   nobody notices anything. This is tried from a quarter of such a share on, so that a cloud is followed step by step.
2. Where it does not, the view is blind until the light is understood, but not for longer than `blindness`.
3. That long after the change, pixels that showed background before it, have stood still since, and changed in
   brightness much more than in colour, are taken in their new light one by one: the sharp borders of light, and what is
   too bright for the sensor. If they are no large share either it was no light (somebody before the lens, a camera that
   was pushed): the view speaks again as it is.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter, minimum_filter

from stseg.arrays import Bytes, Flags, Singles
from stseg.config import IlluminationConfig
from stseg.foreground.background import Background
from stseg.foreground.gain_field import gain_field

_STEP = 4  # pixels; a sixteenth of them are ample for a share
_FAINT = 0.25  # of the rise that is a change: from there on a smooth field is tried
_UNLIKE, _BROAD = 0.03, 0.4  # a field is light if its logarithm is so far from its median on so much of the view
_SAME = 20.0  # grey levels within which colours agree, in the channel that differs most
_KEPT = 8  # frames since a change that are looked at to tell what stands still
_STILL = 0.85  # share of them that must agree
_TINT = 0.35  # of the logarithm of the gain: how much more one channel may change than their mean
_BRIGHTER = 1.5  # of that logarithm: how much one pixel's light may change
_AROUND = 0.02  # of the width of the view: how far the surroundings of a pixel reach


@dataclass(slots=True)
class LightChange:
    """One change of the light of a view.

    Attributes
    ----------
    first, last
        Frames between which the light changed, counted from the first that was asked for.
    blind
        Number of frames that said nothing.
    """

    first: int
    last: int
    blind: int = 0


class IlluminationMonitor:
    """A background model whose light is watched.

    Parameters
    ----------
    model
        The model, which has learned the empty scene.
    frame_rate
        Frames per second at which `likelihood` is asked.
    config
        What is a change.

    Attributes
    ----------
    changes
        All changes so far.
    """

    def __init__(self, model: Background, frame_rate: float, config: IlluminationConfig | None = None) -> None:
        self.model = model
        self.changes: list[LightChange] = []
        self._config = IlluminationConfig() if config is None else config
        self._window = max(1, round(self._config.change_time * frame_rate))
        self._patience = max(1, round(self._config.blind_time * frame_rate))
        self._shares: deque[float] = deque(maxlen=self._window)
        self._asked = 0
        self._good: Singles | None = None
        self._open: _Open | None = None

    def skip(self) -> None:
        """Count a frame that did not come."""
        self._asked += 1

    def likelihood(self, image: Bytes) -> Singles | None:
        """As the model's, or None where the view is blind.

        Parameters
        ----------
        image : uint8 (v, u, 3) BGR
            The next frame.
        """
        own = self.model.likelihood(image)
        if self._good is not None and self._new_share(own) > _FAINT * self._config.changed_share:
            if self._open is None and self._new_share(own) > self._config.changed_share:
                self._note()
                self._open = _Open(1 - self._good, self._asked)
            own = self._in_new_light(image, own, 1 - self._good if self._open is None else self._open.empty)
        found = own if self._open is None else self._settle(self._open, image, own)
        if found is not None:
            self._good = found
            self._shares.append(self._share(found))
        self._asked += 1
        return found

    def _share(self, likelihood: Singles) -> float:
        """Share of the view that looks more like people than not, the prior apart."""
        return float((likelihood[::_STEP, ::_STEP] > self.model.prior).mean())

    def _new_share(self, likelihood: Singles) -> float:
        """How much that share has risen."""
        return self._share(likelihood) - min(self._shares)

    def _note(self) -> None:
        """Remember a change, or one more step of the last."""
        if not self.changes or self._asked - self.changes[-1].last > self._window:
            self.changes.append(LightChange(self._asked, self._asked))
        self.changes[-1].last = self._asked

    def _settle(self, change: _Open, image: Bytes, likelihood: Singles) -> Singles | None:
        """The likelihood while the light settles, None where it is not understood."""
        config, waited = self._config, self._asked - change.since + 1
        if waited % max(1, self._patience // _KEPT) == 0:
            change.frames.append(image.copy())
        if waited < self._patience:
            if self._new_share(likelihood) <= config.changed_share:
                return likelihood
            self._note()
            self.changes[-1].blind += 1
            return None
        strange = likelihood > self.model.prior
        gain = stationary_gain(np.stack([*change.frames, image]), self.model.background_image(), change.empty, strange)
        if self._new_share(likelihood) <= config.changed_share or self._explains(gain, image, likelihood, change.empty):
            self.model.relight(gain)
            likelihood = self.model.likelihood(image)
        self._open = None
        self._shares.clear()
        return likelihood

    def _in_new_light(self, image: Bytes, likelihood: Singles, empty: Singles) -> Singles:
        """The likelihood with the model under a smooth field of gains, if that is what has changed."""
        gain = gain_field(image, self.model.background_image(), empty)
        if not _is_broad(gain) or not self._explains(gain, image, likelihood, empty):
            return likelihood
        self._note()
        self.model.relight(gain)
        return self.model.likelihood(image)

    def _explains(self, gain: Singles, image: Bytes, likelihood: Singles, empty: Singles) -> bool:
        """Whether gains explain most of what looks new."""
        few = np.s_[::_STEP, ::_STEP]
        expected = np.minimum(gain[few] * self.model.background_image()[few], 255)
        near = np.abs(image[few] - expected).max(-1) <= _SAME
        new = (likelihood[few] > self.model.prior) & (empty[few] > 0.5)
        return bool(2 * np.count_nonzero(new & near) > np.count_nonzero(new))


def _is_broad(gain: Singles) -> bool:
    """Whether a field differs over much of the view: one that differs at one place follows a body there."""
    logarithm = np.log(gain[::_STEP, ::_STEP])
    differs = np.abs(logarithm - np.median(logarithm, axis=(0, 1))).max(-1) > _UNLIKE
    return bool(differs.mean() > _BROAD)


@dataclass(slots=True)
class _Open:
    """A change that is not over: where background showed before it, its first frame, and frames since."""

    empty: Singles
    since: int
    frames: list[Bytes] = field(default_factory=list)


def stationary_gain(frames: Bytes, background: Singles, empty: Singles, strange: Flags) -> Singles:
    """Gains of pixels that stand still in a new light, one by one.

    Parameters
    ----------
    frames : uint8 (n, v, u, 3)
        In the new light; it may go on changing smoothly, and the gains are those of the last.
    background : float32 (v, u, 3)
        Grey levels in the light that they were learned in.
    empty : float32 (v, u)
        Probability that each pixel showed background before the light changed, 0..1.
    strange : bool (v, u)
        Where it is not understood; all others keep their light.

    Returns
    -------
    float32 (v, u, 3)
        Those of the surroundings where somebody was or has come, where it moves or has another colour.
    """
    middle = np.median(frames, axis=0).astype(np.float32)
    agree = (np.abs(frames - middle).max(-1) <= _SAME).mean(0)
    now = gain_field(frames[-1], middle, agree.astype(np.float32))
    ratio = np.log((now * middle + 1) / (background + 1))
    brighter = ratio.mean(-1, keepdims=True)
    tint = np.abs(ratio - brighter).max(-1)
    around = _AROUND * empty.shape[1]
    apart = minimum_filter(empty, round(around) | 1)
    lit = (agree >= _STILL) & (apart > 0.5) & (tint <= _TINT) & (np.abs(brighter[..., 0]) <= _BRIGHTER)
    known = gaussian_filter(lit.astype(np.float32), around)[..., None] + np.float32(1e-6)
    filled = gaussian_filter(np.where(lit[..., None], ratio, 0), (around, around, 0)) / known
    own = np.where(strange[..., None], ratio, 0)
    return np.asarray(np.exp(np.where(lit[..., None], own, filled)), np.float32)
