"""Whether the views still agree: each segment of a run holds them against each other, by the people whom they show.

A camera that is off from the beginning is named in every segment, one that was knocked from the segment on in which
that happened: rows of /events of the kind `warning`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.calibrate.watch import ViewWatch
from stseg.geometry import Rig
from stseg.ghosts.people import ViewEvidence
from stseg.identity.segments import Segment
from stseg.tracks import EVENT

WARNING = b"warning"
_LOOKS = 100
"""Frames of a segment that are looked at."""
_LONGEST = EVENT["reason"].itemsize


class RigWatch:
    """The views of one segment."""

    def __init__(self, rig: Rig, segment: Segment) -> None:
        self._watch, self._segment = ViewWatch(rig), segment
        self._every = max(1, (segment.stop - segment.first) // _LOOKS)

    def witness(self, frame: int, seen: Sequence[ViewEvidence]) -> None:
        """What the views showed of a frame."""
        index, rest = divmod(frame - self._segment.first, self._every)
        if not rest and self._segment.first <= frame < self._segment.stop:
            self._watch.add(index, seen)

    def warnings(self) -> Rows:
        """An EVENT row for each view that is off by more than a cell."""
        words = [sentence.encode("ascii", "replace")[:_LONGEST] for sentence in self._watch.warnings()]
        return np.array([(self._segment.first, WARNING, 0, 0, sentence) for sentence in words], EVENT)


def told(events: Rows) -> list[str]:
    """What to say of a run's warnings: each view's first, and from which frame on."""
    found: dict[bytes, str] = {}
    for event in events[events["kind"] == WARNING]:
        reason = bytes(event["reason"])
        found.setdefault(reason.split(b" ")[0], f"from frame {event['frame']} on: {reason.decode()}")
    return list(found.values())
