"""Background models behind one door: ours with soft maps, OpenCV's with masks at many settings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import Bytes, Flags, Floats, Singles
from stseg.foreground import Background, Chromatic, Codebook, IlluminationMonitor, Mixture

__all__ = ["HISTORY", "LEVELS", "MODELS", "Count", "Ours", "Setting", "area_under", "ours", "settings"]

MODELS: dict[str, Callable[[tuple[int, int], float], Background]] = {
    "Mixture": Mixture,
    "Chromatic": Chromatic,
    "Codebook": Codebook,
}
HISTORY = (500, 5000)
"""Frames that a peer remembers: its default, and long enough for people who stand."""
LEVELS = {
    "MOG2": (5.0, 9.0, 16.0, 25.0, 40.0, 80.0, 200.0),
    "KNN": (100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0, 8000.0),
}
"""Squared distances that a peer's mask is swept over; the defaults, 16 and 400, are among them."""


class Ours:
    """A model of ours, its light watched; where it is blind it says nothing."""

    def __init__(self, model: Background, frame_rate: float) -> None:
        self._watch = IlluminationMonitor(model, frame_rate)

    def learn(self, image: Bytes) -> None:
        self._watch.model.learn(image)

    def likelihood(self, image: Bytes) -> Singles:
        found = self._watch.likelihood(image)
        return np.full(image.shape[:2], self._watch.model.prior, np.float32) if found is None else found


def ours(name: str, size: tuple[int, int], frame_rate: float) -> Ours:
    """A model of ours by name."""
    return Ours(MODELS[name](size, frame_rate), frame_rate)


class Peer:
    """A background subtractor of OpenCV; a shadow is background."""

    def __init__(self, subtractor: cv2.BackgroundSubtractor, rate: float) -> None:
        self._subtractor, self._rate = subtractor, rate

    def learn(self, image: Bytes) -> None:
        self._subtractor.apply(image)

    def mask(self, image: Bytes) -> Flags:
        """What it calls foreground, bool (v, u)."""
        return np.asarray(self._subtractor.apply(image, learningRate=self._rate) == 255, np.bool_)


@dataclass(frozen=True)
class Setting:
    """One setting of a peer."""

    peer: str
    level: float
    shadows: bool
    history: int
    steady: bool
    """Whether it learns at the rate 1 / history once the empty scene is known; else as it chooses, faster at first."""

    def make(self) -> Peer:
        """A subtractor of this setting."""
        make = {"MOG2": cv2.createBackgroundSubtractorMOG2, "KNN": cv2.createBackgroundSubtractorKNN}[self.peer]
        return Peer(make(self.history, self.level, self.shadows), 1.0 / self.history if self.steady else -1.0)


def settings(peer: str, frames: int) -> Iterator[Setting]:
    """All settings of a peer for a film of so many frames; until half its memory has passed, that changes nothing."""
    for history in HISTORY if frames > min(HISTORY) / 2 else HISTORY[:1]:
        for steady in (False, True):
            for shadows in (False, True):
                for level in LEVELS[peer]:
                    yield Setting(peer, level, shadows, history, steady)


class Count:
    """Pixels by score and truth: the curve of precision over recall."""

    _BINS = 4001

    def __init__(self) -> None:
        self._counts = np.zeros((2, self._BINS), np.int64)

    def add(self, likelihood: Singles, people: Flags) -> None:
        """Count one frame; people bool (v, u)."""
        clipped = np.clip(likelihood.astype(np.float64), 1e-6, 1 - 1e-6)
        place = np.rint((np.log(clipped / (1 - clipped)) / 28.0 + 0.5) * (self._BINS - 1)).astype(np.int64)
        for row, chosen in enumerate((~people, people)):
            self._counts[row] += np.bincount(place[chosen], minlength=self._BINS)

    def points(self) -> Floats:
        """False and true positives at every level that occurs, strictest first, float64 (n, 2)."""
        used = self._counts.sum(axis=0)[::-1] > 0
        return np.cumsum(self._counts[:, ::-1], axis=1)[:, used].T.astype(float)

    def best_overlap(self) -> float:
        """Intersection over union at the level where it is largest."""
        false, true = self.points().T
        return float((true / (self._counts[1].sum() + false)).max())


def area_under(points: Floats, people: int, others: int) -> float:
    """Area under the precision-recall curve through points (false positives, true positives), float64 (n, 2).

    Between points both counts grow in proportion (Davis and Goadrich 2006); before the first, precision stays; after
    the last, the rest follows in random order. Points that another one dominates are left out.
    """
    ordered = points[np.lexsort((-points[:, 1], points[:, 0]))]
    kept = ordered[ordered[:, 1] > np.concatenate([[0.0], np.maximum.accumulate(ordered[:, 1])[:-1]])]
    false, true = np.concatenate([kept, [[others, people]]]).T
    area = true[0] / people * true[0] / (true[0] + false[0])
    for k in range(1, len(true)):
        share = np.linspace(0.0, 1.0, 33)
        t, f = true[k - 1] + share * (true[k] - true[k - 1]), false[k - 1] + share * (false[k] - false[k - 1])
        area += np.trapezoid(t / (t + f), t) / people
    return float(area)
