"""A set of candidates with the assignment of its evidence: gains of single moves without scoring the set anew.

The gain of a candidate is the difference of two scores (`scoring`). One more member changes the assignment of
pixels only inside its outline (`pixel_state`), that of boxes only among the members linked to it (`box_state`), and
that of tracks along one path (`track_state`): with the set's assignment at hand, the gain is a sum over these alone.
"""

from typing import NamedTuple, cast

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.box_state import BoxState, box_state
from stseg.detection.score.pixel_state import PixelState
from stseg.detection.score.track_state import TrackAssignment, track_state
from stseg.kernels.accelerate import kernel

NO_MEMBER = cast("int", np.int64(-1))
"""In place of a member. For -1 as it is numba would compile kernels anew, as for a type of its own."""


class Kept(NamedTuple):
    """All that is known of a set: to a copy of it the set returns when moves are taken back (`return_to`)."""

    numbers: Ints
    values: Floats
    flags: Flags


class SetState(NamedTuple):
    """A set of candidates of a problem, to which members are added, and from which they are removed."""

    problem: DetectionProblem
    """The candidates; `owner` is in use until `stseg.detection.score.moves.release`."""
    pixels: PixelState
    """Outlines of the candidates, and the assignment of pixels to the set."""
    boxes: BoxState
    """Links of candidates through boxes."""
    tracks: TrackAssignment
    """The assignment of tracks to the set."""
    members: Ints
    """int64 (candidate + 1,): the first `size[0]` are the set."""
    size: Ints
    """int64 (1,)."""
    changed: Ints
    """int64 (candidate,): number of the last move that the gain of each depends on."""
    settled: Ints
    """int64 (candidate,): number of moves after which no replacement of a member helped, -1 if none was tried."""
    moves: Ints
    """int64 (1,): number of moves so far; one that is taken back counts."""
    remaining: Ints
    """int64 (1,): gains that may still be computed in a search."""
    total: Floats
    """float64 (1,): sum of the gains of all moves, nats."""
    gains: Floats
    """float64 (part * candidate,): what each candidate gains by, or a member is worth: parts of views with boxes and
    with pixels, the latter for a weight of 1; last the whole. Nats."""
    inside: Flags
    """bool (candidate,): the set, and members of groups that do not interact with it."""
    is_known: Flags
    """bool (part * candidate,): whether that is the gain in the set as it is."""
    kept: Kept
    """The arrays of all fields from `members` on but the two numbers of moves and remaining gains."""


@kernel
def set_state(problem: DetectionProblem) -> SetState:
    """The empty set of a problem's candidates."""
    candidates = len(problem.size_prior)
    boxes, tracks = box_state(problem.boxes, problem.parameters), track_state(problem.track_gain, problem.birth_cost)
    parts = (boxes.views + len(problem.pixels.raster) + 1) * candidates
    numbers = np.zeros(3 * candidates + 2, np.int64)
    for i in range(candidates):
        numbers[2 * candidates + 2 + i] = -1
    kept = Kept(numbers, np.zeros(parts + 1), np.zeros(candidates + parts, np.bool_))
    return SetState(
        problem,
        PixelState(problem.pixels, problem.owner, np.zeros(problem.pixels.first.shape)),
        boxes,
        tracks,
        numbers[: candidates + 1],
        numbers[candidates + 1 : candidates + 2],
        numbers[candidates + 2 : 2 * candidates + 2],
        numbers[2 * candidates + 2 :],
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        kept.values[:1],
        kept.values[1:],
        kept.flags[:candidates],
        kept.flags[candidates:],
        kept,
    )
