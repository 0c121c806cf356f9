"""Views that fail for a while: black, overexposed, pushed aside, or empty though people stand before them.

A view shows the people that other views see, and nothing at empty places. With the share h of a person's outline in
it that is foreground, the mean over people, and the share c of all the rest, its informedness (Youden 1950) is

    J = h - c:

1 for a view without errors, and 0 for one that shows nothing, everything or noise. A measurement counts for
the time of a frame and person, and is forgotten quickly for J now and slowly for the usual J of the view. A view fails
while its J now is less than 0.7 of its usual one: it is excluded until J has come back. The usual J stands while
it fails, and counts in J now where few people were measured of late, so a view without people comes back by itself.

A view that never showed more, since its calibration is wrong, has no better past to be measured by. Where its usual J
is less than 0.7 of the median usual J of four other sound views or more, that median is expected of it; among fewer it
is used, and the run says so afterwards. Only people count who are supported without the
view and shown by two other views: of two views alone, the failing one is not determined.

A camera that is pushed still shows people: `knocked_views` recognises it, and its view is excluded too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags
from stseg.bodies.views import BoxView, PixelView, ViewObservation
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.records.forgetting import Forgetting
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.view_health.knocked_views import KnockedViews

ViewInput = TypeVar("ViewInput")
"""Evidence or observation of a view."""

_FAILURE_SHARE = 0.7
"""Share of its usual informedness below which a view fails."""
_RECENT_MEMORY, _RECENT_FRAMES = 0.25, 3.0
"""Time constant of the informedness now, seconds, and frames at least: a detector may miss many in one frame."""
_USUAL_TIME = 2.0
"""Least time of one person by which the usual informedness of a view is estimated, seconds."""
_USUAL_WEIGHT = 0.1
"""Weight of the usual informedness in that of now, seconds of one person."""
_OTHER_VIEWS = 2
"""Least number of other views that show a person who counts."""
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

    Attributes
    ----------
    failing : bool (view,)
        Views whose informedness is too small.
    knocks
        Views that show people beside their places.
    excluded : bool (view,)
        Views that are excluded from the last frame.
    usual, recent : (view, 2)
        Weight, and weighted sum of the informedness; seconds of one person.
    """

    def __init__(self, views: int, body: BodyConfig, frame_rate: float, config: ErrorRateConfig) -> None:
        self._rate, self._config = frame_rate, config
        self.failing, self.excluded = np.zeros(views, bool), np.zeros(views, bool)
        self.knocks = KnockedViews(views, body, frame_rate, config)
        self.usual = Forgetting((views, 2), frame_rate, config.memory)
        self.recent = Forgetting((views, 2), frame_rate, _RECENT_MEMORY, _RECENT_FRAMES)
        self._frames = np.zeros(views, np.int64)

    def kept(self, inputs: Sequence[ViewInput]) -> list[ViewInput | None]:
        """The inputs of all views; None for those that are excluded."""
        return [None if excluded else view for excluded, view in zip(self.excluded, inputs, strict=True)]

    def begin(
        self,
        predicted: PredictedTracks | None,
        views: Sequence[BoxView | PixelView],
        observations: Sequence[ViewObservation | None],
    ) -> None:
        """Exclude views from the next frame, before it is explained; `observations` are those of all views."""
        if predicted is not None:
            self.knocks.compare(predicted, views, observations)
        self.excluded = self.failing | self.knocks.knocked

    def learn(
        self,
        explanation: Explanation,
        views: Sequence[BoxView | PixelView],
        observations: Sequence[ViewObservation | None],
    ) -> bool:
        """Count one frame by its explanation; whether more views are excluded from it now."""
        people = explanation.people
        evidence = np.nan_to_num(people.view_evidence)
        supports = evidence >= _SUPPORT
        support = supports.sum(0)
        for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
            if observation is None:
                continue
            certain = (people.evidence - evidence[k] >= self._config.minimum_evidence) & (
                support - supports[k] >= _OTHER_VIEWS
            )
            self._count(k, *informedness(explanation.pixel_assignment[k], certain, view.foreground(observation)))
        begins = self.failing & ~self.excluded
        self.excluded |= begins
        return bool(begins.any())

    def _count(self, k: int, number: int, informedness: float) -> None:
        """Count the informedness of view k by a number of people."""
        seconds = number / self._rate
        self._frames[k] += number > 0
        counts = np.array([seconds, seconds * informedness])
        self.recent.forget(k)
        self.recent.add(counts, k)
        weight, total = self.usual.sums[k]
        if weight >= _USUAL_TIME:
            usual, of_others = total / weight, self._usual_of_others(k)
            expected = usual if usual >= _FAILURE_SHARE * of_others else of_others
            weight, total = self.recent.with_prior(_USUAL_WEIGHT, np.array([1.0, usual]))[k]
            self.failing[k] = total / weight < _FAILURE_SHARE * expected
        if not (self.failing[k] or self.knocks.knocked[k]):
            self.usual.forget(k)
            self.usual.add(counts, k)

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
    person = assignment + 1  # 0 for none
    pixels, occupied = (
        np.bincount(counted.ravel(), minlength=len(certain) + 1) for counted in (person, person[foreground])
    )
    visible = 1 + np.flatnonzero(certain & (pixels[1:] > 0))
    if not len(visible):
        return 0, 0.0
    return len(visible), float((occupied[visible] / pixels[visible]).mean() - occupied[0] / max(int(pixels[0]), 1))
