"""An alternative hypothesis of the people, followed beside the tracks until the evidence decides.

With few views two sets of people often explain a frame nearly as well, and the tracks keep to the one that they
predict, though each frame is a little in favour of the other. So the other one is followed, too, with tracks of its
own. The log-likelihood ratio of both by the frames without tracks is added up, as in Wald's sequential test (1945).
Once it is large enough, the alternative replaces the tracks from the frame on at which it began. One is followed at a
time: a reading for which a single frame has more evidence than all frames for the followed one takes its place.
"""

from collections.abc import Mapping
from typing import NamedTuple

from stseg.arrays import Ints
from stseg.records.people import Alternative, Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.tracking.filter.track_filter import TrackFilter

_ACCEPTED, _REJECTED = 15.0, -10.0
"""Sums of gains at which the alternative is accepted, and is dropped, nats."""
_INDEPENDENT_INTERVAL = 0.2
"""Interval between frames that count as observations of their own, seconds: errors of silhouettes last."""
_SAME_SECONDS = 0.4
"""Time for which both hypotheses agree before the alternative is dropped, seconds."""
_LONGEST = 3.0
"""Time within which it must be decided, seconds."""


class Reading(NamedTuple):
    """An explanation of a frame, and the track of each of its people, int64 (n,)."""

    explanation: Explanation
    tracks: Ints


class AcceptedAlternative(NamedTuple):
    """An alternative with enough evidence."""

    filter: TrackFilter
    """Its tracks, before the current frame."""
    readings: Mapping[int, Reading]
    """Its readings of earlier frames, by their number."""
    explanation: Explanation
    """Its explanation of the current frame."""


class AlternativeTracks:
    """The alternative of a session, if there is one at present."""

    def __init__(self, frame_rate: float) -> None:
        self._frame_rate, self._weight = frame_rate, min(1.0, 1.0 / (frame_rate * _INDEPENDENT_INTERVAL))
        self._filter: TrackFilter | None = None
        self._last: tuple[int, Explanation] | None = None
        self._readings: dict[int, Reading] = {}
        self._begin, self._differed, self._gain = 0, 0, 0.0

    def predict(self, frame: int) -> PredictedTracks | None:
        """Predictions of the alternative's tracks for the next frame; None without one."""
        if self._filter is None:
            return None
        if self._last is not None:
            before, explanation = self._last
            tracks = self._filter.update(before, explanation.people, explanation.ghosts)
            self._readings[before], self._last = Reading(explanation, tracks), None
        return self._filter.predict(frame)

    def add(self, frame: int, explanation: Explanation, tracks: TrackFilter) -> AcceptedAlternative | None:
        """Add a frame's explanation with its alternatives; the one that is accepted from this frame on, if any.

        `tracks` are the current ones, from which an alternative begins.
        """
        if explanation.followed is not None:
            self._add(frame, explanation.followed)
        found = explanation.found
        if found is not None and self._weight * (found.gain or 0.0) > self._gain:
            self._filter, self._readings, self._begin, self._gain = tracks.branch(), {}, frame, 0.0
            self._add(frame, found)
        if self._filter is None or self._last is None:
            return None
        decision = None
        if self._gain > _ACCEPTED:
            decision = AcceptedAlternative(self._filter, self._readings, self._last[1])
        is_over = frame - self._begin > _LONGEST * self._frame_rate
        is_same = frame - self._differed >= _SAME_SECONDS * self._frame_rate
        if decision is not None or is_over or is_same or self._gain < _REJECTED:
            self._filter, self._gain = None, 0.0
        return decision

    def _add(self, frame: int, alternative: Alternative) -> None:
        """Add the reading of a frame to those of the alternative that is followed, and its gain."""
        self._last = frame, alternative.explanation
        if alternative.gain is not None:
            self._differed, self._gain = frame, self._gain + self._weight * alternative.gain
