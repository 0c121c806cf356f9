"""Tables of a run: what every tracker returns and every writer takes.

Each is a structured array; positions are metres on the ground, boxes pixels of the real image, frames count from 0 at
the recording's first frame, track ids from 1.
"""

from dataclasses import dataclass, field

import numpy as np

from stseg.arrays import Rows, columns
from stseg.records.track_heights import median_measured

TRAJECTORY = np.dtype(
    [
        ("frame", "<i8"),
        ("id", "<i8"),
        ("x", "<f8"),  # metres, ground position, smoothed along the track
        ("y", "<f8"),
        ("z", "<f8"),  # always 0: the ground; viewers of trajectories ask for it
        ("xx", "<f8"),  # covariance of the position, square metres
        ("xy", "<f8"),
        ("yy", "<f8"),
        ("height", "<f4"),  # metres, by the frame alone; nan where it measured none
        ("width", "<f4"),  # metres across the shoulders, likewise
        ("extent", "<f4"),  # ground area of the labelled cells, square metres
        ("score", "<f4"),  # log-odds of a person, nats
        ("views", "u1"),  # number of views that see the place
        ("raw_x", "<f8"),  # metres, by the frame alone
        ("raw_y", "<f8"),
    ]
)
"""One row per person and frame."""

TRACK = np.dtype(
    [
        ("id", "<i8"),
        ("first", "<i8"),  # frames, both included
        ("last", "<i8"),
        ("frames", "<i8"),  # number of frames with a position
        ("score", "<f4"),  # mean log-odds, nats
        ("height", "<f4"),  # median of those measured, metres; nan without
        ("width", "<f4"),  # likewise
    ]
)
"""One row per track."""

BOX = columns("frame:<i8 id:<i8 view:<i4 left:<f4 top:<f4 width:<f4 height:<f4")
"""A track's box in one view, pixels: around a body of its height at its place."""

EVENT = columns("frame:<i8 kind:S12 id:<i8 other:<i8 reason:S96")
"""birth, death, merge, split, hand-over, doubt, return, dropped, blind, crowd; `other` is another track, 0 for none."""


def reason_of(text: str) -> bytes:
    """As much of a text as an event's reason holds, in whole characters."""
    return text.encode()[: EVENT["reason"].itemsize].decode(errors="ignore").encode()


def event_word(kind: str) -> str:
    """Word that people read for a kind of event: a merge, which begins an encounter, stands for all of it."""
    return "encounter" if kind == "merge" else kind


CORRECTION = columns("decision_frame:<i8 first:<i8 last:<i8 id:<i8 corrected_id:<i8")
"""Rows of a live id in frames `first` to `last`, both included, that are of another id.

`decision_frame` is the latest frame by which it was decided.
"""

CANDIDATE = columns("frame:<i8 x:<f8 y:<f8 xx:<f8 xy:<f8 yy:<f8 height:<f4 status:u1 evidence:<f4")
"""One row per candidate and frame, true (status 1) or ghost (0). In the run file each row also has one column a view.

`evidence` is the log-odds by all views and the prior, nats; below 0 for a ghost.
"""

FEATURES, COLOURS = 16, 6
"""Numbers of APPEARANCE."""

APPEARANCE = np.dtype(
    [
        ("frame", "<i8"),
        ("x", "<f8"),  # metres, place of the detection, as raw_x and raw_y of its trajectory row
        ("y", "<f8"),
        ("view", "<i4"),
        ("features", "<f4", (FEATURES,)),  # of the detector, along the recording's principal axes; nan without
        ("colours", "<f4", (COLOURS,)),  # mean logarithms of blue, green, red of trunk and legs; nan without
    ]
)
"""One row per detected person, frame and view that sees the person apart from others."""

WINDOW = np.dtype(
    [
        ("index", "<i8"),
        ("solve_first", "<i8"),  # frames that were solved together, half open
        ("solve_stop", "<i8"),
        ("commit_first", "<i8"),  # those of them with labels that are kept, half open
        ("commit_stop", "<i8"),
        ("energy", "<i8"),  # of the cut, in quanta
        ("energy_quantum", "<f8"),  # nats
        ("nodes_cut", "<i8"),  # nodes that were left to the minimum cut
    ]
)
"""One row per window."""

TIMING = columns("stage:S24 window:<i8 seconds:<f8")
"""One row per stage and window; window -1 for work that belongs to none."""


ERROR_RATES = ("miss", "clutter", "person_clutter")
"""Columns of RATES that are error rates of a view."""

RATES = np.dtype(
    [
        ("frame", "<i8"),
        ("view", "<i4"),
        ("miss", "<f4"),  # how often a cell of a body is missed
        ("clutter", "<f4"),  # how often the ray of an empty cell meets foreground, away from people
        ("person_clutter", "<f4"),  # the same within reach of a person
        ("occupied_share", "<f4"),  # share of the cells within reach of a person that bodies fill, by all views
        ("residual", "<f4"),  # mean reprojection residual, metres to the right of the positions by all views; or nan
    ]
)
"""One row per window and view: error rates of its last frame, 0..1, and the residual of all its frames."""


SHIFT = columns("frame:<i8 view:<i4 u:<f4 v:<f4")
"""Shift of a colour view's picture since its background was learned, pixels, every other second."""


EXCLUDED_VIEW = np.dtype(
    [
        ("frame", "<i8"),  # after which the view is in this state
        ("view", "<i4"),
        ("since", "<i8"),  # first frame from which it is excluded; -1 where it counts, unproven
        ("knocked", "u1"),
        ("informedness", "<f8", (2,)),  # usual one: seconds of one person, and weighted sum; 0 where it had no better
        ("deviation", "<f8", (3, 2)),  # of it, by span: seconds, and weighted sum of squares
        ("share", "<f8", (3,)),  # of people that a knocked view showed: frames, and sums of the share and its square
    ]
)
"""One row per view that is excluded where a segment ends, with what the next one needs to know of it."""


ANSWER = columns("row:<i8 other:<i8 people:u1")
"""Number of people that two committed rows show by an answer, by their index: 1, 2, or 0 for a row that is no person.

A row that is no person is its own `other`.
"""


KNOWN_PERSON = np.dtype(
    [
        ("id", "<i8"),
        ("height", "<f8"),  # metres, mean over so many rows; nan without
        ("height_count", "<i8"),
        ("colours", "<f8", (COLOURS,)),  # as of APPEARANCE, mean over so many rows, without the cameras' offsets
        ("appearance_count", "<i8"),
    ]
)
"""One row per person of earlier recordings; the people of this one are compared with them."""


@dataclass(frozen=True)
class Tracks:
    """Result of a tracker."""

    trajectory: Rows
    """TRAJECTORY (n,): sorted by frame, then id."""
    boxes: Rows = field(default_factory=lambda: np.zeros(0, BOX))
    """BOX (m,)."""
    events: Rows = field(default_factory=lambda: np.zeros(0, EVENT))
    """EVENT (k,)."""

    def summary(self) -> Rows:
        """One TRACK row per id, sorted by id."""
        ids, inverse = np.unique(self.trajectory["id"], return_inverse=True)
        rows = np.zeros(len(ids), TRACK)
        rows["id"] = ids
        order = np.argsort(inverse, kind="stable")
        bounds = np.searchsorted(inverse[order], np.arange(len(ids) + 1))
        for row, start, stop in zip(rows, bounds[:-1], bounds[1:], strict=True):
            track = self.trajectory[order[start:stop]]
            row["first"], row["last"], row["frames"] = track["frame"].min(), track["frame"].max(), len(track)
            row["score"] = track["score"].mean()
            row["height"], row["width"] = median_measured(track["height"]), median_measured(track["width"])
        return rows
