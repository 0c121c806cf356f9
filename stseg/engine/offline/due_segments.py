"""Which segment is made next, and with which views excluded: those that the segment before excludes at its end.

While that one is at work, it is taken to exclude at its end what it began with. A segment that was begun in error is
made again. So the segments are those that one after the other would give, for any number of workers, and a segment is
made twice only where workers were ahead when a view failed or came back.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.engine.offline.segments import Segment
from stseg.engine.reporter import Advance
from stseg.io.runfile.runs import read_run
from stseg.view_health.hand_over import NO_EXCLUDED_VIEWS


class DueSegments:
    """The segments of a run that are not made yet, or were begun in error.

    Parameters
    ----------
    plan
        All segments of the run, in the order of time.
    finished
        Files of those that are made, by number; of a segment that is begun again the file is deleted.
    """

    def __init__(self, plan: Sequence[Segment], finished: Mapping[int, Path]) -> None:
        self.finished = dict(finished)
        self._plan, self._begun, self._ends = plan, dict[int, Segment](), dict[int, Rows]()
        for segment in (one for one in plan if one.index in finished):
            before, _ = excluded_at_borders(segment, finished[segment.index])
            self._begun[segment.index] = replace(segment, excluded=before)
            self.keep(segment, finished[segment.index])

    def __len__(self) -> int:
        return sum(1 for _ in self._due())

    def next(self, advance: Advance) -> Segment | None:
        """The first one, at work from now on; None where none is due before another is made.

        `advance` is called with minus the number of frames of one that was begun in error.
        """
        segment = next(self._due(), None)
        if segment is None:
            return None
        if path := self.finished.pop(segment.index, None):
            path.unlink()
            advance(segment.first - segment.stop)
        self._ends.pop(segment.index, None)
        self._begun[segment.index] = segment
        return segment

    def keep(self, segment: Segment, path: Path) -> None:
        """A segment is made."""
        self.finished[segment.index] = path
        _, self._ends[segment.index] = excluded_at_borders(segment, path)

    def lose(self, segment: Segment) -> None:
        """The worker of a segment has died."""
        del self._begun[segment.index]

    def _due(self) -> Iterator[Segment]:
        excluded = NO_EXCLUDED_VIEWS
        for segment in self._plan:
            excluded = excluded.copy()
            excluded["frame"] = segment.first - 1
            begun = self._begun.get(segment.index)
            is_made = segment.index in self._ends
            if begun is None or (is_made and not np.array_equal(begun.excluded, excluded)):
                yield replace(segment, excluded=excluded)
            elif is_made:
                excluded = self._ends[segment.index]


def excluded_at_borders(segment: Segment, path: Path) -> tuple[Rows, Rows]:
    """EXCLUDED_VIEW (n,) before the first and after the last frame of a finished segment."""
    rows = read_run(path).excluded_views
    is_before = rows["frame"] < segment.first
    return rows[is_before], rows[~is_before]
