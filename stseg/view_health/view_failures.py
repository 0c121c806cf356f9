"""Views that fail for a while: black, overexposed, pushed aside, or empty though people stand before them.

A view shows the people that other views see, and nothing at empty places. With the share h of a person's outline in
it that is foreground, the mean over people, and the share c of all the rest, its informedness (Youden 1950) is

    J = h - c:

1 for a view without errors, and 0 for one that shows nothing, everything or noise. A measurement counts for
the time of a frame and person, and is forgotten slowly for the usual J of the view, and quickly for its J now: over
each of several spans. A view begins to fail when its J of one span is less than 0.7 of the usual one, and that is no
chance: the difference is more than 4.6 of its standard deviations. The deviation is what the means over as many
measurements have shown while the view was sound, so a detector that misses people in single frames excludes no view.
J of the shortest span must be below 0.7 of the usual one, too.
A low J and its deviations count in the usual ones as soon as it has come back without a failure.
A failing view is excluded until J of the shortest span has come back. The usual J counts in J now where few people were
measured of late, so a view without people comes back by itself. The usual J and the deviation stand until the view has
shown people again.
A view of which each measurement deviates by s is found to show nothing after about (5 s / J)^2 measurements.

A view that never showed more, since its calibration is wrong, has no better past to be measured by. Where its usual J
is less than 0.7 of the median usual J of four other sound views or more, that median is expected of it; among fewer it
is used, and the run says so afterwards. Only people count who are supported without the
view and shown by two other views: of two views alone, the failing one is not determined.

A camera that is pushed still shows people: `knocked_views` recognises it, and its view is excluded too.
"""

from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Ints
from stseg.bodies.views import DetectorView, ViewObservations
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.kernels.accelerate import kernel
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.view_health.knocked_views import OTHER_VIEWS, KnockedViews

ViewInput = TypeVar("ViewInput")
"""Evidence or observation of a view."""

_FAILURE_SHARE = 0.7
"""Share of its usual informedness below which a view fails."""
_SPANS, _SPAN_FRAMES = (0.25, 1.0, 4.0), (3.0, 1.0, 1.0)
"""Time constants of the informedness now, seconds, and frames at least: the shortest says when a view is back."""
_SIGNIFICANCE = 4.6
"""Least deviation of a failing view from its usual informedness, standard deviations: two in a million by chance."""
_VARIANCE, _VARIANCE_TIME = 0.2, 5.0
"""Variance of a measurement before the recording, and the time for which it counts, seconds."""
_MEASURED = 0.5
"""Least number of measurements in a span that is compared."""
_USUAL_TIME = 2.0
"""Least time of one person by which the usual informedness of a view is estimated, seconds."""
_USUAL_WEIGHT = 0.1
"""Weight of the usual informedness in that of now, seconds of one person."""
_COMPARED_VIEWS, _COMPARED_TIME = 4, 3.0
"""Least number of other views by which a view fails that was never better, and time with people before, seconds."""
_SUPPORT = 1.0
"""Least evidence of a view that shows a person, nats."""


class ViewFailures:
    """Views of a session that fail, or are knocked: their evidence is excluded.

    Parameters
    ----------
    views
        Number of views.
    body
        Sizes of the population.
    frame_rate
        Frames per second.
    config
        Memory, and least evidence of people who count.
    """

    def __init__(self, views: int, body: BodyConfig, frame_rate: float, config: ErrorRateConfig) -> None:
        self._rate, self._config = frame_rate, config
        self.failing, self.excluded = np.zeros(views, bool), np.zeros(views, bool)
        """bool (view,): views whose informedness is too small, and those that are excluded from the last frame."""
        self.unproven = np.zeros(views, bool)
        """bool (view,): views that have failed below what they showed before, and have not shown people since."""
        self.knocks = KnockedViews(views, body, frame_rate, config)
        """Views that show people beside their places."""
        self.usual = Forgetting((views, 2), frame_rate, config.memory)
        """(view, 2): weight, and weighted sum of the informedness; seconds of one person."""
        self.recent = [
            Forgetting((views, 2), frame_rate, span, frames) for span, frames in zip(_SPANS, _SPAN_FRAMES, strict=True)
        ]
        """The same for each span."""
        self.deviation = [Forgetting((views, 2), frame_rate, config.memory) for _ in _SPANS]
        """(view, 2) for each span: weight, and weighted sum of squared deviations, each times the number of
        measurements; seconds."""
        self.doubtful_usual, self.doubtful_deviation = np.zeros((views, 2)), np.zeros((views, len(_SPANS), 2))
        """(view, 2) and (view, span, 2): what is to be added to these since the informedness is low."""
        self._frames = np.zeros(views, np.int64)

    def kept(self, inputs: Sequence[ViewInput]) -> list[ViewInput | None]:
        """The inputs of all views; None for those that are excluded."""
        return [None if excluded else view for excluded, view in zip(self.excluded, inputs, strict=True)]

    def begin(
        self, predicted: PredictedTracks | None, views: Sequence[DetectorView], observations: ViewObservations
    ) -> None:
        """Exclude views from the next frame, before it is explained; `observations` are those of all views."""
        if predicted is not None:
            self.knocks.compare(predicted, views, observations)
        self.excluded = self.failing | self.knocks.knocked

    def learn(self, explanation: Explanation, views: Sequence[DetectorView], observations: ViewObservations) -> bool:
        """Count one frame by its explanation; whether more views are excluded from it now."""
        people = explanation.people
        supports = people.view_evidence >= _SUPPORT
        support = supports.sum(0)
        for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
            if observation is None:
                continue
            supported = people.supported_without(k, self._config.minimum_evidence)
            supported &= support - supports[k] >= OTHER_VIEWS
            self._count(k, *informedness(explanation.pixel_assignment[k], supported, view.foreground(observation)))
        begins = self.failing & ~self.excluded
        self.excluded |= begins
        return bool(begins.any())

    def _count(self, k: int, number: int, informedness: float) -> None:
        """Count the informedness of view k by a number of people."""
        seconds = number / self._rate
        self._frames[k] += number > 0
        counts = np.array([seconds, seconds * informedness])
        for recent in self.recent:
            recent.forget(k)
            recent.add(counts, k)
        self.doubtful_usual[k] += counts
        weight, total = self.usual.sums[k]
        is_low = False
        if weight >= _USUAL_TIME:
            usual, of_others = total / weight, self._usual_of_others(k)
            expected = usual if usual >= _FAILURE_SHARE * of_others else of_others
            weight, total = self.recent[0].with_prior(_USUAL_WEIGHT, np.array([1.0, usual]))[k]
            is_low = total / weight < _FAILURE_SHARE * expected
            self.failing[k] = is_low and (self.failing[k] or self._is_significant(k, expected))
            self.unproven[k] &= is_low or weight < 2 * _USUAL_WEIGHT
            self.unproven[k] |= self.failing[k] and expected == usual
            if number:
                self._add_deviations(k, usual)
        self._decide_doubtful(k, is_low)

    def _decide_doubtful(self, k: int, is_low: bool) -> None:
        """Count what is doubtful of view k in its usual informedness and deviation, or drop it where the view fails."""
        if self.failing[k] or self.unproven[k] or self.knocks.knocked[k]:
            self.doubtful_usual[k] = self.doubtful_deviation[k] = 0.0
            return
        self.usual.forget(k)
        for deviation in self.deviation:
            deviation.forget(k)
        if not is_low:
            self.usual.add(self.doubtful_usual[k], k)
            for deviation, doubtful in zip(self.deviation, self.doubtful_deviation[k], strict=True):
                deviation.add(doubtful, k)
            self.doubtful_usual[k] = self.doubtful_deviation[k] = 0.0

    def _measurements(self, k: int) -> Iterator[tuple[int, float, float]]:
        """Spans of view k that are compared: number of the span, of measurements in it, and their informedness."""
        for span, recent in enumerate(self.recent):
            weight, total = recent.sums[k]
            if weight * self._rate > _MEASURED:
                yield span, weight * self._rate, total / weight

    def _is_significant(self, k: int, expected: float) -> bool:
        """Whether the informedness of view k is less than expected over one span, and not by chance."""
        for span, number, informedness in self._measurements(k):
            weight, squares = self.deviation[span].with_prior(_VARIANCE_TIME, np.array([1.0, _VARIANCE]))[k]
            deviation = float(np.sqrt(squares / weight / number))
            if expected - informedness > max((1 - _FAILURE_SHARE) * expected, _SIGNIFICANCE * deviation):
                return True
        return False

    def _add_deviations(self, k: int, usual: float) -> None:
        """Add the deviations of the informedness of view k from its usual one to those that are doubtful."""
        for span, number, informedness in self._measurements(k):
            squares = number * (informedness - usual) ** 2
            self.doubtful_deviation[k, span] += np.array([1.0, squares]) / self._rate

    def _usual_of_others(self, k: int) -> float:
        """The median of the usual informedness of sound views but view k, 0 where it has too few data."""
        if len(self.failing) <= _COMPARED_VIEWS:
            return 0.0
        measured = self._frames >= _COMPARED_TIME * self._rate
        sound = ~self.failing & ~self.knocks.knocked & measured
        sound[k] = False
        if not measured[k] or np.count_nonzero(sound) < _COMPARED_VIEWS:
            return 0.0
        weight, total = self.usual.sums[sound].T
        return float(np.median(total / weight))


def informedness(assignment: NDArray[np.int16], certain: Flags, foreground: Flags) -> tuple[int, float]:
    """Number of people who count in a view, and its informedness by them; 0 and 0 without any.

    Parameters
    ----------
    assignment : int16 (v, u)
        The person of the nearest body at each raster pixel, -1 for none.
    certain : bool (person,)
        People who count; pixels of others do not.
    foreground : bool (v, u)
    """
    if not certain.any():
        return 0, 0.0
    pixels, occupied = np.zeros((2, len(certain) + 1), np.int64)
    _count_pixels(assignment, foreground, pixels, occupied)
    visible = 1 + np.flatnonzero(certain & (pixels[1:] > 0))
    if not len(visible):
        return 0, 0.0
    return len(visible), float((occupied[visible] / pixels[visible]).mean() - occupied[0] / max(int(pixels[0]), 1))


@kernel
def _count_pixels(assignment: NDArray[np.int16], foreground: Flags, pixels: Ints, occupied: Ints) -> None:
    """Count pixels and those of the foreground, each (1 + person,), of nobody first."""
    for v in range(assignment.shape[0]):
        for u in range(assignment.shape[1]):
            pixels[assignment[v, u] + 1] += 1
            occupied[assignment[v, u] + 1] += foreground[v, u]
