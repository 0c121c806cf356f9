"""Views that fail for a while: black, overexposed, pushed aside, or empty though people stand before them.

A view shows the people that other views see, and nothing where nobody is. With the share h of a person's outline in
it that is foreground, the mean over people, and the share c of all the rest, its informedness (Youden 1950) is

    J = h - c:

1 for a view without errors, and 0 for one that shows nothing, everything or noise. What is seen of people counts for
the time of a frame and person, and is forgotten quickly for J now and slowly for the usual J of the view. A view whose
J now is less than 0.7 of its usual one fails: it is excluded until J has come back. The usual J stands while
it fails, and counts in J now where little was seen of late, so a view without people comes back by itself.

A view that never showed more, since its calibration is wrong, has no better past to be measured by. Where its usual J
is less than 0.7 of the median usual J of four other sound views or more, that median is expected of it; among fewer it
is used, and the run says so afterwards. Only people count who would be there without the view, and whom two other views
show: of two views nobody can say which one fails.

A camera that is pushed still shows people: `knocked_views` recognises it, and its view is excluded too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Ints
from stseg.bodies.views import BoxView, PixelView, ViewObservation
from stseg.config import BodyConfig, ErrorRateConfig
from stseg.kernels.accelerate import kernel
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.view_health.knocked_views import KnockedViews

Seen = TypeVar("Seen")
"""What a view shows: evidence, or an observation."""

_LEAST = 0.7
"""Share of its usual informedness below which a view fails."""
_RECENT, _FRAMES = 0.25, 3.0
"""Time constant of the informedness now, seconds, and frames at least: a detector may miss many in one frame."""
_KNOWN = 2.0
"""Time of one person from which the usual informedness of a view is known, seconds."""
_EXPECTED = 0.1
"""Weight of the usual informedness in that of now, seconds of one person."""
_OTHERS = 2
"""Least number of other views that show a person who counts."""
_COMPARED, _LONG = 4, 3.0
"""Least number of other views by which a view fails that was never better, and time with people before, seconds."""
_SHOWN = 1.0
"""Evidence from which a view shows a person, nats."""


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
    level
        How fast is forgotten, and from which evidence on people count.

    Attributes
    ----------
    failing : bool (view,)
        Views whose informedness is too small.
    knocks
        Views that show people beside their places.
    excluded : bool (view,)
        Views that are excluded from the last frame.
    usual, recent : float64 (view, 2)
        Weight, and weighted sum of the informedness; seconds of one person.
    """

    def __init__(self, views: int, body: BodyConfig, frame_rate: float, level: ErrorRateConfig) -> None:
        self._rate, self._level = frame_rate, level
        self.failing, self.excluded = np.zeros(views, bool), np.zeros(views, bool)
        self.knocks = KnockedViews(views, body, frame_rate, level)
        self.usual, self.recent = np.zeros((views, 2)), np.zeros((views, 2))
        self._frames = np.zeros(views, np.int64)

    def kept(self, seen: Sequence[Seen]) -> list[Seen | None]:
        """What the views show; None for those that are excluded."""
        return [None if out else view for out, view in zip(self.excluded, seen, strict=True)]

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
        own = np.nan_to_num(people.view_evidence)
        shows = own >= _SHOWN
        shown = shows.sum(0)
        for k, (view, observation) in enumerate(zip(views, observations, strict=True)):
            if observation is None:
                continue
            sure = (people.evidence - own[k] >= self._level.minimum_evidence) & (shown - shows[k] >= _OTHERS)
            self._count(k, *informedness(explanation.pixel_assignment[k], sure, view.foreground(observation)))
        begins = self.failing & ~self.excluded
        self.excluded |= begins
        return bool(begins.any())

    def _count(self, k: int, number: int, informedness: float) -> None:
        """Count what view k shows of a number of people."""
        seconds = number / self._rate
        self._frames[k] += number > 0
        own = np.array([seconds, seconds * informedness])
        self.recent[k] = self.recent[k] * np.exp(-1 / max(self._rate * _RECENT, _FRAMES)) + own
        known, total = self.usual[k]
        if known >= _KNOWN:
            usual, of_others = total / known, self._usual_of_others(k)
            expected = usual if usual >= _LEAST * of_others else of_others
            weight, total = self.recent[k] + _EXPECTED * np.array([1.0, usual])
            self.failing[k] = total / weight < _LEAST * expected
        if not (self.failing[k] or self.knocks.knocked[k]):
            self.usual[k] = self.usual[k] * np.exp(-1 / (self._rate * self._level.memory)) + own

    def _usual_of_others(self, k: int) -> float:
        """The median of the usual informedness of sound views but view k, 0 where too little is known."""
        if len(self.failing) <= _COMPARED:
            return 0.0
        long = self._frames >= _LONG * self._rate
        sound = ~self.failing & ~self.knocks.knocked & long
        sound[k] = False
        if not long[k] or np.count_nonzero(sound) < _COMPARED:
            return 0.0
        return float(np.median(self.usual[sound, 1] / self.usual[sound, 0]))


def informedness(assignment: NDArray[np.int16], sure: Flags, foreground: Flags) -> tuple[int, float]:
    """How many people count in a view, and its informedness by them; 0 and 0 without any.

    Parameters
    ----------
    assignment : int16 (v, u)
        The person whose body is nearest at each raster pixel, -1 for none.
    sure : bool (person,)
        Who counts; others' pixels do not.
    foreground : bool (v, u)
    """
    if not sure.any():
        return 0, 0.0
    people, rest = np.zeros((len(sure), 2), np.int64), np.zeros(2, np.int64)
    _fill_counts(assignment, sure, foreground, people, rest)
    shown = people[people[:, 0] > 0]
    if not len(shown):
        return 0, 0.0
    return len(shown), float((shown[:, 1] / shown[:, 0]).mean() - rest[1] / max(int(rest[0]), 1))


@kernel
def _fill_counts(assignment: NDArray[np.int16], sure: Flags, foreground: Flags, people: Ints, rest: Ints) -> None:
    """Fill the pixels, and the foreground ones, of each person who is sure (person, 2), and of nobody (2,)."""
    number, shown = 0, 0
    for v in range(assignment.shape[0]):
        for u in range(assignment.shape[1]):
            person = assignment[v, u]
            if person < 0:
                number += 1
                shown += foreground[v, u]
            elif sure[person]:
                people[person, 0] += 1
                people[person, 1] += foreground[v, u]
    rest[0], rest[1] = number, shown
