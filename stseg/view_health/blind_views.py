"""Views without evidence: frozen, excluded, or missing, and the events of the run that say so.

A stream that hangs repeats its last picture, mask or boxes while the other cameras go on: the view is frozen.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Observation, Rows, ViewEvidence
from stseg.records.tables import EVENT, reason_of
from stseg.view_health.hand_over import SegmentStart
from stseg.view_health.view_failures import ViewFailures

_NO_EVIDENCE = "is frozen, or its light changes: excluded"
_FAILS = "shows too little of the people that other views show: excluded"
_KNOCKED = "shows people beside their places, as after a push: excluded"


class ExcludedViews:
    """Events of views of named cameras that are excluded although they deliver: where that begins and ends.

    Parameters
    ----------
    cameras
        Their names.
    start
        What was excluded before, and the first frame of which there are events.
    """

    def __init__(self, cameras: Sequence[str], start: SegmentStart) -> None:
        self._cameras, self._first = cameras, start.first
        since = dict(zip(start.excluded["view"].tolist(), start.excluded["since"].tolist(), strict=True))
        self.since = [None if since.get(k, -1) < 0 else since[k] for k in range(len(cameras))]
        """First frame from which each view is excluded; None where it counts."""

    def events(
        self, frame: int, observations: Sequence[Observation], evidence: Sequence[ViewEvidence], failures: ViewFailures
    ) -> Rows:
        """EVENT rows of kind `blind` of the next frame.

        Parameters
        ----------
        frame
            Its number.
        observations, evidence
            What the cameras deliver, and what of it is evidence; None for nothing.
        failures
            The views that are excluded from it for what they show.
        """
        reasons = []
        for k, name in enumerate(self._cameras if frame >= self._first else ()):
            since = self.since[k]
            excluded = observations[k] is not None and (evidence[k] is None or failures.excluded[k])
            if excluded and since is None:
                self.since[k] = frame
                why = _NO_EVIDENCE if evidence[k] is None else _KNOCKED if failures.knocks.knocked[k] else _FAILS
                reasons.append(f"camera {name} {why}")
            elif since is not None and not excluded and observations[k] is not None:
                self.since[k] = None
                reasons.append(f"camera {name} counts again, after {frame - since} frames")
        return np.array([(frame, b"blind", 0, 0, reason_of(reason)) for reason in reasons], EVENT)


_FROZEN_TIME, _FROZEN_FRAMES = 0.5, 3
"""Least time for which a frozen view repeats itself, seconds, and frames: longer than that of a frame in a gap."""

_COMPARED_STRIDE = 32
"""Rows from one to the next of those that are compared first: they differ in nearly every picture that does."""


class FrozenViews:
    """Recognition of frozen views in frame sets, in the order of time.

    A view is frozen once it has been the same, bit by bit, for half a second in which most of the others changed.
    Where all stand still, or a view shows no person, sameness is no failure.
    """

    def __init__(self, views: int, frame_rate: float) -> None:
        self._least = max(_FROZEN_FRAMES, round(_FROZEN_TIME * frame_rate))
        self._last: list[Observation] = [None] * views
        self._repeated = np.zeros(views, int)

    def without(self, observations: Sequence[Observation]) -> list[Observation]:
        """The observations of the next frame set; None for a frozen view."""
        same = np.array([_is_repeated(*pair) for pair in zip(observations, self._last, strict=True)])
        delivered = np.array([view is not None for view in observations])
        changed = delivered & ~same
        others = delivered.sum() - 1
        self._repeated[changed] = 0
        self._repeated[same & (2 * changed.sum() > others)] += 1
        self._last = list(observations)
        frozen = self._repeated >= self._least
        return [None if is_frozen else view for is_frozen, view in zip(frozen, observations, strict=True)]


def _is_repeated(view: Observation, last: Observation) -> bool:
    """Whether an observation is not empty and equals the last one."""
    if isinstance(view, Boxes):
        return isinstance(last, Boxes) and len(view) > 0 and np.array_equal(view.pixel, last.pixel)
    if view is None or last is None or isinstance(last, Boxes):
        return False
    if not (np.array_equal(view[::_COMPARED_STRIDE], last[::_COMPARED_STRIDE]) and np.array_equal(view, last)):
        return False
    return view.ndim == 3 or bool(np.any(view))


class BlindViews:
    """Missing views of named cameras in a live recording, and dropped frames, until their frames are committed."""

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = cameras
        self._dropped: set[int] = set()
        self._missing: dict[int, list[int]] = {}

    def note(self, frame: int, views: Sequence[Observation], dropped: bool) -> None:
        """Record the missing views of a frame, or that it was dropped."""
        missing = [k for k, view in enumerate(views) if view is None]
        if dropped:
            self._dropped.add(frame)
        elif missing:
            self._missing[frame] = missing

    def events(self, frames: Sequence[int]) -> Rows:
        """EVENT rows of committed frames: one for the number of dropped frames, and one per blind camera."""
        events = []
        dropped = [frame for frame in frames if frame in self._dropped]
        if dropped:
            events.append(
                (dropped[0], f"{len(dropped)} of {len(frames)} frames dropped: tracking is slower than the cameras")
            )
        for k, name in enumerate(self._cameras):
            blind = [frame for frame in frames if k in self._missing.get(frame, ())]
            if blind:
                events.append((blind[0], f"camera {name} showed nothing in {len(blind)} of {len(frames)} frames"))
        return np.array([(frame, b"blind", 0, 0, reason_of(text)) for frame, text in events], EVENT)

    def forget(self, before: int) -> None:
        """Discard the records of frames before frame `before`."""
        self._dropped = {frame for frame in self._dropped if frame >= before}
        self._missing = {frame: missing for frame, missing in self._missing.items() if frame >= before}
