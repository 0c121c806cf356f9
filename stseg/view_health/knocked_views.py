"""Views that are knocked: from one frame on they show all people beside their places, in one image direction.

Of a person whom a track predicts, a view shows a share h of the outline as foreground. In the frame in which a camera
is pushed aside, h falls, and one shift of the whole picture puts the people back; in the other views no shift does. So
a view is knocked where

- the mean of h over people is less than usual by 0.2, and by four times its own spread from frame to frame,
- one shift, of a body's height at most, gains by it 0.2 in the mean and 1 in the sum, one whole person,
- in two other views at least no shift gains 0.1 in the mean, and no other view falls so: tracks that err together do in
  several.

What one person gains is bounded by 1/2: a detector may miss anybody. The view is excluded from that frame on: a frame
later tracks would follow it, and of three views no majority says which one errs. It counts again once shifts gain less
than 0.1 in the mean of a quarter of a second, three frames at least, by the tracks of the others.

Only people count who were detected in the last frames, and whose outlines lie within the image. A view that stands
beside from the start, since its calibration is wrong, is not knocked.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.outlines import Spans
from stseg.bodies.views import BoxView, PixelView, ViewObservation
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.kernels.accelerate import kernel
from stseg.records.candidates import Candidates
from stseg.records.predicted_tracks import PredictedTracks

_FALL = 0.2
"""How much less of people a knocked view shows than usual, and at their places than at those of the best shift."""
_SPREADS = 4.0
"""The same beside the standard deviation of the mean over people from frame to frame."""
_MOST_GAIN = 0.5
"""Bound of what a shift gains by one person."""
_LEAST_GAIN = 1.0
"""What the best shift of a knocked view gains by all people."""
_STEADY = 0.1
"""What a shift gains in the mean where a view is not knocked."""
_OTHERS = 2
"""Least number of other views that are not."""
_KNOWN, _FRAMES_KNOWN = 1.0, 5.0
"""Time with people from which it is known what a view usually shows, seconds, and frames at least."""
_RECENT, _FRAMES = 0.25, 3.0
"""Time constant of what shifts gain in a knocked view, seconds, and frames at least."""
_WHOLE = 0.9
"""Share of an outline's area that its pixels in the image make up, where the image's border does not cut it."""
_REACH, _STEP = 30, 2
"""Greatest shift, about a body's height, and distance between those that are tried, raster pixels."""
_ALONG = np.arange(-_REACH, _REACH + 1, _STEP)
_IN_PLACE = np.zeros((1, 2), np.int64)
_SHIFTS = np.stack(np.meshgrid(_ALONG, _ALONG, indexing="ij"), -1).reshape(-1, 2)


class KnockedViews:
    """Recognition of knocked views in a session.

    Parameters
    ----------
    views
        Number of views.
    body
        Sizes of the population.
    frame_rate
        Frames per second.
    level
        How fast is forgotten what a view usually shows.

    Attributes
    ----------
    knocked : bool (view,)
        Whether each view is.
    usual : float64 (view, 3)
        Frames with people, and sums of the mean share of them that views show, and of its square.
    recent : float64 (view, 2)
        Weight, and weighted sum of what the best shift gains while a view is knocked; people.
    """

    def __init__(self, views: int, body: BodyConfig, frame_rate: float, level: ErrorRateConfig) -> None:
        self._body, self._rate, self._memory = body, frame_rate, level.memory
        self.knocked = np.zeros(views, bool)
        self.usual, self.recent = np.zeros((views, 3)), np.zeros((views, 2))

    def compare(
        self,
        predicted: PredictedTracks,
        views: Sequence[BoxView | PixelView],
        observations: Sequence[ViewObservation | None],
    ) -> None:
        """Count the next frame, before it is explained: what views show of the people whom tracks predict."""
        detected = predicted.existence > 0
        ground, heights = predicted.ground[detected], predicted.sizes.height[detected]
        bodies = Candidates(ground, heights, self._body.width_of(heights))
        expected = [
            _ExpectedPeople(bodies, view, None if seen is None else view.foreground(seen))
            for view, seen in zip(views, observations, strict=True)
        ]
        number = np.array([len(people) for people in expected])
        share = np.array([people.shown.mean() if len(people) else 0.0 for people in expected])
        known = (number > 0) & ~self.knocked & (self.usual[:, 0] >= max(_KNOWN * self._rate, _FRAMES_KNOWN))
        falls = known & (self._fall(share) > 1)
        if falls.any() or self.knocked.any():
            self._count_gains(number, np.array([people.gain() for people in expected]), known, falls)
        own = np.column_stack([np.ones(len(views)), share, share**2])
        usual = self.usual * np.exp(-1 / (self._rate * self._memory)) + own
        self.usual = np.where((self.knocked | (number == 0))[:, None], self.usual, usual)

    def _fall(self, share: Floats) -> Floats:
        """By how much less than usual the views show of people (view,), beside the least fall of knocked ones."""
        mean = _mean(self.usual[:, :2])
        spread = np.sqrt(np.maximum(_mean(self.usual[:, ::2]) - mean**2, 0.0))
        return np.asarray((mean - share) / np.maximum(_FALL, _SPREADS * spread))

    def _count_gains(self, number: Ints, gains: Floats, known: Flags, falls: Flags) -> None:
        """Count what the best shift gains by a number of people (view,), and decide which views are knocked."""
        steady = known & (gains < _STEADY * number)
        shifted = falls & (gains >= np.maximum(_LEAST_GAIN, _FALL * number))
        begins = shifted & (steady.sum() >= _OTHERS) & (shifted.sum() == 1)
        self.recent *= np.exp(-1 / max(self._rate * _RECENT, _FRAMES))
        self.recent[begins] = 0.0
        self.recent += np.column_stack([number, gains])
        back = (self.recent[:, 0] > 0) & (_mean(self.recent) < _STEADY)
        self.knocked = begins | (self.knocked & ~back)


def _mean(sums: Floats) -> Floats:
    """Means by weights and weighted sums (view, 2), float64 (view,); 0 without weight."""
    return np.asarray(sums[:, 1] / np.where(sums[:, 0] > 0, sums[:, 0], 1.0))


class _ExpectedPeople:
    """People whom tracks predict in one view, whole, and its foreground, bool (v, u); nobody where it is blind."""

    def __init__(self, bodies: Candidates, view: BoxView | PixelView, foreground: Flags | None) -> None:
        here = bodies if foreground is not None else bodies.at(np.zeros(0, np.int64))
        first, spans, area = view.whole_outlines(here.ground, here.height, here.width)
        self._outlines = first, spans, np.zeros((0, 0), bool) if foreground is None else foreground
        found, pixels = self._found(_IN_PLACE)
        self._whole = np.flatnonzero(pixels > _WHOLE * area)
        self.shown = found[0, self._whole] / pixels[self._whole]

    def __len__(self) -> int:
        return len(self._whole)

    def _found(self, shifts: Ints) -> tuple[Ints, Ints]:
        """Foreground pixels inside outlines by shifts (n, 2) along v and u, int64 (n, body), and all pixels (body,)."""
        number = len(self._outlines[0])
        found, pixels = np.empty((len(shifts), number), np.int64), np.empty(number, np.int64)
        _fill_found(*self._outlines, shifts, found, pixels)
        return found, pixels

    def gain(self) -> float:
        """What the best shift gains by all people."""
        found, pixels = self._found(_SHIFTS)
        gains = ((found / np.maximum(pixels, 1))[:, self._whole] - self.shown).clip(-_MOST_GAIN, _MOST_GAIN)
        return float(gains.sum(1).max())


@kernel
def _fill_found(first: Ints, spans: Spans, foreground: Flags, shifts: Ints, found: Ints, pixels: Ints) -> None:
    """Fill found (n, body) with the foreground pixels inside outlines (body,) by shifts (n, 2), and pixels with all."""
    rows, columns = foreground.shape
    found[:] = 0
    for j in range(len(first)):
        pixels[j] = 0
        for k in range(spans.shape[1]):
            pixels[j] += max(spans[j, k, 1] - spans[j, k, 0], 0)
    for i in range(len(shifts)):
        for j in range(len(first)):
            for k in range(spans.shape[1]):
                v = first[j] + k + shifts[i, 0]
                if 0 <= v < rows:
                    left, right = spans[j, k, 0] + shifts[i, 1], spans[j, k, 1] + shifts[i, 1]
                    for u in range(max(left, 0), min(right, columns)):
                        found[i, j] += foreground[v, u]
