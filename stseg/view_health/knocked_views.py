"""Views that are knocked: from one frame on they show all people beside their places, in one image direction.

A view shows a share h of the outline of a predicted person as foreground. In the frame in which a camera
is pushed aside, h falls, and one shift of the whole picture puts the people back; in the other views no shift does. So
a view is knocked where

- the mean of h over people is less than usual by 0.2, and by four times its own spread from frame to frame,
- one shift, of a body's height at most, gains by it 0.2 in the mean and 1 in the sum, one whole person,
- in two other views at least no shift gains 0.1 in the mean, and no other view falls so: tracks that err together do in
  several.

The gain of one person is bounded by 1/2: a detector may miss a person. The view is excluded from that frame on: a frame
later tracks would follow it, and of three views no majority says which one errs. It counts again once shifts gain less
than 0.1 in the mean of a quarter of a second, three frames at least, by the tracks of the others.

Only people count who were detected in the last frames and have outlines within the image. A view that stands
beside from the start, since its calibration is wrong, is not knocked.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.outlines import WHOLE_SHARE, Spans
from stseg.bodies.views import DetectorView, ViewObservations
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.kernels.accelerate import kernel
from stseg.records.candidates import Candidates
from stseg.records.forgetting import Forgetting
from stseg.records.predicted_tracks import PredictedTracks

_FALL = 0.2
"""Least fall of the mean share of people that a knocked view shows, and least gain of the best shift per person."""
_FALL_DEVIATIONS = 4.0
"""Least fall in standard deviations of the mean over people from frame to frame."""
_GAIN_BOUND = 0.5
"""Bound of the gain of a shift by one person."""
_TOTAL_GAIN = 1.0
"""Least gain of the best shift of a knocked view by all people."""
_STEADY_GAIN = 0.1
"""Mean gain of a shift below which a view is not knocked."""
OTHER_VIEWS = 2
"""Least number of other views by which a view is judged."""
_USUAL_TIME, _USUAL_FRAMES = 1.0, 5.0
"""Least time with people by which the usual share of a view is estimated, seconds, and frames at least."""
_RECENT_MEMORY, _RECENT_FRAMES = 0.25, 3.0
"""Time constant of the gains of shifts in a knocked view, seconds, and frames at least."""
_GREATEST_SHIFT, _SHIFT_INTERVAL = 30, 2
"""Greatest shift, about a body's height, and distance between those that are tried, raster pixels."""
_ALONG = np.arange(-_GREATEST_SHIFT, _GREATEST_SHIFT + 1, _SHIFT_INTERVAL)
_IN_PLACE = np.zeros((1, 2), np.int64)
_SHIFTS = np.stack(np.meshgrid(_ALONG, _ALONG, indexing="ij"), -1).reshape(-1, 2)


class KnockedViews:
    """Recognition of knocked views in a session; parameters as of `stseg.noise.estimates`."""

    def __init__(self, views: int, body: BodyConfig, frame_rate: float, config: ErrorRateConfig) -> None:
        self._body, self._usual_frames = body, max(_USUAL_TIME * frame_rate, _USUAL_FRAMES)
        self.knocked = np.zeros(views, bool)
        """bool (view,): whether each view is knocked."""
        self.usual = Forgetting((views, 3), frame_rate, config.memory)
        """(view, 3): frames with people, and sums of the mean share of them that views show, and of its square."""
        self.recent = Forgetting((views, 2), frame_rate, _RECENT_MEMORY, _RECENT_FRAMES)
        """(view, 2): people, and sum of the gains of the best shift while a view is knocked."""

    def compare(
        self, predicted: PredictedTracks, views: Sequence[DetectorView], observations: ViewObservations
    ) -> None:
        """Count the next frame, before it is explained: the share of predicted people that each view shows."""
        detected = predicted.existence > 0
        ground, heights = predicted.ground[detected], predicted.sizes.height[detected]
        bodies = Candidates(ground, heights, self._body.width_of(heights))
        expected = [
            _ExpectedPeople(bodies, view, None if observation is None else view.foreground(observation))
            for view, observation in zip(views, observations, strict=True)
        ]
        number = np.array([len(people) for people in expected])
        share = np.array([people.share.mean() if len(people) else 0.0 for people in expected])
        measured = (number > 0) & ~self.knocked & (self.usual.sums[:, 0] >= self._usual_frames)
        falls = measured & (self._fall(share) > 1)
        if falls.any() or self.knocked.any():
            self._count_gains(number, expected, measured, falls)
        counted = ~self.knocked & (number > 0)
        self.usual.forget(counted)
        self.usual.add(np.column_stack([np.ones(len(views)), share, share**2])[counted], counted)

    def _fall(self, share: Floats) -> Floats:
        """Fall of the shares below the usual ones (view,), over the least fall of a knocked view."""
        usual = self.usual.sums
        mean = _mean(usual[:, :2])
        spread = np.sqrt(np.maximum(_mean(usual[:, ::2]) - mean**2, 0.0))
        return np.asarray((mean - share) / np.maximum(_FALL, _FALL_DEVIATIONS * spread))

    def _count_gains(self, number: Ints, people: Sequence[_ExpectedPeople], measured: Flags, falls: Flags) -> None:
        """Count the gain of the best shift by a number of people (view,), and decide which views are knocked."""
        gains = np.array([one.gain() if due else 0.0 for one, due in zip(people, falls | self.knocked, strict=True)])
        shifted = falls & (gains >= np.maximum(_TOTAL_GAIN, _FALL * number))
        if shifted.any():  # seldom: only then all others are asked, at 961 shifts each
            gains = np.array([one.gain() for one in people])
        steady = measured & (gains < _STEADY_GAIN * number)
        begins = shifted & (steady.sum() >= OTHER_VIEWS) & (shifted.sum() == 1)
        self.recent.forget()
        self.recent.sums[begins] = 0.0
        self.recent.add(np.column_stack([number, gains]))
        recent = self.recent.sums
        back = (recent[:, 0] > 0) & (_mean(recent) < _STEADY_GAIN)
        self.knocked = begins | (self.knocked & ~back)


def _mean(sums: Floats) -> Floats:
    """Means by weights and weighted sums (view, 2), float64 (view,); 0 without weight."""
    return np.asarray(sums[:, 1] / np.where(sums[:, 0] > 0, sums[:, 0], 1.0))


class _ExpectedPeople:
    """Predicted people within one view's image, and its foreground, bool (v, u); none where the view is blind."""

    def __init__(self, bodies: Candidates, view: DetectorView, foreground: Flags | None) -> None:
        visible = bodies if foreground is not None else bodies.at(np.zeros(0, np.int64))
        first, spans, area = view.whole_outlines(visible.ground, visible.height, visible.width)
        self._outlines = first, spans, np.zeros((0, 0), bool) if foreground is None else foreground
        found, pixels = found_pixels(*self._outlines, _IN_PLACE)
        self._whole = np.flatnonzero(pixels > WHOLE_SHARE * area)
        self.share = found[0, self._whole] / pixels[self._whole]

    def __len__(self) -> int:
        return len(self._whole)

    def gain(self) -> float:
        """Gain of the best shift by all people."""
        found, pixels = found_pixels(*self._outlines, _SHIFTS)
        gains = ((found / np.maximum(pixels, 1))[:, self._whole] - self.share).clip(-_GAIN_BOUND, _GAIN_BOUND)
        return float(gains.sum(1).max())


def found_pixels(first: Ints, spans: Spans, foreground: Flags, shifts: Ints) -> tuple[Ints, Ints]:
    """Foreground pixels inside outlines (body,) shifted by (n, 2) along v and u, int64 (n, body); all (body,)."""
    found = np.empty((len(shifts), len(first)), np.int64)
    _fill_found(first, spans, foreground, shifts, found)
    return found, (spans[..., 1] - spans[..., 0]).clip(0).sum(1, dtype=np.int64)


@kernel
def _fill_found(first: Ints, spans: Spans, foreground: Flags, shifts: Ints, found: Ints) -> None:
    """Fill found (n, body), see `found_pixels`, by sums of pixels to the left of each column."""
    rows, columns = foreground.shape
    left_of = np.zeros((rows, columns + 1), np.int32)
    for v in range(rows):
        for u in range(columns):
            left_of[v, u + 1] = left_of[v, u] + foreground[v, u]
    for n in range(len(shifts)):
        for j in range(len(first)):
            total, top = 0, first[j] + shifts[n, 0]
            for k in range(max(-top, 0), min(spans.shape[1], len(left_of) - top)):
                left = min(max(spans[j, k, 0] + shifts[n, 1], 0), columns)
                right = min(max(spans[j, k, 1] + shifts[n, 1], left), columns)
                total += left_of[top + k, right] - left_of[top + k, left]
            found[n, j] = total
